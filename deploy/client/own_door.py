"""Where a robot's own host reaches its slave."""

from __future__ import annotations

from pathlib import Path

from common.config.load import check_config
from common.link.config import LinkConfig
from deploy.client.destination import Destination

_EVERYWHERE = {"0.0.0.0": "127.0.0.1", "[::]": "[::1]", "*": "127.0.0.1"}


def own_doors(file: Path, link: LinkConfig, robot: str, operator: str = "") -> Destination:
    """The slave of a file, as a process beside it reaches it: at its own endpoints or through its router."""
    kept = link.model_dump(exclude={"listen", "access", "revoked", "twin"})
    doors = link.connect if link.mode == "client" else map(own_door, link.listen)
    link = check_config(file, {**kept, "connect": list(doors)}, LinkConfig)
    return Destination(link, (robot,), operator, operator)


def own_door(endpoint: str) -> str:
    """Where this host itself reaches what listens at an endpoint."""
    transport, _, address = endpoint.partition("/")
    host, colon, port = address.rpartition(":")
    return f"{transport}/{_EVERYWHERE.get(host, host)}{colon}{port}"
