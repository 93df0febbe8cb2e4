"""Joint angles as a BVH file: the skeleton with its lengths in m, then one row of Euler angles a frame.

BVH has y up, z ahead and x to the left; each segment turns by Rz · Rx · Ry in its parent.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from common.errors import RecordingError
from common.quaternion import Array, to_matrix
from common.skeleton import Skeleton
from common.skeleton.kinematics import relative_orientations
from deploy.ops.convert.joints import JointSeries
from deploy.report.output import writing

_TO_BVH = [1, 2, 0]
"""For each axis of BVH (left, up, ahead), the place of the same axis in tandem's order (ahead, left, up)."""
_ROOT = "base"


def write_bvh(path: Path, series: JointSeries, skeleton: Skeleton, rate_hz: float) -> str:
    """Angles on an even grid of `rate_hz`, linear in between; what was missing is held."""
    if path.exists():
        raise RecordingError(f"{path}: is there already; name another file, or move it away")
    held, missing = series.held()
    time_s = np.arange(int(series.time_s[-1] * rate_hz + 1e-6) + 1) / rate_hz
    even = np.stack([np.interp(time_s, series.time_s, column) for column in held.T], axis=-1)
    angles = np.degrees(euler_zxy(to_matrix(relative_orientations(skeleton, even))))
    order, lines = _hierarchy(skeleton)
    rows = angles[:, order].reshape(len(even), -1)
    lines += ["MOTION", f"Frames: {len(even)}", f"Frame Time: {1.0 / rate_hz:.9f}"]
    root = "0 0 0 0 0 0 "
    lines += [root + " ".join(f"{angle:.9f}" for angle in row) for row in rows.tolist()]
    with writing(path):
        path.write_text("\n".join(lines) + "\n", "utf-8")
    return f"{missing} angles that were not valid are held at the last valid one" if missing else ""


def euler_zxy(r: Array) -> Array:
    """Angles (..., 3) about z, x and y of rotations (..., 3, 3) in tandem's frame, in the frame of BVH."""
    b = r[..., _TO_BVH, :][..., _TO_BVH]
    return np.stack(
        [
            np.arctan2(-b[..., 0, 1], b[..., 1, 1]),
            np.arcsin(np.clip(b[..., 2, 1], -1.0, 1.0)),
            np.arctan2(-b[..., 2, 0], b[..., 2, 2]),
        ],
        axis=-1,
    )


def _hierarchy(skeleton: Skeleton) -> tuple[list[int], list[str]]:
    """The segments in the order in which BVH lists them, and its lines of the hierarchy."""
    order: list[int] = []
    lines = ["HIERARCHY", f"ROOT {_ROOT}", "{", "\tOFFSET 0 0 0"]
    lines.append("\tCHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation")

    def add(segment: int, depth: int) -> None:
        order.append(segment)
        table, tabs = skeleton.segments[segment], "\t" * depth
        lines.append(f"{tabs}JOINT {table.name}")
        lines.append(f"{tabs}{{")
        lines.append(f"{tabs}\tOFFSET {_offset(table.origin_m)}")
        lines.append(f"{tabs}\tCHANNELS 3 Zrotation Xrotation Yrotation")
        children = np.flatnonzero(skeleton.parents == segment).tolist()
        for child in children:
            add(child, depth + 1)
        if not children:
            tip = table.shape.tip_m or tuple(2.0 * value for value in table.node_m)
            lines.extend(
                [f"{tabs}\tEnd Site", f"{tabs}\t{{", f"{tabs}\t\tOFFSET {_offset(tip)}", f"{tabs}\t}}"]
            )
        lines.append(f"{tabs}}}")

    for root in np.flatnonzero(skeleton.parents < 0).tolist():
        add(root, 1)
    lines.append("}")
    return order, lines


def _offset(point_m: Sequence[float]) -> str:
    return " ".join(f"{point_m[i]:.6f}" for i in _TO_BVH)
