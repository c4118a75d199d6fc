"""A proxy in front of a socket that cuts connections, or swallows what they carry, where a test says."""

from __future__ import annotations

import os
import socket
import threading
from contextlib import suppress
from pathlib import Path


class Proxy:
    """Passes bytes on in both directions. After ``cut_at`` was sent nothing comes back and the connection ends; after
    ``hush_at`` it stays and carries nothing more."""

    def __init__(self, folder: Path | None, server: Path | int) -> None:
        """``folder``: where the socket of the proxy lies, None for a port of this machine (``port``); ``server``: the
        socket behind it, or its port."""
        self.cut_at: bytes | None = None
        self.hush_at: bytes | None = None
        self.is_deaf = False
        """Whether every connection, old and new, is open and carries nothing. What is on its way then is lost, so no
        connection that was open comes back to itself."""
        self._deafened: set[socket.socket] = set()
        self.is_open = True
        """Whether new connections are let through."""
        self.cuts = 0
        self._ends: list[socket.socket] = []
        self._server = server
        if folder is None or isinstance(server, int):
            self._listener = socket.create_server(("127.0.0.1", 0))
            self.port = int(self._listener.getsockname()[1])
        else:
            self._listener = socket.socket(socket.AF_UNIX)
            folder.mkdir()
            self._listener.bind(os.fspath(folder / server.name))
            self._listener.listen()
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        while True:
            try:
                near, _ = self._listener.accept()
            except OSError:
                return
            if not self.is_open:
                near.close()
                continue
            try:
                far = self._behind()
            except OSError:  # as where nobody listens
                near.close()
                continue
            self._ends += [near, far]
            if not self.is_open:  # it was cut meanwhile
                self.cut()
            threading.Thread(target=self._out, args=(near, far), daemon=True).start()
            threading.Thread(target=self._back, args=(near, far), daemon=True).start()

    def _behind(self) -> socket.socket:
        """A connection to the server. Raises OSError."""
        if isinstance(self._server, int):
            return socket.create_connection(("127.0.0.1", self._server))
        far = socket.socket(socket.AF_UNIX)
        try:
            far.connect(os.fspath(self._server))
        except OSError:
            far.close()
            raise
        return far

    def _out(self, near: socket.socket, far: socket.socket) -> None:
        with suppress(OSError):
            while data := near.recv(65536):
                if self._is_swallowed(near, data):
                    continue
                cut = self.cut_at is not None and self.cut_at in data
                if cut:
                    self.cuts += 1
                    with suppress(OSError):
                        near.shutdown(socket.SHUT_WR)  # what the server answers goes nowhere
                far.sendall(data)
                if cut:
                    far.shutdown(socket.SHUT_WR)  # the server does what it was sent, and ends
                    while far.recv(65536):
                        pass
                    break
        for end in (near, far):
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
            end.close()

    def _back(self, near: socket.socket, far: socket.socket) -> None:
        with suppress(OSError):
            while data := far.recv(65536):
                if not self._is_swallowed(near, b""):
                    near.sendall(data)

    def _is_swallowed(self, near: socket.socket, data: bytes) -> bool:
        """Returns whether a connection carries nothing any more."""
        if self.is_deaf or (self.hush_at is not None and self.hush_at in data):
            self._deafened.add(near)
        return near in self._deafened

    def cut(self) -> None:
        """Ends every connection, and lets nobody through until ``is_open`` is set again."""
        self.is_open = False
        ends, self._ends = self._ends, []
        for end in ends:
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        """Lets nobody through any more."""
        self._listener.close()
