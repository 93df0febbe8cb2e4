"""Butterworth low-pass over all channels of all sensors at once.

Own design: scipy.signal would cost the master half its memory budget. The tests hold it equal to scipy's.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from common.quaternion import Array
from common.wire.messages import Mask


def butterworth(order: int, cutoff_hz: float, rate_hz: float) -> Array:
    """Second-order sections (order / 2, 5), each b0 b1 b2 a1 a2 with gain 1 at DC, lowest Q first.

    The analogue prototype's pole pairs s² + s/Q + 1, Q = 1 / (2 cos θ), through the bilinear transform,
    the cut-off (-3 dB) prewarped. `order` is even; `cutoff_hz` lies below half of `rate_hz`.
    """
    if order < 2 or order % 2:
        raise ValueError(f"order must be even and at least 2, not {order}")
    if not 0.0 < cutoff_hz < 0.5 * rate_hz:
        raise ValueError(f"cutoff_hz must lie between 0 and {0.5 * rate_hz}, not {cutoff_hz}")
    k = np.tan(np.pi * cutoff_hz / rate_hz)
    theta = np.pi * np.arange(1, order, 2) / (2 * order)
    damping = 2.0 * k * np.cos(theta)
    scale = 1.0 + damping + k * k
    b0 = k * k / scale
    a1 = 2.0 * (k * k - 1.0) / scale
    a2 = (1.0 - damping + k * k) / scale
    return np.stack([b0, 2.0 * b0, b0, a1, a2], axis=-1)


def group_delay_s(sections: Array, rate_hz: float) -> float:
    """Delay at DC, s, of sections (n, 5)."""
    a1, a2 = sections[:, 3], sections[:, 4]
    samples = 1.0 - (a1 + 2.0 * a2) / (1.0 + a1 + a2)
    return float(np.sum(samples)) / rate_hz


def step_matrix(sections: Array) -> Array:
    """The sections as one matrix (1 + 2n, 1 + 2n): [output, next states] = matrix · [input, states].

    Each section is the transposed direct form II:
    y = b0 x + s1,  s1 ← b1 x - a1 y + s2,  s2 ← b2 x - a2 y.
    """
    unit = np.eye(1 + 2 * len(sections))
    matrix = np.zeros_like(unit)
    signal = unit[0]
    for i, (b0, b1, b2, a1, a2) in enumerate(sections):
        s1, s2 = 1 + 2 * i, 2 + 2 * i
        output = b0 * signal + unit[s1]
        matrix[s1] = b1 * signal - a1 * output + unit[s2]
        matrix[s2] = b2 * signal - a2 * output
        signal = output
    matrix[0] = signal
    return matrix


def steady_states(sections: Array) -> Array:
    """States (2n,) that a constant input of 1 settles to."""
    b0, b2, a2 = sections[:, 0], sections[:, 2], sections[:, 4]
    return np.stack([1.0 - b0, b2 - a2], axis=-1).ravel()


class LowPass:
    """Filters of one order, one cut-off a sensor, over `nodes` × 3 channels each.

    A channel starts as if its first sample had always been there, so that nothing rings; it starts again
    after a NaN. A NaN never leaves its channel.
    """

    def __init__(self, cutoffs_hz: Sequence[float], order: int, rate_hz: float, nodes: int) -> None:
        """A cut-off of 0 passes its sensor's samples as they are."""
        sensors, states = len(cutoffs_hz), order
        self._matrix = np.zeros((sensors, 1 + states, 1 + states))
        self._matrix[:, 0, 0] = 1.0
        self._steady = np.zeros((sensors, states, 1))
        delays = [0.0] * sensors
        for i, cutoff_hz in enumerate(cutoffs_hz):
            if cutoff_hz > 0.0:
                sections = butterworth(order, cutoff_hz, rate_hz)
                self._matrix[i] = step_matrix(sections)
                self._steady[i, :, 0] = steady_states(sections)
                delays[i] = group_delay_s(sections, rate_hz)
        self.delays_s = tuple(delays)
        """Group delay of each sensor's filter at DC, s."""
        self._shape = (sensors, nodes, 3)
        # row 0 holds the input, the rest the states; NaN states have yet to start
        self._state = np.full((sensors, 1 + states, 3 * nodes), np.nan)
        self._next = np.empty_like(self._state)

    def update(self, samples: Array) -> Array:
        """One tick: samples (sensors, nodes, 3) to the filtered ones, a view good until the next tick."""
        state = self._state
        state[:, 0] = samples.reshape(len(state), -1)
        running = np.isfinite(state[:, 1])
        if not running.all():
            self._start(~running)
        np.matmul(self._matrix, state, out=self._next)
        self._state, self._next = self._next, state
        return self._state[:, 0].reshape(self._shape)

    def _start(self, channels: Mask) -> None:
        """Give channels (sensors, 3 nodes) the steady state of the sample they now hold."""
        first = self._steady * self._state[:, :1]
        np.copyto(self._state[:, 1:], first, where=channels[:, None])

    def restart(self, nodes: Mask) -> None:
        """Forget the past of some nodes, mask (nodes,)."""
        self._state[:, 1:, np.repeat(nodes, 3)] = np.nan
