"""The folder of an authority: `ca.pem`, `ca.key`, and `ROLE-NAME.pem` and `.key` for each certificate."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import (
    Encoding,
    NoEncryption,
    PrivateFormat,
    load_pem_private_key,
)
from cryptography.x509.oid import NameOID

from common.errors import LinkError
from common.link.certificates import read_certificate
from common.link.roles import Role
from deploy.certificates import AUTHORITY, KeysError
from deploy.certificates.make import Pair


@dataclass(frozen=True, slots=True)
class Shown:
    """What a person wants to know of a certificate."""

    file: Path
    common_name: str
    hosts: tuple[str, ...]
    begins: datetime
    ends: datetime
    authority: bool

    def days_left(self, now: datetime) -> float:
        """Negative where it has expired."""
        return (self.ends - now).total_seconds() / 86400


def stem(role: Role, name: str) -> str:
    """Of the files of a certificate."""
    return f"{role}-{name}"


def write_pair(folder: Path, name: str, pair: Pair) -> tuple[Path, Path]:
    """Write NAME.pem and NAME.key (mode 0600), and never over another. Raises KeysError."""
    certificate, key = folder / f"{name}.pem", folder / f"{name}.key"
    there = [str(path) for path in (certificate, key) if path.exists()]
    if there:
        raise KeysError(f"{' and '.join(there)} exist already: nothing is overwritten; move them away first")
    secret = pair.key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _write_new(key, secret, 0o600)
        _write_new(certificate, pair.certificate.public_bytes(Encoding.PEM), 0o644)
    except OSError as error:
        raise KeysError(f"{error.filename or folder} cannot be written: {error.strerror}") from None
    return certificate, key


def read_authority(folder: Path) -> Pair:
    """The authority of a folder. Raises KeysError where there is none."""
    if not (folder / f"{AUTHORITY}.key").exists():
        raise KeysError(f"no authority in {folder}: make one with `tandem keys authority {folder}`")
    try:
        certificate = read_certificate(folder / f"{AUTHORITY}.pem")
        key = load_pem_private_key((folder / f"{AUTHORITY}.key").read_bytes(), None)
    except (LinkError, OSError, ValueError, TypeError) as error:
        raise KeysError(f"the authority in {folder} cannot be used: {error}") from None
    if not isinstance(key, ec.EllipticCurvePrivateKey) or key.public_key() != certificate.public_key():
        raise KeysError(f"{folder / AUTHORITY}.key is not the key of {folder / AUTHORITY}.pem")
    return Pair(certificate, key)


def shown(paths: Iterable[Path]) -> Iterator[Shown]:
    """What is in these files, and in the .pem files of these folders. Raises KeysError."""
    for path in paths:
        files = sorted(path.glob("*.pem")) if path.is_dir() else [path]
        if not files:
            raise KeysError(f"no certificate in {path}: expected files that end in .pem")
        for file in files:
            try:
                yield _shown(file, read_certificate(file))
            except LinkError as error:
                raise KeysError(str(error)) from None


def _shown(file: Path, certificate: x509.Certificate) -> Shown:
    names = certificate.subject.get_attributes_for_oid(NameOID.COMMON_NAME)
    return Shown(
        file,
        str(names[0].value) if names else "",
        tuple(_hosts(certificate)),
        certificate.not_valid_before_utc,
        certificate.not_valid_after_utc,
        _is_authority(certificate),
    )


def _hosts(certificate: x509.Certificate) -> list[str]:
    try:
        found = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    except x509.ExtensionNotFound:
        return []
    return [str(general.value) for general in found]


def _is_authority(certificate: x509.Certificate) -> bool:
    try:
        return certificate.extensions.get_extension_for_class(x509.BasicConstraints).value.ca
    except x509.ExtensionNotFound:
        return False


def _write_new(path: Path, data: bytes, mode: int) -> None:
    # created with its mode at once: nobody can read the key in between
    handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode)
    with os.fdopen(handle, "wb") as file:
        file.write(data)


def write_browser_pair(folder: Path, name: str, password: str) -> Path:
    """Write NAME.p12 of NAME.pem and NAME.key, for a browser. Raises KeysError."""
    from cryptography import x509
    from cryptography.hazmat.primitives.asymmetric.ec import EllipticCurvePrivateKey
    from cryptography.hazmat.primitives.serialization import BestAvailableEncryption, load_pem_private_key
    from cryptography.hazmat.primitives.serialization.pkcs12 import serialize_key_and_certificates

    certificate, key, packed = (folder / f"{name}.{end}" for end in ("pem", "key", "p12"))
    if packed.exists():
        raise KeysError(f"{packed} exists already: nothing is overwritten; move it away first")
    try:
        shown = x509.load_pem_x509_certificate(certificate.read_bytes())
        secret = load_pem_private_key(key.read_bytes(), None)
        assert isinstance(secret, EllipticCurvePrivateKey)
        content = serialize_key_and_certificates(
            name.encode(), secret, shown, None, BestAvailableEncryption(password.encode())
        )
        _write_new(packed, content, 0o600)
    except OSError as error:
        raise KeysError(f"{error.filename}: cannot be read or written ({error.strerror})") from None
    except ValueError as error:
        raise KeysError(f"{certificate}: no certificate with its key ({error})") from None
    return packed
