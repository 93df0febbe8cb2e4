"""What an inertial calibration compares: units and axes by gravity and by turns, ranges, plausibility."""

from __future__ import annotations

import numpy as np

from common.quaternion import Array
from master.calibrate import accelerometer as acc
from master.calibrate import gyroscope as gyr
from master.calibrate.carried import confusion, signed_permutations
from master.calibrate.evidence import CrossCheck, agrees, at_most
from master.calibrate.recording import NodeRecording
from master.calibrate.unit_evidence import clipping

_DEGREE = np.pi / 180.0
PLAUSIBLE_ERROR_RAD = 0.2
"""Of gravity after a move, on average, by an uncalibrated gyroscope in the right unit and axes."""
_WORST_ERROR_RAD = 5.0 * _DEGREE
"""The same, calibrated."""
_WORST_NORM_M_S2 = 0.1
"""Of the acceleration at rest against gravity, calibrated."""
_WORST_GAIN = 0.2
"""A sensor's gain is off by 3 %, and its axes are by 2°; beyond this it is something else."""
_WORST_BIAS_M_S2 = 3.0
_ACC_UNITS = (
    (1.0, 0.3, "g, not m/s²; multiply by 9.81"),
    # 2 % apart, which a sensor's own error hides
    (990.0, 0.1, "thousandths of g (multiply by 0.00981), or cm/s² (divide by 100), not m/s²"),
    (32.174, 0.1, "feet/s², not m/s²; multiply by 0.3048"),
)
_FEW_MOVES = 8
_SCALES = np.exp(np.arange(np.log(0.5), np.log(100.0), 0.15))
"""Fastest rate of a session made by hand, rad/s: where nothing is known of the unit."""


def known_unit(norm: float, gravity_m_s2: float) -> CrossCheck:
    """Whether the median norm of a recording, of which little is known yet, is gravity in another unit."""
    name = next((name for size, share, name in _ACC_UNITS if abs(norm / size - 1.0) < share), None)
    return at_most(
        "unit of the acceleration by its median norm",
        abs(norm / gravity_m_s2 - 1.0),
        np.inf if name is None else 0.5,
        advice=f"the accelerometer reads {norm:.3g} at rest: that is {name}",
    )


def acceleration_unit(norm: float, gravity_m_s2: float) -> CrossCheck:
    """The accelerometer's norm at rest against gravity."""
    known = known_unit(norm, gravity_m_s2)
    reading = f"the accelerometer reads {norm:.3g} m/s² at rest, not {gravity_m_s2:.3g}; "
    return at_most(
        "norm of the acceleration at rest against gravity",
        abs(norm / gravity_m_s2 - 1.0),
        0.5,
        advice=known.advice or f"{reading}are its readings in m/s²?",
    )


def ranges(recording: NodeRecording, at_rest: Array) -> list[CrossCheck]:
    """Whether the gyroscope stayed within its range; `at_rest` (T, 3) are its readings while nothing turned.

    A perfect sensor on a turntable reads the same all along: without noise nothing tells that it is clipped.
    """
    noisy = len(at_rest) > 1 and float(np.median(np.abs(np.diff(at_rest, axis=0)))) > 0.0
    return [e for e in clipping(recording) if noisy and e.compared.startswith("gyroscope")]


def axes_and_unit(moves: gyr.Moves, *, counts: bool) -> tuple[Array, float, float]:
    """Of 48 ways to take the gyroscope's axes, and of units, what explains gravity's turns best.

    The signed permutation (3, 3), rad/s of one unit of the readings, and the mean error over the moves, rad.
    """
    short = moves.of(moves.counts <= np.sort(moves.counts)[min(_FEW_MOVES, len(moves.counts)) - 1])
    scales = [1.0, _DEGREE]
    if counts:
        fastest = float(np.max(np.linalg.norm(moves.pairs, axis=-1)))
        scales = (_SCALES / fastest).tolist()
    ways = [(axes, scale) for axes in signed_permutations() for scale in scales]
    errors = [float(np.mean(gyr.gravity_errors(scale * axes, short))) for axes, scale in ways]
    axes, scale = ways[int(np.argmin(errors))]
    if counts:
        fine = scale * np.linspace(0.9, 1.1, 21)
        scale = float(fine[np.argmin([np.mean(gyr.gravity_errors(s * axes, moves)) for s in fine])])
    return axes, scale, float(np.mean(gyr.gravity_errors(scale * axes, moves)))


