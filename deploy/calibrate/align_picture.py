"""The joints' angles over an alignment's recording, for a person to judge whether they are plausible."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from common.quaternion import IDENTITY, Array
from common.skeleton import Skeleton
from deploy.report.plots import save_png
from master.calibrate.alignment import SuitAlignment, posture
from master.calibrate.oriented import orient
from master.calibrate.recording import NodeRecording
from master.joint_angles.decomposition import JointAngles

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_PICTURE_HZ = 20.0


def solved_angles(
    recordings: Mapping[str, NodeRecording], skeleton: Skeleton, found: SuitAlignment, at_hz: float
) -> tuple[Array, Array]:
    """Times (K,) s and joint angles (K, J) rad over a recording; NaN for joints that need a missing node."""
    suit = orient(recordings, list(found.nodes))
    step = max(1, round(suit.rate_hz / at_hz))
    q = posture(suit, found)[::step]
    rows = [skeleton.segment_names.index(name) for name in found.nodes]
    everyone = np.tile(IDENTITY, (len(q), len(skeleton.segments), 1))
    everyone[:, rows] = q
    solver, still = JointAngles(skeleton), np.zeros((len(skeleton.segments), 3))
    angles = np.array([solver.solve(now, still)[0] for now in everyone])
    missing = np.ones(len(skeleton.segments), dtype=np.bool_)
    missing[rows] = False
    angles[:, (skeleton.joint_needs_node & missing).any(axis=1)] = np.nan
    return np.arange(len(q)) * step / suit.rate_hz, angles


def draw_angles(
    recordings: Mapping[str, NodeRecording], skeleton: Skeleton, found: SuitAlignment, path: Path
) -> None:
    """Write the PNG: a row a joint, its limits dashed, the zero pose shaded."""
    if not found.nodes:
        return
    time_s, angles = solved_angles(recordings, skeleton, found, _PICTURE_HZ)
    shown = [j for j in range(len(skeleton.joints)) if np.isfinite(angles[:, j]).all()]
    if not shown:
        return

    def draw(figure: Figure) -> None:
        rows = figure.subplots(len(shown), 1, sharex=True, squeeze=False)[:, 0]
        for axes, j in zip(rows, shown, strict=True):
            joint = skeleton.joints[j]
            axes.plot(time_s, np.degrees(angles[:, j]), linewidth=0.7)
            for limit in (joint.lower_rad, joint.upper_rad):
                axes.axhline(np.degrees(limit), color="k", linestyle="--", linewidth=0.6)
            axes.axvspan(*found.zero_pose_s, color="k", alpha=0.1)
            axes.set_ylabel(f"{joint.name} °", fontsize=7, rotation=0, ha="right")
        rows[-1].set_xlabel("s")

    save_png(path, draw, 10.0, 1.0 + 1.1 * len(shown))
