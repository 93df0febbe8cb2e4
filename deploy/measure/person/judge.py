"""Accepts or refuses a worn suit by what a body can do. Pure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from common.quaternion import Array
from common.recording.node import NodeRecording
from common.wire.messages import Mask
from deploy.measure.person.axes import GRAVITY_M_S2, axis_scales
from deploy.measure.person.joints import shared_joint
from deploy.measure.person.steps import PersonStep, expected, step_windows

LOST_SHARE = 0.02
FROZEN_S = 0.3
"""For so long no sensor repeats one reading to the last bit."""
FROZEN_SHARE = 0.1
RATE_RAD_S = 35.0
"""No segment of a person turns faster in such motions."""
SCALE_OFF, SCALE_SIGMAS = 0.2, 4.0
GRAVITY_OFF_M_S2 = 0.6
REST_RAD_S = 0.035
"""2 °/s: what the gyro may read on average while the person stands."""
UNEASY_RAD_S = 0.6
"""A step counts as still where a node turns less than this, RMS."""
MOVES_RAD_S = 0.35
"""RMS of a segment that moves in a step."""
OTHER_SHARE = 0.5
"""A segment that stands turns less than this share of those that move."""
ALIKE = 1.8
"""Left and right, where both do the same: RMS of one by the other's at most."""
MOVED_DEG = 20.0
"""By which a node's direction of gravity may differ between both poses of standing."""
JOINT_RATIO, JOINT_MOTION_M_S2 = 0.35, 0.8
"""Of what two neighbours' accelerations differ by at their joint, of how much they change at all."""


@dataclass(frozen=True, slots=True)
class PersonFinding:
    """One thing that no sound suit on a person shows."""

    node: str
    what: str
    """`silent`, `frozen`, `rate`, `scale`, `mirrored`, `drifts`, `moved`, `swapped`, `idle`, `unequal`, or
    `apart`."""
    words: str


@dataclass(frozen=True, slots=True)
class PersonJudgement:
    """Of one recording."""

    findings: tuple[PersonFinding, ...]
    not_judged: tuple[str, ...]
    """Gyro axes that the motion did not show, as node and axis."""
    lacking: tuple[str, ...] = ()
    """Nodes that the steps ask something of, and that are not in the recording."""

    @property
    def accepted(self) -> bool:
        """Whether nothing is wrong, and nothing that was asked for is missing."""
        return not self.findings and not self.lacking


def judge_person(
    nodes: Mapping[str, NodeRecording], parents: Mapping[str, str], led: bool
) -> PersonJudgement:
    """`parents`: which node each hangs on. `led`: the recording begins with the first of `STEPS`."""
    found: list[PersonFinding] = []
    unknown: list[str] = []
    windows = step_windows(min(node.rate_hz for node in nodes.values()), _samples(nodes)) if led else []
    for name, node in nodes.items():
        answered = np.isfinite(np.hstack([node.gyr_rad_s, node.acc_m_s2])).all(axis=1)
        assert isinstance(answered, np.ndarray)
        dead = _alive(name, node, answered)
        found += dead
        if not dead:
            found += _single(name, node, answered, windows, unknown)
    sound = [name for name in nodes if not any(f.node == name for f in found)]
    if windows:
        found += _swapped(sound, nodes, windows) or _unequal(sound, nodes, windows)
    sound = [name for name in nodes if not any(f.node == name for f in found)]
    found += _joints(sound, nodes, parents)
    return PersonJudgement(tuple(found), tuple(unknown))


def _samples(nodes: Mapping[str, NodeRecording]) -> int:
    return min(len(node.gyr_rad_s) for node in nodes.values())


def _alive(name: str, node: NodeRecording, answered: Mask) -> list[PersonFinding]:
    lost = 1.0 - float(answered.mean())
    if lost > LOST_SHARE:
        return [PersonFinding(name, "silent", f"did not answer for {100.0 * lost:.0f} % of the time")]
    readings = np.hstack([node.acc_m_s2, node.gyr_rad_s])
    same = (readings[1:] == readings[:-1]).all(axis=1)
    longest = max((len(run) for run in _runs(same)), default=0) / node.rate_hz
    if longest > FROZEN_S and (same.mean() > FROZEN_SHARE or longest > 1.0):
        words = f"repeated one reading for {longest:.1f} s"
        return [PersonFinding(name, "frozen", words)]
    rate = float(np.nanpercentile(np.linalg.norm(node.gyr_rad_s, axis=1), 99.9))
    if rate > RATE_RAD_S:
        words = f"turns at {np.degrees(rate):.0f} °/s, which nobody does"
        return [PersonFinding(name, "rate", words)]
    return []


