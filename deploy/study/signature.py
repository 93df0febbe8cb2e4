"""A host's signature under a seal's head: ECDSA with SHA-256, by a key that `tandem keys` made."""

from __future__ import annotations

from pathlib import Path

from cryptography import x509
from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.hashes import SHA256
from cryptography.hazmat.primitives.serialization import load_pem_private_key
from cryptography.x509.oid import NameOID

from common.errors import TandemError


def sign(head: str, key: Path) -> tuple[str, str]:
    """The signature (hex) and the signer's certificate (PEM), which lies beside the key as NAME.pem.

    Raises TandemError where one of the two cannot be read, or they do not belong together.
    """
    certificate = key.with_suffix(".pem")
    try:
        secret = load_pem_private_key(key.read_bytes(), None)
        shown = x509.load_pem_x509_certificate(certificate.read_bytes())
    except OSError as error:
        raise TandemError(f"{error.filename}: cannot be read ({error.strerror})") from None
    except (ValueError, TypeError, UnsupportedAlgorithm):
        raise TandemError(f"{key}: no key of `tandem keys`, or {certificate} is no certificate") from None
    if not isinstance(secret, ec.EllipticCurvePrivateKey):
        raise TandemError(f"{key}: expected an elliptic key, as `tandem keys` makes it")
    if secret.public_key() != shown.public_key():
        raise TandemError(f"{key}: {certificate} is the certificate of another key")
    return secret.sign(head.encode(), ec.ECDSA(SHA256())).hex(), certificate.read_text("ascii")


def signer_of(head: str, signature: str, certificate: str) -> str | None:
    """The common name of the certificate whose key signed this head; None where it did not."""
    try:
        shown = x509.load_pem_x509_certificate(certificate.encode())
        public = shown.public_key()
        if not isinstance(public, ec.EllipticCurvePublicKey):
            return None
        public.verify(bytes.fromhex(signature), head.encode(), ec.ECDSA(SHA256()))
        names = shown.subject.get_attributes_for_oid(NameOID.COMMON_NAME)
    except (ValueError, InvalidSignature, UnsupportedAlgorithm):
        return None
    return str(names[0].value) if names else ""
