"""Which robots a person means, where they are, and in whose name: from options or from the master's file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from common.config.load import check_config, load_config
from common.errors import LinkError, TandemError
from common.link.certificates import common_name_in
from common.link.config import LinkConfig
from common.link.endpoint import SECURE, transport_of
from common.link.roles import Role, role_of
from deploy.certificates import AUTHORITY
from deploy.client.certificate import tls_beside
from master.config import MasterConfig

ROUTER_S = 5.0
"""How long a person's question waits for a router that does not answer."""


@dataclass(frozen=True, slots=True)
class Destination:
    """Endpoints to connect to, the robots' names, and the operator's name."""

    link: LinkConfig
    robots: tuple[str, ...]
    """Empty where nobody named any."""
    operator: str = ""
    claimed: str = ""
    """The operator's name as it was given; a certificate may prove another."""


def destination(
    connect: Sequence[str] | None,
    robots: Sequence[str] | None,
    operator: str = "",
    master: Path | None = None,
    certificate: Path | None = None,
    overrides: Sequence[str] = (),
) -> Destination:
    """What the command line says; what it leaves out comes from the master's file, where one is named.

    `overrides`: of that file, as by `--set`. Keys, access through a router and quality of service are the
    file's; a `certificate` is a person's own. Raises ConfigError for a file or an endpoint that is none,
    TandemError where no endpoint is known.
    """
    file = None if master is None else load_config(master, MasterConfig, overrides)
    endpoints = list(connect or (file.link.connect if file else ()))
    if not endpoints:
        raise TandemError(
            "where is the robot? Name its endpoint by --connect, or the master's file by --master"
        )
    if file is None and certificate is None and any(transport_of(each) in SECURE for each in endpoints):
        raise TandemError(
            f"{', '.join(endpoints)}: a certificate is needed there: name yours by --certificate (its .key "
            f"and {AUTHORITY}.pem beside it; `tandem keys` makes them), or the master's file by --master"
        )
    link = _link_of(file, endpoints, certificate)
    named = dict.fromkeys(robots or (file.commanded if file else ()))
    operator = operator or (file.operator.name if file else "")
    return Destination(link, tuple(named), _proved(link, operator), operator)


def _proved(link: LinkConfig, operator: str) -> str:
    """The operator's name as the certificate proves it; without one of an operator, as it was given."""
    if link.tls is None:
        return operator
    try:
        role, name = role_of(common_name_in(link.tls.certificate))
    except (ValueError, LinkError):
        return operator  # what is wrong with the certificate is said when the link opens
    return name if role is Role.OPERATOR else operator


def _link_of(file: MasterConfig | None, endpoints: list[str], certificate: Path | None) -> LinkConfig:
    asked: dict[str, object] = {"connect": endpoints, **tls_beside(certificate)}
    if file is not None:
        # who only asks stands behind no door, and lets nobody in: the rules are for the others' doors
        asked = {**file.link.model_dump(exclude={"listen", "access", "revoked", "twin"}), **asked}
        # a stop goes over both paths too; another endpoint than the file's is another robot's, perhaps
        if file.link.twin is not None and file.link.twin.connect and endpoints == file.link.connect:
            asked["twin"] = {"connect": file.link.twin.connect}
    return check_config(Path("command line"), asked, LinkConfig)
