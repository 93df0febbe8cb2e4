"""The gyroscope's turns against gravity's: whether both sensors of a unit tell of one and the same motion.

Turned back by the gyroscope's rates, the specific force of some seconds averages to gravity, always in the
same direction: f̄ = (1/T) ∫ R(t) f(t) dt = g + Δv / T. Rates in another unit, an axis that is negated or
exchanged, a clipped gyroscope, or a unit that was turned between two samples scatter it. Each guess of what
is wrong (the 48 signed permutations of the gyroscope's axes, and other units) is tried: one that fits clearly
better than the readings as they are names the fault.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from common.quaternion import Array, from_rotation_vector, multiply, rotate, to_matrix
from master.calibrate.carried import confusion, signed_permutations
from master.calibrate.evidence import CrossCheck, at_most, not_judged

WINDOW_S = 6.0
_BLOCKS = 3
"""A window's force is averaged over each third; their scatter is what counts."""
_THINNED_HZ = 50.0
_FEWEST_WINDOWS = 2
_MOST_WINDOWS = 60
WORST_SCATTER = 0.15
"""RMS scatter, as a share of gravity, beyond which both contradict each other. A person jogging scatters a
foot by 0.07, a simulated foot by 0.08."""
_BETTER = 0.75
"""Another guess must leave less than this share of the scatter to be the cause."""
_LEAST_GAIN = 0.004
"""And so much less of gravity: below that the unit hardly turned."""
_TOLD = 0.01
"""Scatter of a wrong guess from which on the motion tells the right one from it."""
_STEP_WINDOW_S = 3.0
WORST_STEP = 0.25
"""A jump of 15°. A real person reaches 0.22 as they sit down, the simulated one 0.16."""
_GRAVITY_M_S2 = 9.80665
_DEG = math.pi / 180.0
_UNITS = {_DEG: "°/s", 1e-3 * _DEG: "thousandths of °/s", 1.0 / _DEG: "radians that were converted twice"}


@dataclass(frozen=True, slots=True)
class GravityAgreement:
    """How the gyroscope and gravity agree, and what would explain it better."""

    scatter: float
    """RMS over the windows, as a share of gravity."""
    by_window: Array
    """(K,) of each window."""
    window_s: float
    step_s: float
    """From one window's begin to the next."""
    best: Array
    """(3, 3): the guess that fits best, times the readings; the identity where no other is clearly better."""
    best_scatter: float
    typical: float
    """Median scatter of all wrong guesses: near 0 where the unit hardly turned."""


