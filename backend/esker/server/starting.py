"""A server that starts: it listens at once, and says to the page and the terminal how far it is.

Importing the server takes a second and compiling its kernels may take many more. Meanwhile a thread with an event loop
of its own answers on the same socket. When the server is put together that thread leaves the socket to it; connections
that come in between wait in the system's queue.
"""

from __future__ import annotations

import asyncio
import base64
import hashlib
import json
import socket
import ssl
import threading
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from typing import Final, TextIO

from esker.process import interrupt, system
from esker.server.settings import Settings
from esker.version import VERSION

SEND_BUFFER: Final = 256 * 1024
"""The kernel would queue megabytes for a client that does not read, and show it old tiles when it does."""
HEAD_BYTES: Final = 16 * 1024
HEAD_SECONDS: Final = 5.0
AT_ONCE: Final = 200
"""Requests that are read at the same time. Further ones are hung up on, and the page asks again."""
TICK: Final = 0.2
"""Seconds between pictures of the moving line."""
DIALS: Final = "|/-\\"
STARTING: Final = "Esker is starting"
_SCRIPT: Final = """
const text = document.getElementById("said"), bar = document.getElementById("bar");
async function look() {
  try {
    const answer = await fetch("/healthz", {cache: "no-store"});
    const state = await answer.json();
    if (answer.ok) { location.reload(); return; }
    if (state.starting) {
      text.textContent = state.starting.said;
      if (state.starting.of) { bar.max = state.starting.of; bar.value = state.starting.done; }
      else bar.removeAttribute("value");
    }
  } catch { /* the server changes hands: ask again */ }
  setTimeout(look, 500);
}
look();
"""
_PAGE: Final = f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>{STARTING}</title>
<noscript><meta http-equiv="refresh" content="3"></noscript>
<style>
:root {{ color-scheme: light dark; }}
body {{ margin: 0; min-height: 100vh; display: grid; place-items: center; font: 16px/1.5 system-ui, sans-serif; }}
main {{ width: min(32rem, 86vw); }}
h1 {{ font-size: 1.4rem; font-weight: 600; margin: 0 0 .5rem; }}
progress {{ width: 100%; accent-color: #3f7d58; }}
p {{ margin: .5rem 0 0; }}
</style></head>
<body><main><h1>{STARTING}</h1>
<progress id="bar" aria-label="How far it is"></progress>
<p id="said" role="status">SAID</p>
<p>This page goes on by itself as soon as the terrain can be drawn.</p>
</main><script>{_SCRIPT}</script></body></html>
"""
_HASH: Final = base64.b64encode(hashlib.sha256(_SCRIPT.encode()).digest()).decode()
_POLICY: Final = (
    f"default-src 'none'; script-src 'sha256-{_HASH}'; style-src 'unsafe-inline'; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)


class CannotServe(Exception):
    """The server cannot start; the message says why in one sentence."""


class Interrupted(BaseException):
    """Somebody asked the server to stop before it was ready."""


@dataclass(frozen=True)
class Progress:
    """How far the start is: a sentence, and ``done`` of ``of`` steps, 0 where they cannot be counted."""

    said: str
    done: int = 0
    of: int = 0


def listen(host: str, port: int) -> socket.socket:
    """A socket that is bound and listens. Raises CannotServe."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listener = socket.socket(family, socket.SOCK_STREAM)
    system.take_port(listener)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)  # accepted sockets inherit it
    try:
        listener.bind((host, port))
    except OSError as error:
        listener.close()
        hint = "Another program uses it; choose another one with --port." if system.port_is_taken(error) else str(error)
        raise CannotServe(f"Cannot listen on {host}, port {port}. {hint}") from error
    return listener


class FrontDoor:
    """Where a server listens: its socket, its address for people, and its certificate when it has one."""

    def __init__(self, settings: Settings) -> None:
        """Takes the port. Raises CannotServe, OSError."""
        host = "0.0.0.0" if settings.lan and settings.host == "127.0.0.1" else settings.host
        self.address = "127.0.0.1" if host in ("0.0.0.0", "::") else host
        self.context: ssl.SSLContext | None = None
        self.listener = listen(host, settings.port)
        if settings.lan:
            try:
                from esker.server.wire.tls import lan_address, server_context

                self.address = lan_address()
                self.context = server_context(settings.data, self.address)
            except BaseException:
                self.listener.close()
                raise


class WaitingRoom:
    """Answers on a socket until the server takes it over. ``with WaitingRoom(...) as room: ... room.leave()``."""

    def __init__(self, listener: socket.socket, context: ssl.SSLContext | None, out: TextIO | None) -> None:
        """``out``: where the line of the progress is written; None writes none."""
        self._listener, self._context = listener, context
        self._progress = Progress("Opening the database and the solver")
        self._line = _Line(out) if out is not None else None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._ready, self._left = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, name="waiting room", daemon=True)
        self._open: set[asyncio.Task[None]] = set()

    def __enter__(self) -> WaitingRoom:
        self._thread.start()
        self._ready.wait()
        return self

    def __exit__(self, *_: object) -> None:
        self.leave()

    def tell(self, said: str, done: int = 0, of: int = 0) -> None:
        """Takes the progress that is shown from now on."""
        self._progress = Progress(said, done, of)
        if self._line is not None:
            self._line.show(self._progress)

    def leave(self) -> None:
        """Answers what was asked and leaves the socket, which stays open."""
        if self._left.is_set():
            return
        self._left.set()
        if self._loop is not None:
            with suppress(RuntimeError):
                self._loop.call_soon_threadsafe(lambda: None)
        self._thread.join(timeout=10)
        if self._line is not None:
            self._line.clear()

    # --- in the thread ------------------------------------------------------------------------------------------

    def _run(self) -> None:
        try:
            asyncio.run(self._serve())
        finally:
            self._ready.set()

    async def _serve(self) -> None:
        self._loop = asyncio.get_running_loop()
        # The server gets the socket itself: what asyncio closes in the end is a second handle of it.
        server = await asyncio.start_server(
            self._answer, sock=self._listener.dup(), ssl=self._context, limit=HEAD_BYTES
        )
        self._ready.set()
        while not self._left.is_set():
            await asyncio.sleep(TICK)
            if self._line is not None:
                self._line.tick()
        server.close()
        if self._open:
            await asyncio.wait(self._open, timeout=1.0)

    async def _answer(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        self._open.add(task)
        try:
            if len(self._open) <= AT_ONCE:
                with suppress(asyncio.IncompleteReadError, asyncio.LimitOverrunError, TimeoutError):
                    head = await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), HEAD_SECONDS)
                    writer.write(answer(head, self._progress))
                    await asyncio.wait_for(writer.drain(), HEAD_SECONDS)
        except OSError:
            pass
        finally:
            self._open.discard(task)
            writer.close()


