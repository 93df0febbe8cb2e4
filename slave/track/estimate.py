"""What the operator does: position, velocity and acceleration of every joint, kept by a Kalman filter.

A person's movement is made of reaches: a velocity that rises and goes back to zero. So the velocity is
modelled as one that relaxes to rest, critically damped at a rate λ, and is driven by white noise w (a Matérn
process of order 3/2; Särkkä and Solin, Applied Stochastic Differential Equations, 2019, section 12.3):

    v'' + 2 λ v' + λ² v = w

Left to itself over s, with x = λ s:

    v(s) = e⁻ˣ (v (1 + x) + a s)
    p(s) = p + v (2 - e⁻ˣ (2 + x)) / λ + a (1 - e⁻ˣ (1 + x)) / λ²

So the farther ahead, the less is made of velocity and acceleration: neither is believed to last.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np

from common.clock import to_s
from common.quaternion import Array

# README.md has the figures by which these were chosen.
RELAX_PER_S = 6.0
"""λ: a reach is over in some five of its inverses."""
_DRIVE = 40.0
"""Density of w, rad/s³ per √Hz: what reaches of 30 to 60° in a second need."""
_POSITION_NOISE_RAD = 0.003
_VELOCITY_NOISE_RAD_S = 0.03
_ONE = np.eye(3)
_NOISE = np.diag([_POSITION_NOISE_RAD**2, _VELOCITY_NOISE_RAD_S**2])
_UNKNOWN_RAD_S, _UNKNOWN_RAD_S2 = 2.0, 5.0
"""Spread of what a first sample does not tell."""
_JUMP_SIGMAS = 6.0
"""A position farther from where it was expected is another place, not a movement: that joint begins anew."""
_NODES = 0.5 + 0.5 * np.polynomial.legendre.leggauss(3)[0]
_NODE_WEIGHTS = 0.5 * np.polynomial.legendre.leggauss(3)[1]


@dataclass(frozen=True, slots=True)
class Estimate:
    """What is known of the operator when the newest sample was taken."""

    sampled_ns: int
    motion: Array
    """(3, J): position, rad, velocity, rad/s, and acceleration, rad/s²."""
    covariance: Array
    """(3, 3) of them, alike for every joint."""


def relaxed(span_s: float) -> Array:
    """(3, 3): takes position, velocity and acceleration to those `span_s` later."""
    rate = RELAX_PER_S
    x = rate * span_s
    fade = math.exp(-x)
    return np.array(
        [
            [1.0, (2.0 - fade * (2.0 + x)) / rate, (1.0 - fade * (1.0 + x)) / rate**2],
            [0.0, fade * (1.0 + x), fade * span_s],
            [0.0, -fade * rate * x, fade * (1.0 - x)],
        ]
    )


def first(sampled_ns: int, position_rad: Array, velocity_rad_s: Array) -> Estimate:
    """The motion of one sample (J,): what is known from it alone."""
    spread_rad_s = _VELOCITY_NOISE_RAD_S if velocity_rad_s.any() else _UNKNOWN_RAD_S
    motion = np.stack([position_rad, velocity_rad_s, np.zeros_like(position_rad)])
    covariance = np.diag([_POSITION_NOISE_RAD, spread_rad_s, _UNKNOWN_RAD_S2]) ** 2
    return Estimate(sampled_ns, motion, covariance)


def corrected(before: Estimate, sampled_ns: int, position_rad: Array, velocity_rad_s: Array) -> Estimate:
    """The estimate carried on to a later sample (J,) and corrected by it.

    Velocities that are all exactly zero are unknown, or those of a robot's rest: either way positions tell.
    """
    span_s = to_s(sampled_ns - before.sampled_ns)
    carry = relaxed(span_s)
    motion = carry @ before.motion
    covariance = carry @ before.covariance @ carry.T + _driven(round(span_s, 3))
    seen = 2 if velocity_rad_s.any() else 1
    surprise = np.stack([position_rad, velocity_rad_s])[:seen] - motion[:seen]
    noise = _NOISE[:seen, :seen]
    expected = covariance[:seen, :seen] + noise
    gain = covariance[:, :seen] @ _inverse(expected)
    motion += gain @ surprise
    jumped = np.abs(surprise[0]) > _JUMP_SIGMAS * math.sqrt(expected[0, 0])
    if jumped.any():
        motion[:, jumped] = first(sampled_ns, position_rad[jumped], velocity_rad_s[jumped]).motion
    # Joseph's form: stays symmetric and positive, however often it is repeated
    rest = _ONE.copy()
    rest[:, :seen] -= gain
    return Estimate(sampled_ns, motion, rest @ covariance @ rest.T + gain @ noise @ gain.T)


def _inverse(square: Array) -> Array:
    """The inverse of a (1, 1) or symmetric (2, 2): ten times as fast as the library's for any size."""
    if len(square) == 1:
        return np.reciprocal(square)
    a, b, d = square[0, 0], square[0, 1], square[1, 1]
    out: Array = np.array([[d, -b], [-b, a]]) / (a * d - b * b)
    return out


@functools.lru_cache(maxsize=512)
def _driven(span_s: float) -> Array:
    """(3, 3): what w adds within `span_s`: ∫ q² φ φᵀ, φ the last column of `relaxed`, by Gauss."""
    columns = np.stack([relaxed(span_s * node)[:, 2] for node in _NODES.tolist()], axis=1)
    out: Array = _DRIVE**2 * span_s * (columns * _NODE_WEIGHTS) @ columns.T
    return out
