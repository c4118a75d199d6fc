"""Reads an uploaded ``.esker`` file in a process of its own, with bounds on its memory and time (DESIGN 13).

``python -m esker.upload`` is that process: the file on stdin, the document as JSON on stdout, or a sentence on stderr.
"""

from __future__ import annotations

import asyncio
import resource
import sys
from typing import Final

from esker.contract import Document
from esker.document import archive
from esker.document.ops import Refusal, check_document

MEMORY_BYTES: Final = 1 << 30
CPU_SECONDS: Final = 10
WALL_SECONDS: Final = 30.0
AT_ONCE: Final = 2
BAD_FILE: Final = 3
"""Exit status for a file that is not good; anything else but 0 means that the reader itself was stopped."""


async def read_archive(content: bytes, slots: asyncio.Semaphore) -> Document:
    """The document in an ``.esker`` file. Raises archive.ArchiveError with a sentence for a person.

    ``slots``: at most ``AT_ONCE`` of these processes run at a time.
    """
    async with slots:
        process = await asyncio.create_subprocess_exec(
            sys.executable,
            "-m",
            "esker.upload",
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE,
        )
        try:
            out, err = await asyncio.wait_for(process.communicate(content), WALL_SECONDS)
        except TimeoutError:
            raise archive.ArchiveError("Reading this file took too long.") from None
        finally:
            if process.returncode is None:
                process.kill()
                await process.wait()
    if process.returncode == BAD_FILE:
        raise archive.ArchiveError(err.decode("utf-8", "replace").strip())
    if process.returncode != 0:
        raise archive.ArchiveError("Reading this file took too much memory or time.")
    return Document.model_validate_json(out)


def main() -> int:
    """The process that reads."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    resource.setrlimit(resource.RLIMIT_CPU, (CPU_SECONDS, CPU_SECONDS))
    try:
        document = archive.loads(sys.stdin.buffer.read())
        check_document(document)
    except (archive.ArchiveError, Refusal) as error:
        sys.stderr.write(str(error))
        return BAD_FILE
    sys.stdout.write(document.model_dump_json())
    return 0


if __name__ == "__main__":
    sys.exit(main())
