"""An S3-compatible server for tests and benchmarks: moto's, in this process, whose memory outlives its pauses."""

from __future__ import annotations

import os
import socket
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

BUCKET = "terrains"
KEYS = {"AWS_ACCESS_KEY_ID": "AKIDTESTS", "AWS_SECRET_ACCESS_KEY": "tests-secret-key", "AWS_REGION": "us-east-1"}


class ObjectServer:
    """One server with one bucket, until ``close``."""

    def __init__(self) -> None:
        with socket.socket() as taken:
            taken.bind(("127.0.0.1", 0))
            self.port = int(taken.getsockname()[1])
        self._server: Any = None
        self.start()
        with self.environment():
            self._make_bucket()

    @property
    def url(self) -> str:
        """The bucket, as a setting names it."""
        return f"s3://{BUCKET}/esker"

    @contextmanager
    def environment(self) -> Iterator[None]:
        """The variables by which programs find it."""
        before = {name: os.environ.get(name) for name in (*KEYS, "AWS_ENDPOINT_URL")}
        os.environ.update({**KEYS, "AWS_ENDPOINT_URL": f"http://127.0.0.1:{self.port}"})
        try:
            yield
        finally:
            for name, value in before.items():
                if value is None:
                    os.environ.pop(name, None)
                else:
                    os.environ[name] = value

    def start(self) -> None:
        """Lets it answer again."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            from moto.server import ThreadedMotoServer

            self._server = ThreadedMotoServer(ip_address="127.0.0.1", port=self.port, verbose=False)
            self._server.start()

    def stop(self) -> None:
        """Lets it answer nobody."""
        self._server.stop()

    def _make_bucket(self) -> None:
        import urllib.request

        request = urllib.request.Request(f"http://127.0.0.1:{self.port}/{BUCKET}", method="PUT")
        urllib.request.urlopen(request, timeout=20).close()

    def close(self) -> None:
        """Ends it."""
        self._server.stop()
