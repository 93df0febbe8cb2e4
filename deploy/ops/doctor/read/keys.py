"""The certificate and key of this host, as [link.tls] names them."""

from __future__ import annotations

import stat
from dataclasses import dataclass
from datetime import datetime

from common.errors import LinkError
from common.link.certificates import check_tls
from common.link.config import TlsConfig
from deploy.certificates.folder import shown


@dataclass(frozen=True, slots=True)
class KeyFacts:
    """What another host would see, and what it would not."""

    trouble: str
    """Why the three files cannot prove anything; empty where they can."""
    common_name: str = ""
    hosts: tuple[str, ...] = ()
    """Addresses and names under which others may connect to it."""
    days_left: float = 0.0
    """Days until the certificate or its authority's certificate ends, whichever is first."""
    open_to_all: bool = False
    """Whether every user of this host can read the key."""


def read_keys(tls: TlsConfig, now: datetime) -> KeyFacts:
    """Checks them as the link itself does, then looks closer."""
    try:
        check_tls(tls, now)
        mine, authority = shown([tls.certificate, tls.ca])
    except LinkError as error:
        return KeyFacts(str(error))
    return KeyFacts(
        "",
        mine.common_name,
        tuple(mine.hosts),
        min(each.days_left(now) for each in (mine, authority)),
        open_to_all=bool(tls.key.stat().st_mode & stat.S_IRWXO),
    )
