"""HTTPS for a classroom: a certificate authority of this computer's own and a certificate for its LAN address.

WebGPU and coalesced pointer events exist only in secure contexts, so ``--lan`` must speak HTTPS. The authority is kept
in the data folder and reused: who has trusted it once has no warning at later starts. It can vouch for nothing but
private addresses, this host and names that only mean something on a local network (critical name constraints), signs
no other authority, and ends after two years: who steals its key can read no bank's traffic.
"""

from __future__ import annotations

import logging
import os
import socket
import ssl
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from ipaddress import IPv4Network, IPv6Network, ip_address, ip_network
from pathlib import Path
from typing import Final

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

log = logging.getLogger("esker.server.wire.tls")

FOLDER: Final = "tls"
CA_FILE: Final = "esker-ca.pem"
_CA_KEY: Final = "esker-ca.key"
_SERVER: Final = "esker-server.pem"
_NAME: Final = "Esker on this computer"
_RENEW_BEFORE: Final = timedelta(days=30)
_CA_LIFE: Final = timedelta(days=730)
_SERVER_LIFE: Final = timedelta(days=397)
"""Browsers refuse server certificates that are valid for longer."""
_CLOCKS_DIFFER: Final = timedelta(days=1)
PRIVATE: Final = (
    "10.0.0.0/8", "172.16.0.0/12", "192.168.0.0/16", "169.254.0.0/16", "127.0.0.0/8", "::1/128", "fc00::/7", "fe80::/10"
)  # fmt: skip
LOCAL_NAMES: Final = ("localhost", "local", "home.arpa", "internal")
"""Name spaces that no public name is in. A bare host name is not among them: a network may name this computer "com"."""


@dataclass(frozen=True)
class Authority:
    """A certificate that signs, and its key."""

    certificate: x509.Certificate
    key: ec.EllipticCurvePrivateKey


def lan_address() -> str:
    """Returns the address by which other devices on the network reach this one; 127.0.0.1 when there is no network."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))  # a documentation address: a datagram socket sends nothing on connect
            return str(probe.getsockname()[0])
        except OSError:
            return "127.0.0.1"


def authority(data: Path, address: str = "127.0.0.1") -> Authority:
    """This computer's authority, made on first use. Its key is readable by its owner only.

    One that an earlier version made, that soon ends, or that may not vouch for ``address`` is replaced.
    """
    folder = data / FOLDER
    certificate, key = folder / CA_FILE, folder / _CA_KEY
    if certificate.exists() and key.exists():
        with suppress(ValueError, TypeError):
            kept = _read(certificate.read_bytes(), key.read_bytes())
            reason = _against(kept.certificate, address)
            if not reason:
                os.chmod(key, 0o600)
                return kept
            log.warning("This computer's certificate authority was made anew: %s Trust the new one; remove the old "
                        "one, “%s”, from every device that trusts it.", reason, _subject(kept.certificate))  # fmt: skip
    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    os.chmod(folder, 0o700)
    made = _make(address)
    _write_private(key, _pem(made.key))
    certificate.write_bytes(made.certificate.public_bytes(serialization.Encoding.PEM))
    return made


def names(address: str) -> list[str]:
    """Returns what the server's certificate is good for: the LAN address, this host's local names, localhost."""
    found = [address, "localhost", "127.0.0.1", "::1"]
    with suppress(OSError, UnicodeError):
        host = socket.gethostname().rstrip(".").lower()
        host.encode("idna")
        found.append(host if _local(host) else f"{host.partition('.')[0]}.local")
    unique: list[str] = []
    for name in found:
        with suppress(ValueError):
            name = str(ip_address(name))
        if name and name != ".local" and name not in unique:
            unique.append(name)
    return unique


def server_context(data: Path, address: str) -> ssl.SSLContext:
    """Returns a TLS context with a fresh certificate for ``address``, signed by the authority in the data folder."""
    signer = authority(data, address)
    key = ec.generate_private_key(ec.SECP256R1())
    certificate = sign(signer, names(address), key)
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    path = data / FOLDER / _SERVER  # the standard library reads keys from files only
    try:
        _write_private(path, _pem(key) + certificate.public_bytes(serialization.Encoding.PEM))
        context.load_cert_chain(path)
    finally:
        path.unlink(missing_ok=True)
    return context


def sign(signer: Authority, found: list[str], key: ec.EllipticCurvePrivateKey) -> x509.Certificate:
    """Returns a server's certificate for these names and addresses."""
    now = datetime.now(UTC)
    alternatives = x509.SubjectAlternativeName([_general(name) for name in found])
    usage = x509.ExtendedKeyUsage([ExtendedKeyUsageOID.SERVER_AUTH])
    builder = (
        x509.CertificateBuilder()
        .subject_name(_named("Esker server"))
        .issuer_name(signer.certificate.subject)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(max(now - _CLOCKS_DIFFER, signer.certificate.not_valid_before_utc))
        .not_valid_after(min(now + _SERVER_LIFE - _CLOCKS_DIFFER, signer.certificate.not_valid_after_utc))
        .add_extension(alternatives, critical=False)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(usage, critical=False)
        .add_extension(_usage(signing=False), critical=True)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
        .add_extension(_issuer_key(signer), critical=False)
    )
    return builder.sign(signer.key, hashes.SHA256())


