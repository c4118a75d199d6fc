"""The authority of ``--lan`` can vouch for nothing but what is near (SPEC P284, P285)."""

from __future__ import annotations

import logging
import os
import socket
import ssl
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID
from cryptography.x509.verification import PolicyBuilder, Store, VerificationError

from esker.server.wire import tls
from esker.server.wire.tls import Authority, authority, names, server_context, sign

ADDRESS = "192.168.1.20"


def _kept(data: Path) -> Authority:
    """The authority as its files have it: whoever steals them has this."""
    key = serialization.load_pem_private_key((data / "tls" / "esker-ca.key").read_bytes(), None)
    assert isinstance(key, ec.EllipticCurvePrivateKey)
    return Authority(x509.load_pem_x509_certificate((data / "tls" / "esker-ca.pem").read_bytes()), key)


def _subject(name: str) -> x509.DNSName | x509.IPAddress:
    general = tls._general(name)
    assert isinstance(general, x509.DNSName | x509.IPAddress)
    return general


def _trusted(signer: Authority, name: str, leaf: x509.Certificate) -> bool:
    """Whether a device that trusts the authority takes this certificate for this name, by cryptography's verifier."""
    verifier = PolicyBuilder().store(Store([signer.certificate])).build_server_verifier(_subject(name))
    try:
        verifier.verify(leaf, [])
    except VerificationError:
        return False
    return True


def _shakes_hands(signer: Authority, name: str, folder: Path) -> str:
    """What OpenSSL says to a server that shows a certificate for ``name``; empty when it is trusted."""
    key = ec.generate_private_key(ec.SECP256R1())
    path = folder / "leaf.pem"
    path.write_bytes(tls._pem(key) + sign(signer, [name], key).public_bytes(serialization.Encoding.PEM))
    server = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    server.load_cert_chain(path)
    client = ssl.create_default_context(cadata=signer.certificate.public_bytes(serialization.Encoding.PEM).decode())
    to_server, to_client = ssl.MemoryBIO(), ssl.MemoryBIO()
    here = client.wrap_bio(to_client, to_server, server_hostname=name)
    there = server.wrap_bio(to_server, to_client, server_side=True)
    for _ in range(4):
        for side in (here, there):
            try:
                side.do_handshake()
            except ssl.SSLWantReadError:
                continue
            except ssl.SSLCertVerificationError as error:
                return error.verify_message
    return ""


NEAR = ("192.168.1.20", "10.7.7.7", "fd00::7", "127.0.0.1", "localhost", "classroom.local", "pi.home.arpa")
FAR = ("example.org", "com", "mail.example.com", "8.8.8.8", "2001:4860:4860::8888", "local.example.org")


@pytest.mark.parametrize("name", NEAR + FAR)
def test_the_authority_vouches_for_what_is_near_only(tmp_path: Path, name: str) -> None:
    """SPEC P284: two verifiers refuse a leaf for any other site, signed with the very key."""
    authority(tmp_path, ADDRESS)
    signer = _kept(tmp_path)
    leaf = sign(signer, [name], ec.generate_private_key(ec.SECP256R1()))
    assert _trusted(signer, name, leaf) == (name in NEAR)
    said = _shakes_hands(signer, name, tmp_path)
    assert said == ("" if name in NEAR else "permitted subtree violation")


def test_it_signs_no_other_authority(tmp_path: Path) -> None:
    """SPEC P284."""
    authority(tmp_path, ADDRESS)
    signer, now = _kept(tmp_path), datetime.now(UTC)
    extensions = signer.certificate.extensions
    basic = extensions.get_extension_for_class(x509.BasicConstraints)
    assert (basic.critical, basic.value.ca, basic.value.path_length) == (True, True, 0)
    assert extensions.get_extension_for_class(x509.NameConstraints).critical
    assert signer.certificate.not_valid_after_utc <= now + timedelta(days=730)
    middle = ec.generate_private_key(ec.SECP256R1())
    under = (
        x509.CertificateBuilder()
        .subject_name(x509.Name([x509.NameAttribute(NameOID.ORGANIZATION_NAME, "Under it")]))
        .issuer_name(signer.certificate.subject)
        .public_key(middle.public_key())
        .serial_number(7)
        .not_valid_before(now - timedelta(hours=1))
        .not_valid_after(now + timedelta(days=30))
        .add_extension(x509.BasicConstraints(ca=True, path_length=None), critical=True)
        .add_extension(tls._usage(signing=True), critical=True)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(middle.public_key()), critical=False)
        .add_extension(tls._issuer_key(signer), critical=False)
        .sign(signer.key, hashes.SHA256())
    )
    leaf = sign(Authority(under, middle), [ADDRESS], ec.generate_private_key(ec.SECP256R1()))
    verifier = PolicyBuilder().store(Store([signer.certificate])).build_server_verifier(_subject(ADDRESS))
    with pytest.raises(VerificationError):
        verifier.verify(leaf, [under])


