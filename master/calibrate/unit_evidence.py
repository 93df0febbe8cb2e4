"""Whether one unit's readings can be believed at all, before anything is concluded from them.

In the order of how likely each cause is: samples missing, the gyroscope dead, the accelerometer's unit and
calibration by gravity at rest, both within their ranges, the gyroscope's unit and axes by gravity's turns.
"""

from __future__ import annotations

import numpy as np

from common.quaternion import Array
from master.calibrate.evidence import CrossCheck, at_most, not_judged
from master.calibrate.gyro_gravity import gyro_gravity, judge_agreement, slipped
from master.calibrate.oriented import LONGEST_GAP_S, bridged, longest_gap
from master.calibrate.recording import NodeRecording
from master.calibrate.soundness import clipped, range_ends

GRAVITY_M_S2 = 9.80665
WORST_GRAVITY = 0.06
"""Error of gravity's norm at rest, as a share. A worn unit's is 0.001 to 0.035; it tilts the unit so much."""
_SHORTEST_S = 2.0
_CLIPPED_GYRO_S = 0.05
"""Each clipped sample loses a part of the turn, and turns the heading for the rest of the recording."""
_CLIPPED_ACC = 0.01
_LEAST_GYRO_RAD_S, _LEAST_ACC_M_S2 = 1.0, 12.0
"""No sensor's range ends below these."""
_OTHER_UNITS = {
    "g": 1.0,
    "thousandths of g": 1000.0,
    "cm/s²": 100.0 * GRAVITY_M_S2,
    "feet/s²": GRAVITY_M_S2 / 0.3048,
}


def rest_gravity(acc_m_s2: Array, gyr: Array) -> float:
    """Median norm of the force (T, 3) where the unit turns least.

    A walking thigh feels a quarter more than gravity most of the time.
    """
    rate = np.linalg.norm(gyr, axis=1)
    return float(np.median(np.linalg.norm(acc_m_s2[rate <= np.quantile(rate, 0.1)], axis=1)))


def unit_evidence(recording: NodeRecording) -> list[CrossCheck]:
    """All checks of one unit, the likeliest cause first; readings in SI units, short gaps are left out."""
    if recording.duration_s < _SHORTEST_S:
        return [not_judged("everything", f"it is {recording.duration_s:.1f} s long")]
    there = _complete(recording)
    if there.contradicts:
        return [there]
    acc = bridged(recording.acc_m_s2, recording.name, recording.rate_hz)
    gyr = bridged(recording.gyr_rad_s, recording.name, recording.rate_hz)
    norm = rest_gravity(acc, gyr)
    out = [there, _alive(gyr), _gravity(norm)]
    if any(e.contradicts for e in out):
        return out
    turns = judge_agreement(gyro_gravity(acc, gyr, recording.rate_hz))
    return [*out, *clipping(recording), *turns[:-1], slipped(acc, gyr, recording.rate_hz), turns[-1]]


def clipping(recording: NodeRecording) -> list[CrossCheck]:
    """Time in which the gyroscope stood at an end of its range, and the accelerometer's share of samples."""
    read = recording.as_read or recording
    gyr, acc = read.gyr_rad_s, read.acc_m_s2
    if read.counts:
        # whole counts hold the very top of a slow turn for three samples now and then
        gyr_out, acc_out = clipped(gyr, 0.0, run=4), clipped(acc, 0.0, run=4)
    else:
        gyr_out, acc_out = clipped(gyr, _LEAST_GYRO_RAD_S), clipped(acc, _LEAST_ACC_M_S2)
    seconds, share = float(gyr_out.sum()) / read.rate_hz, float(acc_out.mean())
    gyro_unit, acc_unit = ("counts", "counts") if read.counts else ("rad/s", "m/s²")
    return [
        at_most(
            "gyroscope within its range",
            seconds,
            _CLIPPED_GYRO_S,
            "s",
            advice=f"its gyroscope is clipped for {seconds:.2f} s ({range_ends(gyr, gyr_out)} {gyro_unit}); "
            "set a larger range, or move more slowly, and record again",
        ),
        at_most(
            "accelerometer within its range",
            share,
            _CLIPPED_ACC,
            "",
            advice=f"its accelerometer is clipped in {share:.1%} of the samples ({range_ends(acc, acc_out)} "
            f"{acc_unit}); set a larger range, and record again",
        ),
    ]


def _complete(recording: NodeRecording) -> CrossCheck:
    gap = max(longest_gap(recording.acc_m_s2), longest_gap(recording.gyr_rad_s))
    return at_most(
        "samples without long gaps",
        (gap - 1) / recording.rate_hz,
        max(1.0 / recording.rate_hz, LONGEST_GAP_S - 1.0 / recording.rate_hz),
        "s",
        advice=f"its samples are missing for more than {LONGEST_GAP_S:g} s; look at its cable or the bus, "
        "and record again",
    )


def _gravity(norm: float) -> CrossCheck:
    """The unit of the accelerometer by its norm at rest."""
    reading = f"its accelerometer reads {norm:.4g} m/s² at rest; expected about 9.81"
    unit = next((u for u, one in _OTHER_UNITS.items() if abs(norm / one - 1.0) < 0.1), None)
    if unit is not None:
        advice = f"{reading}: these seem to be {unit}. Convert the recording to m/s², or set the node's scale"
    elif abs(norm / GRAVITY_M_S2 - 1.0) < 0.5:
        advice = f"{reading}. Calibrate it first (`tandem calibrate imu`)"
    else:
        advice = (
            f"{reading}: another unit, raw counts, or it is broken. Look at the node's scale, or replace it"
        )
    return at_most(
        "norm at rest against gravity", abs(norm / GRAVITY_M_S2 - 1.0), WORST_GRAVITY, advice=advice
    )


def _alive(gyr: Array) -> CrossCheck:
    constant = np.ptp(gyr, axis=0) == 0.0
    # a perfect sensor, as in a simulation, reads zero about an axis about which nothing turns
    noisy = constant.all() or bool(np.median(np.abs(np.diff(gyr[:, ~constant], axis=0)).min(axis=1)) > 0.0)
    dead = [name for name, stuck in zip("xyz", constant.tolist(), strict=True) if stuck and noisy]
    return at_most(
        "gyroscope alive",
        float(len(dead)),
        0.0,
        "axes",
        advice=f"its gyroscope reads the same value all the time on {', '.join(dead)}; is it alive? "
        "Replace the node",
    )
