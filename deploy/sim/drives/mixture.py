"""A robot whose drives are of five makers by turns: what its file says of them, how they are simulated."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass

from common.skeleton import Skeleton
from deploy.sim.drives.makers import MAKERS
from slave.servos.canopen.config import CanopenConfig

SAYS: Mapping[str, Mapping[str, object]] = {
    "epos": {},
    "interpolating": {"holds_itself": True},
    "fixed": {"holds_itself": True},
    "segmented": {"holds_itself": True, "boots_twice": True},
    "reserved-bits": {"unused_status_bits": [9]},
}
"""What a robot's file must say of each kind, in its drive's section."""


@dataclass(frozen=True, slots=True)
class Mixture:
    """The two sides of one robot."""

    override: str
    """Of the file that the slave and the simulated drives read."""
    arguments: tuple[str, ...]
    """Of `tandem drives`."""


def mixture(skeleton: Skeleton) -> Mixture:
    """Joint by joint the next maker's drive."""
    sections, arguments = [], []
    kinds = list(MAKERS)
    for i, (joint, drive) in enumerate(CanopenConfig().drives_of(skeleton).items()):
        kind = kinds[i % len(kinds)]
        keys = {"id": drive.id, "bus": drive.bus, **SAYS[kind]}
        sections.append(f"{joint} = {{ {', '.join(f'{key} = {json.dumps(v)}' for key, v in keys.items())} }}")
        arguments += ["--maker", f"{joint}={kind}"]
    return Mixture(f"servos.canopen.drives={{ {', '.join(sections)} }}", tuple(arguments))