def test_its_own_server_is_trusted_by_every_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """SPEC P285: whatever the network calls this computer."""
    for host in ("pi", "pi.local", "laptop.school.example.org", "com", "box.home.arpa"):
        monkeypatch.setattr(socket, "gethostname", lambda host=host: host)
        signer = authority(tmp_path, ADDRESS)
        found = names(ADDRESS)
        assert found[0] == ADDRESS
        assert {"localhost", "127.0.0.1"} <= set(found)
        assert len(found) == len(set(found))
        leaf = sign(signer, found, ec.generate_private_key(ec.SECP256R1()))
        for name in found:
            assert _trusted(signer, name, leaf), (host, name)


def test_an_authority_of_before_is_replaced_with_a_sentence(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """SPEC P285: the one of version 0.1 had no constraints and lasted until the year 3000."""
    key, now = ec.generate_private_key(ec.SECP256R1()), datetime.now(UTC)
    name = x509.Name([x509.NameAttribute(NameOID.ORGANIZATION_NAME, "Esker on this computer")])
    old = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(7)
        .not_valid_before(now - timedelta(days=1))
        .not_valid_after(datetime(3000, 1, 1, tzinfo=UTC))
        .add_extension(x509.BasicConstraints(ca=True, path_length=9), critical=True)
        .sign(key, hashes.SHA256())
    )
    folder = tmp_path / "tls"
    folder.mkdir()
    (folder / "esker-ca.pem").write_bytes(old.public_bytes(serialization.Encoding.PEM))
    (folder / "esker-ca.key").write_bytes(tls._pem(key))
    with caplog.at_level(logging.WARNING, "esker.server.wire.tls"):
        made = authority(tmp_path, ADDRESS)
    assert "any site in the world" in caplog.text
    assert "remove the old one, “Esker on this computer”" in caplog.text
    assert made.certificate != old
    caplog.clear()
    with caplog.at_level(logging.WARNING, "esker.server.wire.tls"):
        assert authority(tmp_path, ADDRESS).certificate == made.certificate, "who has trusted it trusts it on"
        assert authority(tmp_path, "10.1.1.1").certificate == made.certificate, (
            "another private address changes nothing"
        )
    assert caplog.text == ""


def test_a_public_address_is_this_host_alone(tmp_path: Path) -> None:
    """SPEC P284: in a network of public addresses this one is added, and a new one when it changes."""
    signer = authority(tmp_path, "203.0.113.7")
    key = ec.generate_private_key(ec.SECP256R1())
    assert _trusted(signer, "203.0.113.7", sign(signer, ["203.0.113.7"], key))
    assert not _trusted(signer, "203.0.113.8", sign(signer, ["203.0.113.8"], key))
    assert authority(tmp_path, "203.0.113.8").certificate != signer.certificate


def test_nobody_else_reads_the_keys(tmp_path: Path) -> None:
    """SPEC P285."""
    before = os.umask(0)
    try:
        context = server_context(tmp_path, ADDRESS)
    finally:
        os.umask(before)
    assert context.minimum_version.name == "TLSv1_2"
    assert (tmp_path / "tls").stat().st_mode & 0o077 == 0
    assert (tmp_path / "tls" / "esker-ca.key").stat().st_mode & 0o177 == 0
    assert {path.name for path in (tmp_path / "tls").iterdir()} == {"esker-ca.key", "esker-ca.pem"}


def test_what_is_no_certificate_is_made_anew(tmp_path: Path) -> None:
    """SPEC P285: a cut-off file is no reason not to start."""
    authority(tmp_path, ADDRESS)
    (tmp_path / "tls" / "esker-ca.pem").write_text("-----BEGIN")
    authority(tmp_path, ADDRESS)
    assert _kept(tmp_path).certificate.subject