def answer(head: bytes, progress: Progress) -> bytes:
    """Returns what a request is answered while the server starts: 503 with a page for people and JSON for programs."""
    lines = head.decode("latin-1").split("\r\n")
    method, path, *_ = [*lines[0].split(" "), "", ""]
    accepts = next((line.partition(":")[2] for line in lines[1:] if line.lower().startswith("accept:")), "")
    people = "text/html" in accepts and not path.startswith(("/api/", "/healthz", "/ws"))
    if people:
        body, kind, policy = _PAGE.replace("SAID", f"{progress.said} ..."), "text/html; charset=utf-8", _POLICY
    else:
        state = {"ok": False, "version": VERSION, "starting": asdict(progress)}
        refusal = {"code": "starting", "message": f"{STARTING}: {progress.said}."}
        body, kind = json.dumps(state if path.startswith("/healthz") else refusal), "application/json"
        policy = "default-src 'none'"
    content = body.encode()
    headers = {
        "Content-Type": kind, "Content-Length": str(len(content)), "Retry-After": "1", "Cache-Control": "no-store",
        "Content-Security-Policy": policy, "X-Content-Type-Options": "nosniff", "Referrer-Policy": "no-referrer",
        "Connection": "close",
    }  # fmt: skip
    written = "".join(f"{name}: {value}\r\n" for name, value in headers.items())
    return f"HTTP/1.1 503 Service Unavailable\r\n{written}\r\n".encode() + (b"" if method == "HEAD" else content)


class _Line:
    """The progress for who started the server: one line that moves on a terminal, elsewhere a line for each step."""

    def __init__(self, out: TextIO) -> None:
        self._out, self._moves = out, out.isatty()
        self._progress, self._turn = Progress(""), 0
        self._lock = threading.Lock()

    def show(self, progress: Progress) -> None:
        with self._lock:
            news, self._progress = progress.said != self._progress.said, progress
            if not self._moves and news:
                self._write(f"  {progress.said}\n")

    def tick(self) -> None:
        """Draws another picture of the line."""
        with self._lock:
            if self._moves and self._progress.said:
                self._turn += 1
                share = f" ({self._progress.done} of {self._progress.of})" if self._progress.of else ""
                self._write(f"\r\x1b[2K  {DIALS[self._turn % len(DIALS)]} {self._progress.said}{share}")

    def clear(self) -> None:
        with self._lock:
            if self._moves and self._turn:
                self._write("\r\x1b[2K")
            self._progress = replace(self._progress, said="")

    def _write(self, text: str) -> None:
        with suppress(OSError, ValueError):
            self._out.write(text)
            self._out.flush()


class Stopping:
    """A handler of signals that stop a program, before the server handles them itself.

    ``system.on_stop(stopping)`` installs it. It raises Interrupted wherever the main thread is, and remembers that it
    did: a library may turn that exception into one of its own (pydantic does, while a model is made), or drop it.
    """

    def __init__(self) -> None:
        self.asked = False

    def __call__(self, *_: object) -> None:
        """Handles the signal. A second Ctrl-C does not wait for what the first one tidies up."""
        self.asked = True
        interrupt.ends()
        raise Interrupted

    def check(self) -> None:
        """Raises Interrupted when that was asked for and the exception came to nothing."""
        if self.asked:
            raise Interrupted
