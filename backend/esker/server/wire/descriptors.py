"""Says once when the process has no descriptor left, and once when it has again (SPEC A403).

Sockets have shares that leave descriptors for the server's own files (``server/wire/http.py``). Where something else
uses them up all the same, whoever has a connection goes on; newcomers are closed at once: libuv keeps a spare one
for that.
"""

from __future__ import annotations

import asyncio
import errno
import logging
import os
from typing import Final

log = logging.getLogger("esker.server")

LOOK_SECONDS: Final = 1.0
USED_UP: Final = "all file descriptors are in use: nobody new can come in until some are closed (raise 'ulimit -n')"
AGAIN: Final = "there are file descriptors again"


def used_up() -> bool:
    """Returns whether no file can be opened, of this process or of the whole system."""
    try:
        os.close(os.open(os.devnull, os.O_RDONLY))
    except OSError as error:
        return error.errno in (errno.EMFILE, errno.ENFILE)
    return False


async def watch() -> None:
    """Looks for as long as the server runs; cancel it to end."""
    said = False
    while True:
        if used_up() != said:
            said = not said
            log.log(logging.ERROR if said else logging.WARNING, USED_UP if said else AGAIN)
        await asyncio.sleep(LOOK_SECONDS)