def _make(address: str) -> Authority:
    key, now = ec.generate_private_key(ec.SECP256R1()), datetime.now(UTC)
    name = _named(_NAME)
    permitted: list[x509.GeneralName] = [x509.IPAddress(net) for net in _networks(address)]
    permitted += [x509.DNSName(space) for space in LOCAL_NAMES]
    builder = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - _CLOCKS_DIFFER)
        .not_valid_after(now + _CA_LIFE - 2 * _CLOCKS_DIFFER)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(x509.NameConstraints(permitted_subtrees=permitted, excluded_subtrees=None), critical=True)
        .add_extension(_usage(signing=True), critical=True)
        .add_extension(x509.ExtendedKeyUsage([ExtendedKeyUsageOID.SERVER_AUTH]), critical=False)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
    )
    return Authority(builder.sign(key, hashes.SHA256()), key)


def _networks(address: str) -> list[IPv4Network | IPv6Network]:
    """Returns the private ranges, and this host's own address where it is in none of them."""
    ranges = [ip_network(text) for text in PRIVATE]
    own = ip_network(address)
    return ranges if any(own.version == net.version and own[0] in net for net in ranges) else [*ranges, own]


def _against(certificate: x509.Certificate, address: str) -> str:
    """Returns in a sentence why an authority is not to be used any more; an empty one when it may be."""
    if certificate.not_valid_after_utc <= datetime.now(UTC) + _RENEW_BEFORE:
        return "its two years are nearly over."
    try:
        limits = certificate.extensions.get_extension_for_class(x509.NameConstraints)
        basic = certificate.extensions.get_extension_for_class(x509.BasicConstraints).value
    except x509.ExtensionNotFound:
        return "the one of an earlier version could vouch for any site in the world."
    lasts = certificate.not_valid_after_utc - certificate.not_valid_before_utc
    nets = [name.value for name in limits.value.permitted_subtrees or () if isinstance(name, x509.IPAddress)]
    if not limits.critical or basic.path_length != 0 or lasts > _CA_LIFE or not nets:
        return "the one of an earlier version could vouch for more than this computer."
    own = ip_address(address)
    if not any(isinstance(net, IPv4Network | IPv6Network) and own in net for net in nets):
        return f"the old one may not vouch for this computer's address, {address}."
    return ""


def _read(certificate: bytes, key: bytes) -> Authority:
    """Raises ValueError, TypeError: what is no certificate, or no key of this kind."""
    found = serialization.load_pem_private_key(key, None)
    parsed = x509.load_pem_x509_certificate(certificate)
    if not isinstance(found, ec.EllipticCurvePrivateKey) or parsed.public_key() != found.public_key():
        raise ValueError("the key is not that of the certificate")
    return Authority(parsed, found)


def _local(host: str) -> bool:
    return any(host == space or host.endswith(f".{space}") for space in LOCAL_NAMES)


def _general(name: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ip_address(name))
    except ValueError:
        return x509.DNSName(name.encode("idna").decode("ascii"))


def _named(name: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.ORGANIZATION_NAME, name)])


def _subject(certificate: x509.Certificate) -> str:
    found = certificate.subject.get_attributes_for_oid(NameOID.ORGANIZATION_NAME)
    return str(found[0].value) if found else _NAME


def _issuer_key(signer: Authority) -> x509.AuthorityKeyIdentifier:
    identifier = signer.certificate.extensions.get_extension_for_class(x509.SubjectKeyIdentifier).value
    return x509.AuthorityKeyIdentifier.from_issuer_subject_key_identifier(identifier)


def _usage(*, signing: bool) -> x509.KeyUsage:
    return x509.KeyUsage(
        digital_signature=not signing,
        key_cert_sign=signing,
        crl_sign=signing,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        encipher_only=False,
        decipher_only=False,
    )


def _pem(key: ec.EllipticCurvePrivateKey) -> bytes:
    kind = serialization.PrivateFormat.PKCS8
    return key.private_bytes(serialization.Encoding.PEM, kind, serialization.NoEncryption())


def _write_private(path: Path, content: bytes) -> None:
    path.unlink(missing_ok=True)  # an older file would keep its mode
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(descriptor, "wb") as file:
        file.write(content)