def gyro_gravity(acc_m_s2: Array, gyr_rad_s: Array, rate_hz: float) -> GravityAgreement | None:
    """Compare over a recording (T, 3), its gaps bridged; None where it is too short."""
    thin = max(1, round(rate_hz / _THINNED_HZ))
    length = len(acc_m_s2) // thin * thin
    acc = acc_m_s2[:length].reshape(-1, thin, 3).mean(axis=1)
    gyr = gyr_rad_s[:length].reshape(-1, thin, 3).mean(axis=1)
    rate_hz /= thin
    samples = round(WINDOW_S * rate_hz / _BLOCKS) * _BLOCKS
    if len(acc) < (_FEWEST_WINDOWS + 1) * samples // 2:
        return None
    gyr = gyr - _bias(gyr, rate_hz)
    turning = np.linalg.norm(gyr, axis=1)
    gravity = float(np.median(np.linalg.norm(acc[turning <= np.quantile(turning, 0.1)], axis=1)))
    step = max(samples // 2, (len(acc) - samples) // _MOST_WINDOWS)
    first = np.arange(0, len(acc) - samples + 1, step)
    rows = first[:, None] + np.arange(samples)
    guesses = _guesses()
    by_window = _scatter(acc[rows] / max(gravity, 1e-9), gyr[rows] / rate_hz, guesses)
    scatter = np.sqrt(np.mean(by_window**2, axis=1))
    best = int(np.argmin(scatter))
    clearly = scatter[best] < _BETTER * scatter[0] and scatter[0] - scatter[best] > _LEAST_GAIN
    best = best if clearly else 0
    return GravityAgreement(
        float(scatter[0]),
        by_window[0],
        samples / rate_hz,
        step / rate_hz,
        guesses[best],
        float(scatter[best]),
        float(np.median(scatter[1:48])),
    )


def judge_agreement(found: GravityAgreement | None) -> list[CrossCheck]:
    """Units of the gyroscope first, then its axes, then whatever else makes both contradict each other."""
    of_unit, of_axes = "the gyroscope's unit, by gravity's turns", "the gyroscope's axes, by gravity's turns"
    if found is None:
        why = f"the recording is shorter than {1.5 * WINDOW_S:.0f} s"
        return [not_judged(of_axes, why)]
    if found.typical < _TOLD:
        return [not_judged(of_axes, "the unit hardly turned")]
    scale = float(np.abs(found.best).max())
    other_unit = not math.isclose(scale, 1.0)
    other_axes = not other_unit and bool(np.any(found.best != np.eye(3)))
    # another guess that is clearly better sets the limit by itself
    limit = found.best_scatter if other_unit or other_axes else WORST_SCATTER
    by = f"it scatters gravity by {found.scatter:.2f} g, and by {found.best_scatter:.2f} g otherwise"
    return [
        at_most(
            of_unit,
            found.scatter,
            limit if other_unit else max(found.scatter, WORST_SCATTER),
            "g",
            advice=f"its gyroscope seems to read {_unit(scale)}, expected rad/s ({by}); convert the "
            "recording to rad/s, or set the node's scale",
        ),
        at_most(
            of_axes,
            found.scatter,
            limit if other_axes else max(found.scatter, WORST_SCATTER),
            "g",
            advice=f"its gyroscope contradicts gravity: {describe(found.best)} ({by}); set the axes in the "
            "node's firmware or its DBC, and record again",
        ),
        at_most(
            "gyroscope against gravity",
            found.scatter,
            WORST_SCATTER,
            "g",
            advice="its gyroscope and its accelerometer do not show the same motion (gravity scatters by "
            f"{found.scatter:.2f} g, expected below {WORST_SCATTER:g} g): look whether the gyroscope is "
            "clipped, its bias wanders, or the unit slipped; then calibrate it (`tandem calibrate imu`)",
        ),
    ]


def slipped(acc_m_s2: Array, gyr_rad_s: Array, rate_hz: float) -> CrossCheck:
    """Whether gravity jumps where the gyroscope did not turn: the unit slipped, or something knocked it.

    The mean force of the seconds before an instant and after it, turned back by the gyroscope, differ by what
    it missed. A person who sits down differs by 0.2 g at most, for an instant.
    """
    compared = "gravity before and after each instant"
    thin = max(1, round(rate_hz / _THINNED_HZ))
    length = len(acc_m_s2) // thin * thin
    acc = acc_m_s2[:length].reshape(-1, thin, 3).mean(axis=1)
    gyr = gyr_rad_s[:length].reshape(-1, thin, 3).mean(axis=1)
    rate_hz /= thin
    half = round(_STEP_WINDOW_S * rate_hz)
    first = np.arange(0, len(acc) - 2 * half + 1, max(1, round(0.25 * rate_hz)))
    if not len(first):
        return not_judged(compared, f"the recording is shorter than {2.0 * _STEP_WINDOW_S:.0f} s")
    gyr = gyr - _bias(gyr, rate_hz)
    rows = first[:, None] + np.arange(2 * half)
    force, turn = acc[rows] / _GRAVITY_M_S2, gyr[rows] / rate_hz
    # tapered, so that a sudden movement at either end counts little
    weight = np.sin(np.pi * (np.arange(half) + 0.5) / half) ** 2
    weight = np.tile(weight / weight.sum(), 2)
    q = np.tile([1.0, 0.0, 0.0, 0.0], (len(first), 1))
    means = np.zeros((2, len(first), 3))
    for k in range(2 * half):
        step = from_rotation_vector(0.5 * turn[:, k])
        q = multiply(q, step)
        means[k // half] += weight[k] * rotate(q, force[:, k])
        q = multiply(q, step)
    apart = np.linalg.norm(means[1] - means[0], axis=1)
    worst = int(np.argmax(apart))
    at_s = (first[worst] + half) / rate_hz
    return at_most(
        compared,
        float(apart[worst]),
        WORST_STEP,
        "g",
        advice=f"at about {at_s:.0f} s gravity jumps in it by {apart[worst]:.2f} g without its gyroscope "
        "turning: it slipped, or was knocked. Fix it firmly on the segment, and record again",
    )


def describe(guess: Array) -> str:
    """In words, what a signed permutation (3, 3) times the readings would put right."""
    if np.array_equal(guess, -np.eye(3)):
        return "all its axes, or all the accelerometer's, are mirrored (a left-handed frame)"
    return confusion(guess)


def _bias(gyr: Array, rate_hz: float) -> Array:
    """What the gyroscope reads (3,) in the quietest second; 0 where it never rests."""
    width = max(2, round(rate_hz))
    second = gyr[: len(gyr) // width * width].reshape(-1, width, 3)
    spread = np.linalg.norm(second.std(axis=1), axis=1)
    quietest = int(np.argmin(spread))
    # in any unit: a person at rest sways a hundredth of what they move
    if spread[quietest] > 0.1 * float(np.median(np.linalg.norm(gyr, axis=1))):
        return np.zeros(3)
    return np.asarray(second[quietest].mean(axis=0))


def _unit(scale: float) -> str:
    return next((name for s, name in _UNITS.items() if math.isclose(s, scale)), f"{scale:g} × rad/s")


def _guesses() -> Array:
    """(G, 3, 3), the identity first, then the other signed permutations, then other units."""
    turns = signed_permutations()
    return np.array([*turns, *(_DEG * turns), 1e-3 * _DEG * np.eye(3), np.eye(3) / _DEG])


def _scatter(force: Array, turn_rad: Array, guesses: Array) -> Array:
    """(G, K) of windows (K, n, 3): how far each third's mean force is from one vector of length 1."""
    means = _mean_forces(force, turn_rad, guesses)
    mean = means.mean(axis=0)
    spread = np.mean(np.sum((means - mean) ** 2, axis=-1), axis=0)
    out: Array = np.sqrt(spread + (np.linalg.norm(mean, axis=-1) - 1.0) ** 2)
    return out


def _mean_forces(force: Array, turn_rad: Array, guesses: Array) -> Array:
    """(3, G, K, 3): the mean force of each third of each window, turned back by the guessed gyroscope.

    A guess is a rotation P times a factor u, which is negative for a mirror image. Turning by P u ω is P
    times turning by u ω times Pᵀ, so turns are summed up once for each factor, not for each of the guesses.
    """
    factors = np.sign(np.linalg.det(guesses)) * np.abs(guesses).max(axis=(1, 2))
    unlike, of_guess = np.unique(factors, return_inverse=True)
    rotations = guesses / factors[:, None, None]
    count, length = force.shape[:2]
    q = np.zeros((len(unlike), count, 4))
    q[..., 0] = 1.0
    # sums of R_ab f_c: with them P R Pᵀ f is known for each P
    sums = np.zeros((_BLOCKS, len(unlike), count, 3, 3, 3))
    for k in range(length):
        # the force is felt half-way through the sample's turn
        half = from_rotation_vector(0.5 * unlike[:, None, None] * turn_rad[:, k])
        q = multiply(q, half)
        sums[k * _BLOCKS // length] += to_matrix(q)[..., None] * force[:, k, None, None, :]
        q = multiply(q, half)
    means = np.empty((_BLOCKS, len(guesses), count, 3))
    for guess, (factor, rotation) in enumerate(zip(of_guess, rotations, strict=True)):
        means[:, guess] = np.einsum("tkabc,ia,cb->tki", sums[:, factor], rotation, rotation)
    means *= _BLOCKS / length
    return means
