"""A linker for what PoCL compiles: one relocatable x86-64 object in, one shared object out.

PoCL ends each build by asking Clang to link, and Clang calls a program named ``ld`` with ``-lc -lgcc -lgcc_s``. A bare
system has none of the four. A kernel needs little of a linker: its object has code, constants and a few calls of
functions such as ``memset``, which the process has already. So this file does that little, and refuses everything else
with a sentence. It imports nothing but the standard library's smallest parts: Python starts it once for each kernel.

References: System V ABI, AMD64 supplement (relocations), and the generic ABI (dynamic section, hash table).
"""

from __future__ import annotations

import os
import struct
import sys
from dataclasses import dataclass, field

PAGE = 0x1000
HEADERS = 64 + 6 * 56
"""The file header and at most six program headers."""
ALLOC, WRITE, EXEC, TLS = 0x2, 0x1, 0x4, 0x400
NOBITS, SYMTAB, RELA, INIT_KINDS = 8, 2, 4, frozenset({14, 15, 16})
UNDEFINED, ABSOLUTE, COMMON = 0, 0xFFF1, 0xFFF2
LOCAL, TLS_KIND = 0, 6
R_64, R_PC32, R_PLT32, R_PC64 = 1, 2, 4, 24
R_GOT = frozenset({9, 41, 42})
"""R_X86_64_GOTPCREL, GOTPCRELX and REX_GOTPCRELX: the address of a symbol, read from a table."""
DYN_64, GLOB_DAT, RELATIVE = 1, 6, 8
LIBRARIES = (b"libm.so.6", b"libc.so.6")
"""Libraries in which undefined symbols are looked for. The process that loads the kernel has both."""


class CannotLink(Exception):
    """The object needs what this linker does not do; the message says what in one sentence."""


@dataclass
class Section:
    """One section of the object, with its address in the output once it is placed."""

    name: str
    kind: int
    flags: int
    offset: int
    size: int
    link: int
    info: int
    align: int
    address: int = 0


@dataclass
class Symbol:
    """One symbol of the object."""

    name: bytes
    binding: int
    kind: int
    index: int
    value: int
    size: int


@dataclass
class Output:
    """The layout under way: parts by address, dynamic relocations, and the table of addresses of symbols."""

    parts: list[tuple[int, bytearray]] = field(default_factory=list)
    relocations: list[tuple[int, int, int, int]] = field(default_factory=list)
    """(address, symbol's number in the dynamic table, kind, addend)."""
    got: dict[int, int] = field(default_factory=dict)
    """Addresses of table entries by symbol number of the object."""
    plt: dict[int, int] = field(default_factory=dict)


def link(data: bytes) -> bytes:
    """The shared object for a relocatable one. Raises CannotLink."""
    sections, symbols = _parsed(data)
    needing = _symbols_by_need(data, sections)
    exported = [k for k, s in enumerate(symbols) if s.binding != LOCAL and s.index != UNDEFINED]
    imported = [k for k, s in enumerate(symbols) if s.binding != LOCAL and s.index == UNDEFINED and s.name]
    dynamic = {k: n for n, k in enumerate([*imported, *exported], 1)}
    out = Output()
    read_only = [s for s in sections if s.flags & ALLOC and not s.flags & (WRITE | EXEC)]
    code = [s for s in sections if s.flags & ALLOC and s.flags & EXEC]
    writable = [s for s in sections if s.flags & ALLOC and s.flags & WRITE]
    names = _Names(symbols, imported, exported)
    tables = HEADERS
    after = _place(read_only, tables + names.bytes)
    text = _up(after, PAGE)
    after = _place(code, text)
    stubs = _up(after, 16)
    calls = sorted(k for k in needing.calls if symbols[k].index == UNDEFINED)
    out.plt = {k: stubs + 8 * n for n, k in enumerate(calls)}
    text_end = stubs + 8 * len(calls)
    table = _up(text_end, PAGE)
    listed = sorted(needing.addresses | set(calls))
    out.got = {k: table + 8 * n for n, k in enumerate(listed)}
    dynamic_at = table + 8 * len(listed)
    relocation_room = 24 * (len(listed) + needing.pointers)
    relocations_at = dynamic_at + 16 * 16
    filled = _place([s for s in writable if s.kind != NOBITS], relocations_at + relocation_room)
    end = _place_common(symbols, _place([s for s in writable if s.kind == NOBITS], filled))
    for section in (*read_only, *code, *writable):
        if section.kind != NOBITS:
            out.parts.append((section.address, bytearray(data[section.offset : section.offset + section.size])))
    _relocate(data, sections, symbols, dynamic, out)
    for k in listed:
        symbol = symbols[k]
        if symbol.index == UNDEFINED:
            out.relocations.append((out.got[k], dynamic[k], GLOB_DAT, 0))
        else:
            out.relocations.append((out.got[k], 0, RELATIVE, _address(symbol, sections)))
    for k in calls:
        jump = struct.pack("<BBi", 0xFF, 0x25, out.got[k] - (out.plt[k] + 6)) + b"\x66\x90"
        out.parts.append((out.plt[k], bytearray(jump)))
    named, entries = names.made(symbols, sections, tables)
    out.parts += named
    packed = b"".join(struct.pack("<QQq", at, number << 32 | kind, add) for at, number, kind, add in out.relocations)
    out.parts.append((relocations_at, bytearray(packed)))
    entries += [(7, relocations_at), (8, len(packed)), (9, 24), (24, 0), (30, 8), (0, 0)]
    entries = [e for e in entries if e[0] not in (7, 8, 9) or packed]
    dynamic_bytes = b"".join(struct.pack("<QQ", *entry) for entry in entries)
    out.parts.append((dynamic_at, bytearray(dynamic_bytes)))
    loads = [
        (4, 0, _after(read_only, tables + names.bytes), 0),
        (5, text, text_end - text, text_end - text),
        (6, table, filled - table, end - table),
    ]
    return _written(out, loads, (dynamic_at, len(dynamic_bytes)), filled)


