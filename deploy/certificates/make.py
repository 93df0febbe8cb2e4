"""Certificates and keys, as objects: an authority, and identities from it. Pure but for the random numbers.

Elliptic-curve keys on P-256: every TLS and QUIC library takes them, and a handshake costs a millisecond.
"""

from __future__ import annotations

import ipaddress
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta

from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from common.link.roles import Role, common_name

CLOCKS_APART = timedelta(minutes=5)
"""How far another host's clock may be behind this one's, and still take a certificate that is just made."""


@dataclass(frozen=True, slots=True)
class Pair:
    """A certificate and its private key."""

    certificate: x509.Certificate
    key: ec.EllipticCurvePrivateKey


def new_authority(name: str, now: datetime, valid: timedelta) -> Pair:
    """A certificate that signs others, and itself."""
    key = ec.generate_private_key(ec.SECP256R1())
    whole = _builder(x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)]), key, now, valid)
    builder = (
        whole.issuer_name(x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)]))
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(_usage(signs_certificates=True), critical=True)
    )
    return Pair(builder.sign(key, hashes.SHA256()), key)


def new_identity(
    authority: Pair, role: Role, name: str, hosts: Sequence[str], now: datetime, valid: timedelta
) -> Pair:
    """A certificate for `role:name`, to connect with, and to listen with under the addresses of `hosts`.

    It ends with its authority at the latest. Raises ValueError for a host that is none, and for an
    authority that has expired.
    """
    left = authority.certificate.not_valid_after_utc - now
    if left <= timedelta(0):
        raise ValueError("the authority has expired: make a new one, and all certificates anew")
    key = ec.generate_private_key(ec.SECP256R1())
    subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, common_name(role, name))])
    issuer = authority.certificate.subject
    builder = (
        _builder(subject, key, now, min(valid, left))
        .issuer_name(issuer)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(_usage(signs_certificates=False), critical=True)
        .add_extension(
            x509.ExtendedKeyUsage([ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH]),
            critical=False,
        )
        .add_extension(
            x509.AuthorityKeyIdentifier.from_issuer_public_key(authority.key.public_key()), critical=False
        )
    )
    if hosts:
        builder = builder.add_extension(
            x509.SubjectAlternativeName([host_name(host) for host in hosts]), critical=False
        )
    return Pair(builder.sign(authority.key, hashes.SHA256()), key)


def host_name(host: str) -> x509.GeneralName:
    """An address or a DNS name, as it stands in an endpoint. Raises ValueError for anything else."""
    try:
        return x509.IPAddress(ipaddress.ip_address(host.strip("[]")))
    except ValueError:
        labels = host.split(".")
        if not host.isascii() or not all(label.replace("-", "a").isalnum() for label in labels):
            raise ValueError(f"expected an address or a host's name, not {host!r}") from None
        return x509.DNSName(host)


def _builder(
    subject: x509.Name, key: ec.EllipticCurvePrivateKey, now: datetime, valid: timedelta
) -> x509.CertificateBuilder:
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - CLOCKS_APART)
        .not_valid_after(now + valid)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
    )


def _usage(signs_certificates: bool) -> x509.KeyUsage:
    return x509.KeyUsage(
        digital_signature=not signs_certificates,
        key_cert_sign=signs_certificates,
        crl_sign=signs_certificates,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        encipher_only=False,
        decipher_only=False,
    )
