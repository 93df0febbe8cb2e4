"""Keys for one run over a secure transport: a short-lived authority, and a certificate for each party."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path

from common.link.config import TlsConfig
from common.link.endpoint import SECURE, transport_of
from common.link.roles import Role
from deploy.certificates import AUTHORITY
from deploy.certificates.folder import stem, write_pair
from deploy.certificates.make import new_authority, new_identity

VALID = timedelta(days=7)
"""Longer than any soak."""
MASTER, ROUTER = "nurse-1", "router-1"
"""The observer of a run also engages its robots, with the operator's certificate."""


def make_keys(folder: Path, endpoints: Iterable[str], robots: Sequence[str]) -> Path:
    """Write keys for the endpoints' addresses to a new folder below `folder`, and return that folder."""
    keys = folder / "keys"
    now = datetime.now(UTC)
    authority = new_authority("rig", now, VALID)
    write_pair(keys, AUTHORITY, authority)
    secure = [each for each in endpoints if transport_of(each) in SECURE]
    hosts = sorted({each.partition("/")[2].rpartition(":")[0] for each in secure})
    people = [(Role.ROBOT, robot) for robot in robots]
    people += [(Role.OPERATOR, MASTER), (Role.ROUTER, ROUTER)]
    for role, name in people:
        write_pair(keys, stem(role, name), new_identity(authority, role, name, hosts, now, VALID))
    return keys


def tls_of(keys: Path, role: Role, name: str) -> TlsConfig:
    """One party's `[link.tls]`."""
    own = stem(role, name)
    return TlsConfig(ca=keys / f"{AUTHORITY}.pem", certificate=keys / f"{own}.pem", key=keys / f"{own}.key")


def tls_override(keys: Path, role: Role, name: str) -> str:
    """The same for `--set`."""
    tls = tls_of(keys, role, name)
    return f'link.tls={{ ca = "{tls.ca}", certificate = "{tls.certificate}", key = "{tls.key}" }}'


def access_override(robots: Sequence[str]) -> str:
    """`[link.access]` of such a run, for `--set`: the operator commands and sees."""
    named = "[" + ", ".join(f'"{robot}"' for robot in robots) + "]"
    return f'link.access={{ operators = {{ "{MASTER}" = {named} }}, routers = ["{ROUTER}"] }}'
