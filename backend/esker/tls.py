"""HTTPS for a classroom: a certificate authority of this computer's own and a certificate for its LAN address.

WebGPU and coalesced pointer events exist only in secure contexts, so ``--lan`` must speak HTTPS. The authority is kept
in the data folder and reused: who has trusted it once has no warning at later starts or after the address changed.
"""

from __future__ import annotations

import ipaddress
import os
import socket
import ssl
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Final

import trustme
from cryptography import x509

FOLDER: Final = "tls"
CA_FILE: Final = "esker-ca.pem"
_CA_KEY: Final = "esker-ca.key"
_RENEW_BEFORE: Final = timedelta(days=30)
_SERVER_DAYS: Final = 397
"""Browsers refuse server certificates that are valid for longer."""


def lan_address() -> str:
    """The address by which other devices on the network reach this one; 127.0.0.1 when there is no network."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))  # a documentation address: a datagram socket sends nothing on connect
            return str(probe.getsockname()[0])
        except OSError:
            return "127.0.0.1"


def authority(data: Path) -> trustme.CA:
    """This computer's authority, made on first use. The key is readable by its owner only."""
    folder = data / FOLDER
    certificate, key = folder / CA_FILE, folder / _CA_KEY
    if certificate.exists() and key.exists():
        found = x509.load_pem_x509_certificate(certificate.read_bytes())
        if found.not_valid_after_utc > datetime.now(UTC) + _RENEW_BEFORE:
            return trustme.CA.from_pem(certificate.read_bytes(), key.read_bytes())
    folder.mkdir(parents=True, exist_ok=True)
    made = trustme.CA(organization_name="Esker on this computer")
    _write_private(key, made.private_key_pem.bytes())
    certificate.write_bytes(made.cert_pem.bytes())
    return made


def names(address: str) -> list[str]:
    """What the certificate is good for: the LAN address, this host's names, localhost."""
    found = [address, "localhost", "127.0.0.1", "::1"]
    with suppress(OSError):
        host = socket.gethostname()
        for name in (host, f"{host}.local"):
            with suppress(ValueError, UnicodeError):
                name.encode("idna")
                found.append(name)
    unique: list[str] = []
    for name in found:
        with suppress(ValueError):
            name = str(ipaddress.ip_address(name))
        if name and name not in unique:
            unique.append(name)
    return unique


def server_context(data: Path, address: str) -> ssl.SSLContext:
    """A TLS context with a fresh certificate for ``address``, signed by the authority in the data folder."""
    until = datetime.now(UTC) + timedelta(days=_SERVER_DAYS)
    certificate = authority(data).issue_cert(*names(address), not_after=until)
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    certificate.configure_cert(context)
    return context


def _write_private(path: Path, content: bytes) -> None:
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
    with os.fdopen(descriptor, "wb") as file:
        file.write(content)
