"""How jerkily the robot moves: its acceleration beside the operator's, both seen through one filter.

Encoders of 12 bits (0.09° a count) read at 50 Hz would give tens of rad/s² by differencing alone, so both
series take the same way: readings at the same instants, a uniform grid, a zero-phase low-pass, then
differenced twice. A perfect copy therefore comes out as 1 whatever the filter does.
"""

from __future__ import annotations

import numpy as np

from common.clock import to_ns, to_s
from common.quaternion import Array
from deploy.measure.trace import Nanoseconds

CUTOFF_HZ = 10.0
"""Wide enough to pass what a staircase at 12.5 Hz shakes; a reach of 60° in 1 s then stands 7:1 above the
12-bit quantisation."""
GRID_S = 0.005
MIN_STRETCH_S = 1.0
"""Shorter unbroken stretches are left out."""
_TRIM_S = 0.1
_PAD_S = 0.5


def accelerations(
    at_ns: Nanoseconds, robot_rad: Array, operator_rad: Array, gap_s: float
) -> tuple[Array, Array]:
    """Low-passed accelerations of both, rad/s², (K, J) each on a uniform grid.

    `at_ns` is (T,), strictly rising; both angle tables are (T, J). A silence longer than `gap_s` ends a
    stretch; a joint with a NaN in a stretch is NaN in all of that stretch.
    """
    joints = robot_rad.shape[1]
    robot, operator = [np.empty((0, joints))], [np.empty((0, joints))]
    cuts = np.flatnonzero(np.diff(at_ns) > to_ns(gap_s)) + 1
    for rows in np.split(np.arange(len(at_ns)), cuts):
        if len(rows) < 2 or at_ns[rows[-1]] - at_ns[rows[0]] < to_ns(MIN_STRETCH_S):
            continue
        time_s = to_s(1) * (at_ns[rows] - at_ns[rows[0]])
        robot.append(acceleration(time_s, robot_rad[rows]))
        operator.append(acceleration(time_s, operator_rad[rows]))
    return np.concatenate(robot), np.concatenate(operator)


def acceleration(time_s: Array, position_rad: Array) -> Array:
    """Low-passed acceleration of one stretch, (K, J); `time_s` (T,) starts at 0 and rises."""
    grid_s = np.arange(0.0, time_s[-1], GRID_S)
    uniform = np.column_stack([np.interp(grid_s, time_s, joint) for joint in position_rad.T])
    smooth = low_pass(uniform, 1.0 / GRID_S, CUTOFF_HZ)
    trim = round(_TRIM_S / GRID_S)
    out: Array = np.diff(smooth[trim:-trim], n=2, axis=0) / GRID_S**2
    return out


def low_pass(values: Array, rate_hz: float, cutoff_hz: float) -> Array:
    """A second-order Butterworth run forward and backward: gain 1 / (1 + (f / cutoff)⁴), no delay. (T, J)."""
    # imported here: it takes longer than the rest of tandem together
    from scipy.signal import butter, sosfiltfilt

    sections = butter(2, cutoff_hz, fs=rate_hz, output="sos")
    pad = min(round(_PAD_S * rate_hz), len(values) - 1)
    return np.asarray(sosfiltfilt(sections, values, axis=0, padtype="odd", padlen=pad))
