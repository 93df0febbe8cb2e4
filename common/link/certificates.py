"""A host's own keys, checked before a session is opened: Zenoh would fail later, and in fewer words."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from common.errors import LinkError
from common.link.config import LinkConfig, TlsConfig
from common.link.roles import Role, common_name

if TYPE_CHECKING:
    from cryptography import x509


def check_keys(config: LinkConfig) -> None:
    """Raises LinkError where the files of [link.tls] cannot prove this host's identity now."""
    if config.tls is not None:
        check_tls(config.tls, datetime.now(UTC))


def check_tls(tls: TlsConfig, now: datetime) -> None:
    """Raises LinkError: no such file, another certificate's key, another authority's, or expired."""
    # a fifth of a second to import, which an unencrypted link need not wait for
    from cryptography.exceptions import InvalidSignature
    from cryptography.hazmat.primitives.serialization import load_pem_private_key

    ca, mine = read_certificate(tls.ca), read_certificate(tls.certificate)
    try:
        key = load_pem_private_key(_read(tls.key), password=None)
    except (ValueError, TypeError):
        raise LinkError(f"{tls.key}: expected a private key in PEM without a password") from None
    if key.public_key() != mine.public_key():
        raise LinkError(
            f"{tls.key} is not the key of {tls.certificate}: name the pair that was made together"
        )
    try:
        mine.verify_directly_issued_by(ca)
    except (ValueError, TypeError, InvalidSignature):
        raise LinkError(f"{tls.certificate} is not from the authority of {tls.ca}") from None
    for path, certificate in ((tls.ca, ca), (tls.certificate, mine)):
        if now >= certificate.not_valid_after_utc:
            ended = f"{certificate.not_valid_after_utc:%Y-%m-%d %H:%M} UTC"
            raise LinkError(f"{path} expired at {ended}: make a new one with `tandem keys`")
        if now < certificate.not_valid_before_utc:
            begins = f"{certificate.not_valid_before_utc:%Y-%m-%d %H:%M} UTC"
            raise LinkError(f"{path} is not valid before {begins}: is this host's clock right?")


def check_operator(config: LinkConfig, operator: str) -> None:
    """Raises LinkError where [link.access] would refuse what this operator sends: another's certificate."""
    if config.access is None or config.tls is None:
        return
    own, holder = common_name(Role.OPERATOR, operator), common_name_in(config.tls.certificate)
    if holder != own:
        raise LinkError(
            f"{config.tls.certificate} is the certificate of {holder or 'nobody'}, expected {own}: an "
            "operator commands under the name in the certificate. Correct [operator] name or [link.tls]"
        )


def common_name_in(path: Path) -> str:
    """The common name in a certificate's file; empty where it has none. Raises LinkError."""
    from cryptography.x509.oid import NameOID

    names = read_certificate(path).subject.get_attributes_for_oid(NameOID.COMMON_NAME)
    return str(names[0].value) if names else ""


def read_certificate(path: Path) -> x509.Certificate:
    """The first certificate of a PEM file. Raises LinkError."""
    from cryptography import x509

    try:
        return x509.load_pem_x509_certificate(_read(path))
    except ValueError:
        raise LinkError(f"{path}: expected a certificate in PEM") from None


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise LinkError(
            f"{path} cannot be read ({error.strerror}): [link.tls] names keys that `tandem keys` makes"
        ) from None