def _single(
    name: str,
    node: NodeRecording,
    answered: Mask,
    windows: Sequence[tuple[PersonStep, slice]],
    unknown: list[str],
) -> list[PersonFinding]:
    """What one node's own readings must agree in."""
    found = []
    still = [window for step, window in windows if step.still]
    quiet = [w for w in still if _rms(node, w) < UNEASY_RAD_S]
    gravity = np.median(np.linalg.norm(node.acc_m_s2[answered], axis=1))
    if abs(gravity - GRAVITY_M_S2) > GRAVITY_OFF_M_S2:
        found.append(PersonFinding(name, "scale", f"its accelerometer reads gravity as {gravity:.1f} m/s²"))
    bias = max((float(np.linalg.norm(np.nanmean(node.gyr_rad_s[w], axis=0))) for w in quiet), default=0.0)
    if bias > REST_RAD_S:
        found.append(
            PersonFinding(
                name, "drifts", f"its gyro reads {np.degrees(bias):.1f} °/s while the person stands"
            )
        )
        return found
    scales = axis_scales(node.acc_m_s2, node.gyr_rad_s, node.rate_hz, answered)
    unknown += [f"{name} {axis}" for axis, s in zip("xyz", scales.scale, strict=True) if not np.isfinite(s)]
    surely = scales.scale + SCALE_SIGMAS * scales.error
    mirrored = [axis for axis, s in zip("xyz", surely, strict=True) if s < 0.0]
    if len(mirrored) == 2:
        other = next(axis for axis in "xyz" if axis not in mirrored)
        words = f"its accelerometer's axis {other} is mirrored, or its gyro's {' and '.join(mirrored)}"
        found.append(PersonFinding(name, "mirrored", words))
    elif mirrored:
        words = f"its gyro's axis {', '.join(mirrored)} is mirrored against its accelerometer"
        found.append(PersonFinding(name, "mirrored", words))
    else:
        for axis, s, error in zip("xyz", scales.scale, scales.error, strict=True):
            if abs(s - 1.0) > max(SCALE_OFF, SCALE_SIGMAS * error):
                words = f"its gyro's axis {axis} reads {100.0 / s:.0f} % of the true rate"
                found.append(PersonFinding(name, "scale", words))
    if len(quiet) == 2 and not found:
        first, last = (_unit(np.nanmean(node.acc_m_s2[w], axis=0)) for w in quiet)
        moved = float(np.degrees(np.arccos(np.clip(first @ last, -1.0, 1.0))))
        if moved > MOVED_DEG:
            words = f"sits {moved:.0f}° otherwise at the end than at the beginning: it slipped, or drifts"
            found.append(PersonFinding(name, "moved", words))
    return found


def _swapped(
    names: Sequence[str], nodes: Mapping[str, NodeRecording], windows: Sequence[tuple[PersonStep, slice]]
) -> list[PersonFinding]:
    """Who moved when another should have: the best exchange of two nodes, or a node that never moved."""
    activity = {name: [_rms(nodes[name], window) for _, window in windows] for name in names}
    moving = [
        float(np.mean([a[i] for name, a in activity.items() if expected(step, name) == 1.0] or [0.0]))
        for i, (step, _) in enumerate(windows)
    ]

    def wrong(segment: str, node: str) -> list[int]:
        """Steps in which a node did not do what its segment should."""
        out = []
        for i, (step, _) in enumerate(windows):
            wanted, seen = expected(step, segment), activity[node][i]
            idle = wanted == 1.0 and seen < max(MOVES_RAD_S, 0.25 * moving[i])
            busy = wanted == 0.0 and not step.still and seen > max(MOVES_RAD_S, OTHER_SHARE * moving[i])
            if idle or busy:
                out.append(i)
        return out

    off = {name: wrong(name, name) for name in names}
    bad = [name for name in names if off[name]]
    found: list[PersonFinding] = []
    for name in bad:
        partners = [
            other for other in bad
            if other != name and len(wrong(name, other)) + len(wrong(other, name)) == 0
        ]  # fmt: skip
        if partners:
            found.append(PersonFinding(name, "swapped", f"moves as {partners[0]} should: they are swapped"))
        else:
            steps = ", ".join(windows[i][0].name for i in off[name])
            found.append(PersonFinding(name, "idle", f"did not move as asked in: {steps}"))
    return found


def _unequal(
    names: Sequence[str], nodes: Mapping[str, NodeRecording], windows: Sequence[tuple[PersonStep, slice]]
) -> list[PersonFinding]:
    found = []
    for step, window in windows:
        if not step.both_alike:
            continue
        for left in (name for name in names if name.startswith("left_") and name in step.moves):
            right = left.replace("left_", "right_")
            if right not in names:
                continue
            ratio = _rms(nodes[left], window) / max(1e-6, _rms(nodes[right], window))
            if not 1.0 / ALIKE < ratio < ALIKE:
                words = f"turned {ratio:.1f} times as much as {right} in: {step.name}"
                found.append(PersonFinding(left, "unequal", words))
    return found


def _joints(
    names: Sequence[str], nodes: Mapping[str, NodeRecording], parents: Mapping[str, str]
) -> list[PersonFinding]:
    """Neighbours whose distances to their joint would have to change."""
    found = []
    for name in names:
        parent = parents.get(name, "")
        if parent not in names or nodes[name].rate_hz != nodes[parent].rate_hz:
            continue
        length = min(len(nodes[name].gyr_rad_s), len(nodes[parent].gyr_rad_s))
        sides = [(nodes[n].acc_m_s2[:length], nodes[n].gyr_rad_s[:length]) for n in (name, parent)]
        joint = shared_joint(sides[0], sides[1], nodes[name].rate_hz)
        ratio = joint.residual_m_s2 / max(1e-6, joint.motion_m_s2)
        if joint.motion_m_s2 > JOINT_MOTION_M_S2 and ratio > JOINT_RATIO:
            words = (
                f"shares no joint with {parent}: at any distance their accelerations differ by "
                f"{joint.residual_m_s2:.1f} m/s²"
            )
            found.append(PersonFinding(name, "apart", words))
    return found


def _rms(node: NodeRecording, window: slice) -> float:
    rates = node.gyr_rad_s[window]
    return float(np.sqrt(np.nanmean((rates**2).sum(axis=1))))


def _unit(vector: Array) -> Array:
    out: Array = vector / max(1e-9, float(np.linalg.norm(vector)))
    return out


def _runs(mask: Mask) -> list[Array]:
    """The indices of each run of True."""
    at = np.flatnonzero(mask)
    return [] if not len(at) else np.split(at, np.flatnonzero(np.diff(at) > 1) + 1)
