"""Each joint's angle and angular velocity over a run, as in paper B's Fig. 14: encoders beside the truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from common.clock import to_s
from common.quaternion import Array
from common.skeleton import Skeleton
from deploy.measure import MovedSeries, TruthSeries
from deploy.measure.motion import GAP_S
from deploy.measure.roughness import CUTOFF_HZ, GRID_S, low_pass
from deploy.measure.trace import Nanoseconds

LEAST_S = 1.0
"""Less than this of tracking is not drawn."""
SIDES = ("left_", "right_")


@dataclass(frozen=True, slots=True)
class JointCurves:
    """Angles and angular velocities on the grid, (K, J) each; NaN where nothing was measured."""

    angle_deg: Array
    rate_deg_s: Array


@dataclass(frozen=True, slots=True)
class CurveGroup:
    """Joints that belong in one plot: those of a finger, or one joint of both sides."""

    title: str
    joints: tuple[int, ...]
    labels: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Curves:
    """What to draw of a run."""

    time_s: Array
    """(K,) from the beginning of the first stretch in `track`, every GRID_S."""
    robot: JointCurves
    """What the encoders showed."""
    operator: JointCurves | None
    """The truth; None where it is not known."""
    groups: tuple[CurveGroup, ...]


def curves(truth: TruthSeries, moved: MovedSeries, skeleton: Skeleton) -> Curves | None:
    """The curves of a run on one host, whose stamps are of one clock; None where it hardly tracked."""
    tracked_ns = moved.encoder_ns[moved.tracking]
    if len(tracked_ns) == 0 or to_s(int(tracked_ns.max() - tracked_ns.min())) < LEAST_S:
        return None
    begin_ns, end_ns = int(tracked_ns.min()), int(tracked_ns.max())
    time_s = np.arange(0.0, to_s(end_ns - begin_ns), GRID_S)
    known = moved.tracking & moved.valid.all(axis=1)
    robot = _on_grid(time_s, moved.encoder_ns[known] - begin_ns, moved.position_rad[known])
    operator = None
    if len(truth.sampled_ns) > 1:
        operator = _on_grid(time_s, truth.sampled_ns - begin_ns, truth.position_rad)
    return Curves(time_s, robot, operator, groups(skeleton))


def groups(skeleton: Skeleton) -> tuple[CurveGroup, ...]:
    """The joints of each synergy together; without synergies, those that differ only by their side."""
    names = skeleton.joint_names
    together: dict[str, list[str]] = {s.name: list(s.drives) for s in skeleton.synergies}
    if not together:
        for name in names:
            side = next((side for side in SIDES if name.startswith(side)), "")
            together.setdefault(name.removeprefix(side), []).append(name)
    return tuple(
        CurveGroup(
            title=title.replace("_", " "),
            joints=tuple(names.index(member) for member in members),
            labels=tuple(_label(member, title) for member in members),
        )
        for title, members in together.items()
    )


def _label(member: str, title: str) -> str:
    """A joint's name without its group's."""
    rest = member.removeprefix(title).removesuffix(title).strip("_")
    return rest or member


def _on_grid(time_s: Array, at_ns: Nanoseconds, position_rad: Array) -> JointCurves:
    """On the grid; velocities through the filter that roughness is judged by, as encoders have steps."""
    order = np.argsort(at_ns, kind="stable")
    at_s, position_deg = to_s(1) * at_ns[order], np.degrees(position_rad[order])
    angle = np.column_stack([np.interp(time_s, at_s, joint) for joint in position_deg.T])
    rate = np.gradient(low_pass(angle, 1.0 / GRID_S, CUTOFF_HZ), GRID_S, axis=0)
    after = np.clip(np.searchsorted(at_s, time_s), 1, len(at_s) - 1)
    in_gap = at_s[after] - at_s[after - 1] > GAP_S
    beyond = (time_s < at_s[0] - GAP_S) | (time_s > at_s[-1] + GAP_S)
    angle[in_gap | beyond] = rate[in_gap | beyond] = np.nan
    return JointCurves(angle, np.asarray(rate))
