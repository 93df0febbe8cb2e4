"""Gyro against accelerometer: each gyro axis's scale and sign, from any motion of a person.

A body's own acceleration averages out over a second or two, gravity does not. So the specific force, turned
into one frame by the gyro and averaged, is the same before and after:

    f₁ = mean over the first half of R(t) a(t),   f₂ = over the second,   Ṙ = R [S ω]×,   S = diag(s)

The s for which f₁ and f₂ agree best, over all windows, is 1 for a sound sensor, −1 for a mirrored axis, 1.25
for an axis that reads a fifth too little. One mirrored gyro axis gives one negative s; one mirrored
accelerometer axis gives the other two.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from common.quaternion import Array
from common.wire.messages import Mask

WINDOW_S = 2.4
RATE_HZ = 50.0
"""To which readings are thinned by means."""
GRAVITY_M_S2 = 9.80665
STEP = 0.05
"""Of the numerical derivatives."""
LEAST_TURN_RAD = 0.4
"""Of gravity, about an axis, root of the sum of squares over all windows: with less it is not judged."""
MOST_WINDOWS = 150
EASY_M_S2 = 0.5
"""Windows that are off by less count in full: where most are at rest, their median says nothing."""
MUCH_BETTER = 0.7


@dataclass(frozen=True, slots=True)
class AxisScales:
    """Of one node's gyro."""

    scale: Array
    """(3,) 1 where it is sound; NaN where the motion did not show it."""
    error: Array
    """(3,) standard error of each."""
    residual_deg: float
    """By how much gravity's direction is off between two halves of a window, median."""


def axis_scales(acc_m_s2: Array, gyr_rad_s: Array, rate_hz: float, answered: Mask) -> AxisScales:
    """From readings (T, 3), evenly spaced."""
    nothing = AxisScales(np.full(3, np.nan), np.full(3, np.nan), np.nan)
    thin = max(1, round(rate_hz / RATE_HZ))
    dt_s, span = thin / rate_hz, round(WINDOW_S * RATE_HZ)
    rows = len(acc_m_s2) // thin * thin
    acc, gyr = (x[:rows].reshape(-1, thin, 3).mean(axis=1) for x in (acc_m_s2, gyr_rad_s))
    whole: Mask = np.asarray(answered[:rows].reshape(-1, thin).all(axis=1))
    count = len(acc) // span
    if count < 4:
        return nothing
    acc, gyr = (x[: count * span].reshape(count, span, 3) for x in (acc, gyr))
    good = whole[: count * span].reshape(count, span).all(axis=1)
    turns = np.where(good, np.nan_to_num((gyr**2).sum(axis=(1, 2))), -1.0)
    chosen = np.argsort(-turns)[: min(MOST_WINDOWS, int(good.sum()))]
    if len(chosen) < 4:
        return nothing
    acc, gyr = acc[chosen], gyr[chosen]
    signs = [np.array(s) for s in itertools.product((1.0, -1.0), repeat=3)]
    costs = [_cost(_off(acc, gyr * s, dt_s)) for s in signs]
    best = int(np.argmin(costs))
    # the first are no mirrored axes: others must explain the motion far better
    chosen_signs = signs[best] if costs[best] < MUCH_BETTER * costs[0] else signs[0]
    return _refined(acc, gyr, dt_s, chosen_signs)


def _refined(acc: Array, gyr: Array, dt_s: float, scale: Array) -> AxisScales:
    """Gauss and Newton from a choice of signs, with weights by Cauchy."""
    error, judged = np.full(3, np.nan), np.zeros(3, np.bool_)
    for _ in range(5):
        off = _off(acc, gyr * scale, dt_s)
        slopes = np.stack(
            [(_off(acc, gyr * (scale + STEP * e), dt_s) - off) / STEP for e in np.eye(3)], axis=2
        )
        size = np.linalg.norm(off, axis=1)
        weight = 1.0 / (1.0 + (size / max(EASY_M_S2, 1.5 * float(np.median(size)))) ** 2)
        seen_rad = np.sqrt((slopes**2 * weight[:, None, None]).sum(axis=(0, 1))) / GRAVITY_M_S2
        judged = seen_rad > LEAST_TURN_RAD
        if not judged.any():
            break
        a = (slopes[:, :, judged] * np.sqrt(weight)[:, None, None]).reshape(-1, int(judged.sum()))
        b = (off * np.sqrt(weight)[:, None]).ravel()
        normal = a.T @ a + 1e-6 * np.eye(a.shape[1])
        step = np.linalg.solve(normal, a.T @ b)
        scale = scale.copy()
        scale[judged] -= np.clip(step, -0.2, 0.2)
        spread = (b**2).sum() / max(1, len(b) - a.shape[1])
        error = np.full(3, np.nan)
        error[judged] = np.sqrt(np.diag(np.linalg.inv(normal)) * spread)
    off = np.linalg.norm(_off(acc, gyr * scale, dt_s), axis=1)
    residual_deg = float(np.degrees(np.median(off) / GRAVITY_M_S2))
    return AxisScales(np.where(judged, scale, np.nan), np.where(judged, error, np.nan), residual_deg)


def _cost(off: Array) -> float:
    # the mean, capped: most windows may be at rest, and some hold a blow
    return float(np.minimum(np.linalg.norm(off, axis=1), GRAVITY_M_S2 / 2.0).mean())


def _off(acc: Array, gyr: Array, dt_s: float) -> Array:
    """(W, 3): the second half's mean force less the first's, in the frame of the window's middle."""
    count, span, _ = acc.shape
    half = span // 2
    turned = np.empty_like(acc)
    turned[:, half] = acc[:, half]
    for begin, step in ((half, 1), (half, -1)):
        frame = np.tile(np.eye(3), (count, 1, 1))
        at = begin
        while 0 <= at + step < span:
            rate = 0.5 * (gyr[:, at] + gyr[:, at + step]) * (step * dt_s)
            frame = frame @ _rotation(rate)
            at += step
            turned[:, at] = np.einsum("wij,wj->wi", frame, acc[:, at])
    off: Array = turned[:, half:].mean(axis=1) - turned[:, :half].mean(axis=1)
    return off


def _rotation(vector: Array) -> Array:
    """Rodrigues' rotation of rotation vectors (W, 3)."""
    angle = np.linalg.norm(vector, axis=1)[:, None, None] + 1e-12
    x, y, z = vector.T
    zero = np.zeros_like(x)
    k = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)
    out: Array = np.eye(3) + np.sin(angle) / angle * k + (1.0 - np.cos(angle)) / angle**2 * (k @ k)
    return out