def _after(sections: list[Section], least: int) -> int:
    """Returns where the first segment ends."""
    return max([least, *(s.address + s.size for s in sections)])


class _Names:
    """The dynamic symbols, their names and the hash table that finds them."""

    def __init__(self, symbols: list[Symbol], imported: list[int], exported: list[int]) -> None:
        self._order = [*imported, *exported]
        self._strings, self._at = bytearray(b"\0"), {}
        for k in self._order:
            self._at[k] = len(self._strings)
            self._strings += symbols[k].name + b"\0"
        self._needed = []
        for name in LIBRARIES if imported else ():
            self._needed.append(len(self._strings))
            self._strings += name + b"\0"
        self.bytes = _up(24 * (len(self._order) + 1) + 4 * (4 + len(self._order)) + len(self._strings), 16)

    def made(
        self, symbols: list[Symbol], sections: list[Section], at: int
    ) -> tuple[list[tuple[int, bytearray]], list[tuple[int, int]]]:
        """The parts, and the entries of the dynamic section that name them."""
        table = bytearray(24)
        for k in self._order:
            s = symbols[k]
            there = s.index != UNDEFINED
            value = _address(s, sections) if there else 0
            place = 1 if there else 0
            table += struct.pack("<IBBHQQ", self._at[k], s.binding << 4 | s.kind, 0, place, value, s.size)
        count = len(self._order) + 1
        chain = [0, *range(2, count), 0] if count > 1 else [0]  # one bucket holds symbol 1, then 2 …
        hashed = struct.pack(f"<III{count}I", 1, count, 1 if count > 1 else 0, *chain)
        hash_at = at + len(table)
        strings_at = hash_at + len(hashed)
        entries = [(1, name) for name in self._needed]
        entries += [(4, hash_at), (5, strings_at), (6, at), (10, len(self._strings)), (11, 24)]
        return [(at, table), (hash_at, bytearray(hashed)), (strings_at, bytearray(self._strings))], entries


@dataclass
class _Needs:
    """Collects what relocations ask for: symbols by number that are called, whose address is read, and pointers in
    data."""

    calls: set[int] = field(default_factory=set)
    addresses: set[int] = field(default_factory=set)
    pointers: int = 0


def _symbols_by_need(data: bytes, sections: list[Section]) -> _Needs:
    needs = _Needs()
    for target, _, kind, number, _ in _relocations(data, sections):
        if kind in R_GOT:
            needs.addresses.add(number)
        elif kind in (R_PLT32, R_PC32):
            needs.calls.add(number)
        elif kind == R_64:
            needs.pointers += 1
        elif kind != R_PC64:
            raise CannotLink(f"A relocation of kind {kind} in {target.name} is not one that kernels have.")
    return needs


def _relocations(data: bytes, sections: list[Section]) -> list[tuple[Section, int, int, int, int]]:
    """(section, offset, kind, number of the symbol, addend) of all that is loaded."""
    found = []
    for section in sections:
        if section.kind != RELA or not sections[section.info].flags & ALLOC:
            continue
        for at in range(section.offset, section.offset + section.size, 24):
            offset, info, addend = struct.unpack_from("<QQq", data, at)
            found.append((sections[section.info], offset, info & 0xFFFFFFFF, info >> 32, addend))
    return found


