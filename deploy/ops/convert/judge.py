"""Whether an imported node's units and axes can be right: by gravity, and by the gyroscope's turns. Pure."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from common.quaternion import Array
from common.recording.formats.samples import ACC, GYR
from common.recording.formats.units import FACTORS, G_M_S2, SI
from common.recording.node import NodeRecording
from common.recording.together import bridged
from master.calibrate.gyro_gravity import WORST_SCATTER, gyro_gravity, judge_agreement
from master.calibrate.unit_evidence import rest_gravity

_NEAR = 0.1
_SHORTEST_S = 2.0
_LONGEST_BRIDGED_S = 0.25
_FASTEST_RAD_S = 70.0
"""Wearable gyroscopes end at 2000 or 4000 °/s."""


@dataclass(frozen=True, slots=True)
class ImportJudgement:
    """What can be said of one node."""

    refused: str = ""
    """Why it is not to be used as it is, and what to do; empty where nothing speaks against it."""
    gravity_m_s2: float | None = None
    """Median at rest; None where it was not judged."""
    words: str = ""
    """For a person."""


def judge(node: NodeRecording) -> ImportJudgement:
    """Judge the longest stretch without gaps of a node."""
    if node.counts:
        return ImportJudgement(words="raw counts: units are not judged")
    run = longest_run(node)
    if run is None or run.duration_s < _SHORTEST_S:
        why = f"less than {_SHORTEST_S:g} s of acc and gyr"
        return ImportJudgement(_undecided(node, why), words=f"units and axes not judged: {why}")
    gravity = rest_gravity(run.acc_m_s2, run.gyr_rad_s)
    refused = _gravity(node.name, gravity)
    if refused:
        return ImportJudgement(refused, gravity)
    agreement = gyro_gravity(run.acc_m_s2, run.gyr_rad_s, run.rate_hz)
    checks = judge_agreement(agreement)
    if checks[0].verdict == "not judged":
        why = checks[0].advice
        return ImportJudgement(_undecided(node, why), gravity, f"gyroscope's unit and axes not judged: {why}")
    of_unit, of_axes, of_both = checks
    if of_unit.contradicts:
        unit = _gyro_unit(agreement.best if agreement else np.eye(3))
        what = f"{node.name}: {of_unit.advice}"
        return ImportJudgement(f"{what} (--units {GYR}={unit})" if unit else what, gravity)
    if of_axes.contradicts:
        return ImportJudgement(f"{node.name}: {of_axes.advice}", gravity)
    if of_both.contradicts:
        return ImportJudgement("", gravity, of_both.advice)
    scatter = agreement.scatter if agreement else WORST_SCATTER
    return ImportJudgement(
        "", gravity, f"gyroscope and accelerometer agree (gravity scatters by {scatter:.3f} g)"
    )


def _gravity(name: str, gravity: float) -> str:
    if abs(gravity / G_M_S2 - 1.0) < 0.5:
        return ""
    reads = f"{name}: its accelerometer reads {gravity:.4g} at rest; expected about 9.81 {SI[ACC]}"
    for unit, factor in FACTORS[ACC].items():
        if abs(gravity * factor / G_M_S2 - 1.0) < _NEAR:
            return f"{reads}: these are {unit}; give --units {ACC}={unit}"
    return f"{reads}: another unit or raw counts; give --units {ACC}=UNIT, or calibrate it first"


def _undecided(node: NodeRecording, why: str) -> str:
    """Why a gyroscope's numbers cannot be used whose unit neither the file nor the motion tells."""
    there = np.isfinite(node.gyr_rad_s)
    if GYR not in node.assumed or not there.any():
        return ""
    peak = float(np.abs(node.gyr_rad_s[there]).max())
    if peak > _FASTEST_RAD_S:
        return (
            f"{node.name}: its gyroscope reads up to {peak:.4g} and the file tells no unit; expected at most "
            f"{_FASTEST_RAD_S:g} {SI[GYR]}: give --units {GYR}=deg/s, or the unit that it is"
        )
    return (
        f"{node.name}: the file tells no unit of its gyroscope, and the recording does not show it ({why}); "
        f"give --units {GYR}=rad/s or {GYR}=deg/s"
    )


def _gyro_unit(best: Array) -> str:
    scale = float(np.abs(best).max())
    return next((unit for unit, f in FACTORS[GYR].items() if f != 1.0 and np.isclose(f, scale)), "")


def longest_run(node: NodeRecording) -> NodeRecording | None:
    """The longest stretch in which neither acc nor gyr misses more than a quarter of a second."""
    longest = max(1, round(_LONGEST_BRIDGED_S * node.rate_hz))
    acc, gyr = bridged(node.acc_m_s2, longest), bridged(node.gyr_rad_s, longest)
    there = np.isfinite(acc).all(axis=1) & np.isfinite(gyr).all(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], there.astype(np.int8), [0]])))
    if not len(edges):
        return None
    begin, end = edges.reshape(-1, 2)[int(np.argmax(np.diff(edges.reshape(-1, 2), axis=1)))].tolist()
    return replace(node, acc_m_s2=acc[begin:end], gyr_rad_s=gyr[begin:end], mag_ut=None)
