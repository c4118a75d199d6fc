"""A filter of system calls (seccomp): no sockets, and no other process within reach.

Landlock knows TCP from Linux 6.7 on and UDP not at all, and a container may make no namespace; this filter needs no
right and holds in both. It is a program of the kernel's classic packet filter over number and arguments of each call.
"""

from __future__ import annotations

import ctypes
import os
import platform
import struct
from typing import Final

_PR_SET_NO_NEW_PRIVS, _PR_SET_SECCOMP, _FILTER_MODE = 38, 22, 2
_LOAD, _EQUAL, _AT_LEAST, _RETURN = 0x20, 0x15, 0x35, 0x06
_ALLOW: Final = 0x7FFF0000
_REFUSE: Final = 0x00050000 | 1
"""The call returns EPERM."""
_KILL: Final = 0x80000000
_NUMBER, _ARCHITECTURE, _FIRST = 0, 4, 16
"""Offsets in ``struct seccomp_data``; the low half of the first argument stands first on these processors."""
_FOREIGN: Final = 0x40000000
"""Numbers from here on are those of the x32 interface, by which a call could go round the filter."""
_SYSTEMS: Final[dict[str, tuple[int, tuple[int, ...], dict[str, int]]]] = {
    "x86_64": (0xC000003E, (41, 101, 200, 129, 297, 310, 311), {"kill": 62, "tgkill": 234, "prlimit64": 302}),
    "aarch64": (0xC00000B7, (198, 117, 130, 138, 240, 270, 271), {"kill": 129, "tgkill": 131, "prlimit64": 261}),
}
"""By processor: architecture as the kernel tells it; the numbers of socket, ptrace, tkill, rt_sigqueueinfo,
rt_tgsigqueueinfo, process_vm_readv and process_vm_writev, which are refused; and of calls that a process may do to
itself alone."""
_NEVER: Final = (424, 425, 434, 438)
"""Numbers of calls that are the same on all processors: pidfd_send_signal, io_uring_setup (which makes sockets
without ``socket``), pidfd_open and pidfd_getfd."""


def known() -> bool:
    """Returns whether the numbers of this processor's system calls are known here."""
    return platform.machine() in _SYSTEMS and struct.calcsize("P") == 8


def restrict(libc: ctypes.CDLL) -> bool:
    """From now on this thread, and whatever it starts, opens no socket and neither signals nor reads another process.

    Call it before the first thread is started. Returns whether it holds. Raises OSError where the kernel refuses it.
    """
    if not known():
        return False
    code = b"".join(_program(os.getpid()))
    text = ctypes.create_string_buffer(code, len(code))
    program = struct.pack("HxxxxxxP", len(code) // 8, ctypes.addressof(text))
    one, mode, zero = ctypes.c_ulong(1), ctypes.c_ulong(_FILTER_MODE), ctypes.c_ulong(0)
    if libc.prctl(_PR_SET_NO_NEW_PRIVS, one, zero, zero, zero) or libc.prctl(
        _PR_SET_SECCOMP, mode, program, zero, zero
    ):
        raise OSError(ctypes.get_errno(), "seccomp")
    return True


def _program(own: int) -> list[bytes]:
    """The filter's instructions. ``own``: the process id that may still be signalled."""
    architecture, refused, to_itself = _SYSTEMS[platform.machine()]
    made = [
        _step(_LOAD, _ARCHITECTURE), _step(_EQUAL, architecture, 1, 0), _step(_RETURN, _KILL),
        _step(_LOAD, _NUMBER), _step(_AT_LEAST, _FOREIGN, 0, 1), _step(_RETURN, _REFUSE),
    ]  # fmt: skip
    for number in (*refused, *_NEVER):
        made += [_step(_EQUAL, number, 0, 1), _step(_RETURN, _REFUSE)]
    for name, number in to_itself.items():
        unnamed = 0 if name == "prlimit64" else own  # there 0 stands for the process itself, elsewhere for its group
        made += [
            _step(_EQUAL, number, 0, 5), _step(_LOAD, _FIRST), _step(_EQUAL, own, 1, 0),
            _step(_EQUAL, unnamed, 0, 1), _step(_RETURN, _ALLOW), _step(_RETURN, _REFUSE),
        ]  # fmt: skip
    return [*made, _step(_RETURN, _ALLOW)]


def _step(code: int, k: int, if_so: int = 0, if_not: int = 0) -> bytes:
    """One instruction: what it does, its number, and how many instructions it jumps over."""
    return struct.pack("HBBI", code, if_so, if_not, k)