def gyroscope_axes(moves: gyr.Moves, scale: float, *, counts: bool) -> CrossCheck:
    """The gyroscope's turns against gravity's, its axes as they are: another way that fits contradicts."""
    compared = "gyroscope's axes against gravity's turns"
    error = float(np.mean(gyr.gravity_errors(scale * np.eye(3), moves)))
    if error < PLAUSIBLE_ERROR_RAD:
        return agrees(compared, np.degrees(error), np.degrees(PLAUSIBLE_ERROR_RAD), "°")
    axes, unit, better = axes_and_unit(moves, counts=counts)
    confused = not np.array_equal(axes, np.eye(3)) and better < min(1.5 * PLAUSIBLE_ERROR_RAD, 0.5 * error)
    also = " (and the readings in °/s, not rad/s)" if not counts and unit != 1.0 else ""
    return at_most(
        compared,
        np.degrees(error),
        np.degrees(PLAUSIBLE_ERROR_RAD) if confused else np.inf,
        "°",
        advice=f"the gyroscope does not explain how gravity turns ({np.degrees(error):.0f}° off on average, "
        "and "
        f"{np.degrees(better):.0f}° otherwise): {whose(axes)}{also}. Correct that in the driver, and "
        "record again",
    )


def whose(axes: Array) -> str:
    """Whose axes are confused, where the rates times `axes` fit."""
    # an accelerometer turned by Q shows as Qᵀ, a mirrored one as -Qᵀ
    of_gyro = confusion(axes).replace("its", "the gyroscope's", 1)
    if np.linalg.det(axes) < 0.0:
        return f"{of_gyro} (a mirror image)"
    other = axes.T if np.sum(np.eye(3) != axes.T) < np.sum(np.eye(3) != -axes.T) else -axes.T
    of_acc = confusion(other).replace("its", "the accelerometer's", 1)
    kind = " (a mirror image)" if np.linalg.det(other) < 0.0 else ""
    if np.sum(other != np.eye(3)) < np.sum(axes != np.eye(3)):
        return f"{of_acc}{kind}; or {of_gyro}"
    return f"{of_gyro}; or {of_acc}{kind}"


def found_accelerometer(fit: acc.AccelerometerFit, gravity_m_s2: float, *, counts: bool) -> list[CrossCheck]:
    """The calibrated accelerometer against gravity, and its map against what such a sensor can be."""
    norm = float(np.sqrt(np.mean(fit.residuals_m_s2**2)))
    out = [
        at_most(
            "norm of the calibrated acceleration at rest against gravity",
            norm,
            _WORST_NORM_M_S2,
            "m/s²",
            advice=f"calibrated, the acceleration at rest differs by {norm:.2f} m/s² from attitude to "
            "attitude: "
            "the node was not at rest, is clipped, or its accelerometer is broken; lay it down and let go",
        )
    ]
    if not counts:
        off = float(np.max(np.abs(fit.gain - np.eye(3))))
        bias = float(np.max(np.abs(fit.gain @ fit.bias)))
        out += [
            at_most(
                "accelerometer's gains and axes against a sound sensor's",
                off,
                _WORST_GAIN,
                advice=f"the accelerometer's map is {100 * off:.0f} % off one: is an axis clipped, or scaled "
                "otherwise than the others? Look at its range and its driver",
            ),
            at_most(
                "accelerometer's bias against a sound sensor's",
                bias,
                _WORST_BIAS_M_S2,
                "m/s²",
                advice=f"the accelerometer's bias is {bias:.1f} m/s², more than a sound sensor's; is gravity "
                "taken off by the driver, or the sensor broken?",
            ),
        ]
    return out


def found_gyroscope(fit: gyr.GyroscopeFit, scale: float) -> list[CrossCheck]:
    """The calibrated gyroscope against gravity's turns, and its axes against those delivered."""
    error = float(np.mean(fit.errors_rad))
    off = float(np.max(np.abs(fit.gain / np.cbrt(np.abs(np.linalg.det(fit.gain))) - np.eye(3))))
    return [
        at_most(
            "calibrated gyroscope against gravity's turns",
            np.degrees(error),
            np.degrees(_WORST_ERROR_RAD),
            "°",
            advice=f"the gyroscope does not explain how gravity turns ({np.degrees(error):.0f}° off on "
            "average); "
            "were samples lost, or are its axes not the accelerometer's?",
        ),
        at_most(
            "gyroscope's gains and axes against a sound sensor's",
            off,
            _WORST_GAIN,
            advice=f"the gyroscope's map is {100 * off:.0f} % off the axes delivered, unlike a sensor's: is "
            "an axis clipped, negated or exchanged? Look at its range and its driver",
        ),
    ]
