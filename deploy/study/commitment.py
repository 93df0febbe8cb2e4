"""What a blinded folder holds of the key: its codes and the commitment, in the protocol or a trial's plan."""

from __future__ import annotations

import json
from pathlib import Path

from common.errors import TandemError
from deploy.study.protocol import load_protocol
from deploy.study.session import PROTOCOL

PLAN = "plan.json"
"""Of `tandem trial`."""


def committed_in(folder: Path) -> tuple[tuple[str, ...], str]:
    """The codes and the commitment. Raises TandemError where the folder is not one of a blinded study."""
    if (folder / PROTOCOL).exists():
        protocol = load_protocol(folder / PROTOCOL)[0]
        if protocol.blinded:
            return tuple(protocol.conditions), protocol.commitment
    elif (folder / PLAN).exists():
        try:
            plan = json.loads((folder / PLAN).read_text("utf-8"))
            if plan["blinded"]:
                return tuple(plan["transports"]), str(plan["blinded"])
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise TandemError(f"{folder / PLAN}: cannot be read ({error})") from None
    raise TandemError(f"{folder}: it is not the folder of a blinded session or trial")