def _relocate(
    data: bytes, sections: list[Section], symbols: list[Symbol], dynamic: dict[int, int], out: Output
) -> None:
    """Fills in the addresses that are known, and lists those that the loader fills in."""
    content = dict(out.parts)
    for section, offset, kind, number, addend in _relocations(data, sections):
        symbol, place = symbols[number], section.address + offset
        known = symbol.index != UNDEFINED
        if kind == R_64:
            if not section.flags & WRITE:
                raise CannotLink(f"{section.name} has an address in it but cannot be written.")
            value = _address(symbol, sections) + addend if known else addend
            how = (place, 0, RELATIVE, value) if known else (place, dynamic[number], DYN_64, value)
            out.relocations.append(how)
            continue
        if kind in R_GOT:
            target = out.got[number]
        elif known:
            target = _address(symbol, sections)
        elif kind == R_PLT32:
            target = out.plt[number]
        else:
            raise CannotLink(f"{symbol.name.decode()} is not in the kernel's object, yet its bytes are read.")
        width, value = ("<q" if kind == R_PC64 else "<i"), target + addend - place
        if kind != R_PC64 and not -(1 << 31) <= value < 1 << 31:
            raise CannotLink("The kernel is larger than two gigabytes.")
        struct.pack_into(width, content[section.address], offset, value)


def _parsed(data: bytes) -> tuple[list[Section], list[Symbol]]:
    if len(data) < 64 or data[:6] != b"\x7fELF\x02\x01" or struct.unpack_from("<HH", data, 16) != (1, 62):
        raise CannotLink("This is not a relocatable object for x86-64.")
    start, count, strings = struct.unpack_from("<Q", data, 40)[0], *struct.unpack_from("<HH", data, 60)
    raw = [struct.unpack_from("<IIQQQQIIQQ", data, start + 64 * k) for k in range(count)]
    names = raw[strings][4]
    sections = [
        Section(_text(data, names + r[0]).decode(), r[1], r[2], r[4], r[5], r[6], r[7], max(1, r[8])) for r in raw
    ]
    for s in sections:
        if s.flags & ALLOC and (s.flags & TLS or s.kind in INIT_KINDS):
            raise CannotLink(f"The section {s.name} is not one that kernels have.")
    symbols: list[Symbol] = []
    for table in (s for s in sections if s.kind == SYMTAB):
        base = sections[table.link].offset
        for at in range(table.offset, table.offset + table.size, 24):
            name, info, _, index, value, size = struct.unpack_from("<IBBHQQ", data, at)
            symbols.append(Symbol(_text(data, base + name), info >> 4, info & 15, index, value, size))
    if any(s.kind == TLS_KIND for s in symbols):
        raise CannotLink("Variables of a thread are not what kernels have.")
    return sections, symbols


def _text(data: bytes, at: int) -> bytes:
    return data[at : data.index(b"\0", at)]


def _address(symbol: Symbol, sections: list[Section]) -> int:
    if symbol.index in (ABSOLUTE, COMMON):
        return symbol.value
    return sections[symbol.index].address + symbol.value


def _up(value: int, step: int) -> int:
    return -(-value // step) * step


def _place(sections: list[Section], at: int) -> int:
    for section in sections:
        at = section.address = _up(at, section.align)
        at += section.size
    return at


def _place_common(symbols: list[Symbol], at: int) -> int:
    """Symbols that the linker has to make room for: their value was their alignment, and becomes their address."""
    for symbol in symbols:
        if symbol.index == COMMON:
            at = symbol.value = _up(at, max(1, symbol.value))
            at += symbol.size
    return at


def _written(out: Output, loads: list[tuple[int, int, int, int]], dynamic: tuple[int, int], size: int) -> bytes:
    """The file: addresses are offsets. ``loads``: flags, address, bytes in the file, bytes in memory (0: as many)."""
    file = bytearray(size)
    for at, part in out.parts:
        file[at : at + len(part)] = part
    headers = [(1, flags, at, held, memory or held, PAGE) for flags, at, held, memory in loads if held or memory]
    headers += [(2, 6, *dynamic, dynamic[1], 8), (0x6474E551, 6, 0, 0, 0, 16)]
    file[:64] = struct.pack(
        "<16sHHIQQQIHHHHHH", b"\x7fELF\x02\x01\x01", 3, 62, 1, 0, 64, 0, 0, 64, 56, len(headers), 64, 0, 0
    )
    for k, (kind, flags, at, held, memory, align) in enumerate(headers):
        struct.pack_into("<IIQQQQQQ", file, 64 + 56 * k, kind, flags, at, at, at, held, memory, align)
    return bytes(file)


def main(arguments: list[str]) -> int:
    """``ld`` as Clang calls it; options that name libraries and folders are left out."""
    if "-o" not in arguments[:-1]:
        sys.stderr.write("esker's linker: -o FILE is missing.\n")
        return 1
    target = arguments[arguments.index("-o") + 1]
    objects = [a for a in arguments if a.endswith(".o") and a != target]
    try:
        if len(objects) != 1:
            raise CannotLink(f"It links one object, not {len(objects)}.")
        with open(objects[0], "rb") as file:
            linked = link(file.read())
        with open(target, "wb") as file:
            file.write(linked)
        os.chmod(target, 0o755)
    except (CannotLink, OSError, struct.error, IndexError, ValueError) as error:
        sys.stderr.write(f"esker's linker: {error}\n")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
