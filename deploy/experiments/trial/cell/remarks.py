"""What a report says of the holds in a cell's judged time. Pure."""

from __future__ import annotations

from collections.abc import Iterable

from common.clock import to_s
from deploy.harness.operator import UnaskedHold

REFUSED_S = 3.0
"""A refusal to engage that lasts longer than this is remarked: the robot learns late that it may engage."""


def hold_remarks(holds: Iterable[UnaskedHold], began_ns: int) -> list[str]:
    """Each hold, and what came of engaging again, with the seconds since the judged time began."""
    remarks = []
    for hold in holds:
        remarks.append(f"at {_at_s(hold.began_ns, began_ns)} s the robot held: {hold.reason}")
        late = hold.engaged_ns is None or to_s(hold.engaged_ns - hold.began_ns) > REFUSED_S
        if hold.refused and late:
            remarks.append(f"at {_at_s(hold.began_ns, began_ns)} s engage was refused: {hold.refused}")
        if hold.engaged_ns is not None:
            remarks.append(f"at {_at_s(hold.engaged_ns, began_ns)} s the operator engaged again")
    return remarks


def _at_s(at_ns: int, began_ns: int) -> str:
    return f"{max(0.0, to_s(at_ns - began_ns)):.1f}"
