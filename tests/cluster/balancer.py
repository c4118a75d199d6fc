"""What stands before nodes: connections go to the first of them that answers, as those of a balancer do."""

from __future__ import annotations

import socket
import threading
from collections.abc import Sequence
from contextlib import suppress


class Balancer:
    """Passes the bytes of each connection on to one node, for as long as either side wants."""

    def __init__(self, ports: Sequence[int]) -> None:
        """``ports``: of nodes on this machine, the preferred one first."""
        self._ports = ports
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"http://127.0.0.1:{self._listener.getsockname()[1]}"
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                near, _ = self._listener.accept()
                far = self._reached()
                if far is None:
                    near.close()
                    continue
                threading.Thread(target=_joined, args=(near, far), daemon=True).start()

    def _reached(self) -> socket.socket | None:
        for port in self._ports:
            with suppress(OSError):
                return socket.create_connection(("127.0.0.1", port), timeout=2)
        return None

    def close(self) -> None:
        """Accepts nobody more."""
        self._listener.close()


def _joined(near: socket.socket, far: socket.socket) -> None:
    """Passes bytes both ways until both ends are done, and closes both."""
    with near, far:
        back = threading.Thread(target=_pass, args=(far, near), daemon=True)
        back.start()
        _pass(near, far)
        back.join()


def _pass(source: socket.socket, sink: socket.socket) -> None:
    source.settimeout(None)
    with suppress(OSError):
        while data := source.recv(65536):
            sink.sendall(data)
    for end in (source, sink):
        with suppress(OSError):
            end.shutdown(socket.SHUT_RDWR)
