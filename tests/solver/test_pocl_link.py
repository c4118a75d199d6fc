"""The linker for kernels: objects of LLVM become libraries that can be loaded and called (SPEC S142)."""

from __future__ import annotations

import ctypes
import struct
import subprocess
import sys
from pathlib import Path

import llvmlite.binding as llvm  # type: ignore[import-untyped]
import pytest

from esker.solve.opencl.pocl import link

IR = """
target triple = "x86_64-unknown-linux-gnu"
@table = internal constant [4 x i32] [i32 2, i32 3, i32 5, i32 7], align 64
@count = internal global i32 40
@room = internal global [64 x i8] zeroinitializer, align 32
@where = internal global ptr @count
declare ptr @memset(ptr, i32, i64)
declare double @cos(double)
@environ = external global ptr
define i32 @pick(i32 %k) {
  %at = getelementptr [4 x i32], ptr @table, i32 0, i32 %k
  %v = load volatile i32, ptr %at
  ret i32 %v
}
define i32 @up() {
  %p = load volatile ptr, ptr @where
  %a = load volatile i32, ptr %p
  %b = add i32 %a, 1
  store volatile i32 %b, ptr %p
  ret i32 %b
}
define i32 @filled(i32 %with) {
  %ignored = call ptr @memset(ptr @room, i32 %with, i64 64)
  %at = getelementptr [64 x i8], ptr @room, i32 0, i32 63
  %v = load volatile i8, ptr %at
  %w = zext i8 %v to i32
  ret i32 %w
}
define double @cosine(double %x) {
  %y = call double @cos(double %x)
  ret double %y
}
define i1 @has_environment() {
  %e = load volatile ptr, ptr @environ
  %there = icmp ne ptr %e, null
  ret i1 %there
}
"""


def compiled(text: str, reloc: str = "pic") -> bytes:
    """The object that LLVM makes."""
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    target = llvm.Target.from_triple("x86_64-unknown-linux-gnu")
    machine = target.create_target_machine(cpu="x86-64", reloc=reloc, codemodel="small")
    return bytes(machine.emit_object(llvm.parse_assembly(text)))


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    """Linked as Clang has it linked, by the program that PoCL starts."""
    folder = tmp_path_factory.mktemp("linked")
    (folder / "kernel.so.o").write_bytes(compiled(IR))
    options = ["--hash-style=both", "--eh-frame-hdr", "-m", "elf_x86_64", "-shared", "-o", str(folder / "kernel.so"),
               "-L/usr/lib/gcc", "-L/lib", str(folder / "kernel.so.o"), "-lgcc", "--as-needed", "-lgcc_s",
               "--no-as-needed", "-lc"]  # fmt: skip
    subprocess.run([sys.executable, "-I", "-S", "-B", link.__file__, *options], check=True)
    return ctypes.CDLL(str(folder / "kernel.so"))


pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="PoCL's wheel is for Linux")


def test_constants_variables_and_calls(library: ctypes.CDLL) -> None:
    """SPEC S142."""
    assert [library.pick(k) for k in range(4)] == [2, 3, 5, 7]
    assert [library.up(), library.up()] == [41, 42]
    assert library.filled(200) == 200
    library.cosine.restype, library.cosine.argtypes = ctypes.c_double, [ctypes.c_double]
    assert library.cosine(0.0) == 1.0
    library.has_environment.restype = ctypes.c_bool
    assert library.has_environment()
    with pytest.raises(AttributeError):
        _ = library.table


def test_its_pages_are_never_both_written_and_run(tmp_path: Path) -> None:
    made = link.link(compiled(IR))
    count = struct.unpack_from("<H", made, 56)[0]
    loads = [struct.unpack_from("<IIQQQQ", made, 64 + 56 * k) for k in range(count)]
    assert {flags for kind, flags, *_ in loads if kind == 1} == {4, 5, 6}
    assert any(kind == 0x6474E551 and flags == 6 for kind, flags, *_ in loads), "the stack is not run"
    for kind, _, offset, address, *_ in loads:
        if kind == 1:
            assert offset % 4096 == address % 4096


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("@x = thread_local global i32 1\ndefine ptr @f() {\n ret ptr @x\n}", "not one that kernels have|thread"),
        ("@o = external global i32\n@p = constant ptr @o\ndefine ptr @f() {\n ret ptr @p\n}", None),
    ],
)
def test_what_kernels_do_not_have_is_refused_or_linked(text: str, why: str | None) -> None:
    data = compiled(f'target triple = "x86_64-unknown-linux-gnu"\n{text}')
    if why is None:
        assert link.link(data)[:4] == b"\x7fELF"
        return
    with pytest.raises(link.CannotLink, match=str(why)):
        link.link(data)


def test_absolute_addresses_are_refused() -> None:
    data = compiled(IR, reloc="static")
    with pytest.raises(link.CannotLink, match=r"relocation|bytes are read"):
        link.link(data)


@pytest.mark.parametrize("data", [b"", b"\x7fELF", b"\x7fELF\x02\x01" + bytes(200), b"text" * 40])
def test_other_files_are_refused_in_a_sentence(data: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.o").write_bytes(data)
    assert link.main(["-o", str(tmp_path / "a.so"), str(tmp_path / "a.o")]) == 1
    assert capsys.readouterr().err.startswith("esker's linker: ")
    assert not (tmp_path / "a.so").exists()


def test_cut_objects_are_refused(tmp_path: Path) -> None:
    whole = compiled(IR)
    for size in range(64, len(whole), 97):
        (tmp_path / "a.o").write_bytes(whole[:size])
        assert link.main(["-o", str(tmp_path / "a.so"), str(tmp_path / "a.o")]) == 1
