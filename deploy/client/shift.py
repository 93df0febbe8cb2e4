"""What a person reads of an operator's shift: scaled motion, raised arms, headings, the zero pose."""

from __future__ import annotations

from common.metrics.master import MasterMetrics

_RAISED_FROM_S = 30.0
"""A shorter time in the last quarter of an hour is not worth a line."""


def shift_lines(master: MasterMetrics | None) -> tuple[str, ...]:
    """One line a thing, from what the master of one robot published; none where it published nothing."""
    if master is None:
        return ()
    scaling = {name: share for one in master.robots.values() for name, share in one.scaling.items()}
    shares = ", ".join(f"{name} × {share:g}" for name, share in scaling.items())
    raised = [
        f"{name} {load.raised_s / 60.0:.1f} min"
        for name, load in master.arm_load.items()
        if load.raised_s >= _RAISED_FROM_S
    ]
    pose = master.zero_pose_again
    lines = (
        shares and f"motion scaled about the posture at engage: {shares}",
        raised and f"arms raised in the last 15 min: {', '.join(raised)}",
        pose is not None and pose.why and f"zero pose refused: {pose.why}: the old one stays",
    )
    return tuple(line for line in lines if line)
