"""A hinge's axis in the frames of the two units on either side of it, from their rotation rates (paper C).

Whatever the limb as a whole does, both units share the part of the rotation that is not about the hinge: at
every instant ‖g1 × j1‖ = ‖g2 × j2‖ (Seel, Schauer and Raisch 2012, Eq. 3; Seel, Raisch and Schauer 2014,
Eq. 1). j1 and j2 are the unit vectors that come nearest to it over all samples. Each is found up to its sign.

The axes by all readings (`joint_fit.py`) should agree with these. There the rates are those that neighbours
share, low-passed in the earth frame (`oriented.py`): as the sensors read them, skin that shakes under a thigh
turns the axes from the rates alone by 80°. What both are apart widens the stated uncertainty, and beyond a
limit it refuses the answer.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace

import numpy as np

from common.errors import TandemError
from common.quaternion import Array
from master.calibrate.evidence import CrossCheck, at_most, not_judged
from master.calibrate.gauss_newton import Minimum, along_sphere, gauss_newton, half_sphere, tangents
from master.calibrate.joint_fit import JointFit
from master.calibrate.joint_residuals import Moving

_STARTS = 6
"""Directions tried for each of the two axes: 36 starts."""
_COARSE = 400
"""Samples that the starts are tried on; the best go on to all."""
_REFINED = 4
_BLUR_RAD_S = 0.02
"""Keeps the residual smooth where a rate points along an axis; below a gyro's noise it changes nothing."""
_ALIKE_RAD = math.radians(20.0)
"""Two answers nearer than that to each other are one."""

_GAIN_RAD = math.radians(0.2)
"""What a calibrated gyro's gains and cross-axis errors (0.2 %) turn an axis by, whatever the data."""
_LEAST_RATE_RAD_S = 0.3
"""RMS rate of bending below which the joint counts as not moved."""
_WORST_SIGMA_RAD = math.radians(4.0)
_WORST_RIVAL = 1.3
"""Another answer with less than so many times the cost leaves it open which one is right."""
_WORST_MISFIT = 0.5
"""Misfit as a share of the bending: a knee's is 0.1 to 0.3; a joint that turns every way is near 1."""


WORST_APART_RAD = math.radians(30.0)
"""A real person's thigh, the worst segment for skin, is 13 to 28° apart; a simulated one 0.2°."""
_SHARE = 1.0 / 3.0
"""Of what both ways are apart, one standard deviation of either."""


class PoorMotionError(TandemError):
    """The motion recorded does not tell what was asked; the text says which motion would."""


@dataclass(frozen=True, slots=True)
class HingeAxes:
    """What was found of a hinge, and how well it is known."""

    axis1: Array
    """(3,) unit vector in the first unit's frame."""
    axis2: Array
    """(3,) in the second unit's."""
    sigma1_rad: float
    """One standard deviation of `axis1`'s direction, the worse way across it."""
    sigma2_rad: float
    condition: float
    """Largest over smallest eigenvalue of JᵀJ: near 1 when the motion tells all four unknowns alike."""
    misfit_rad_s: float
    """RMS of ‖g1 × j1‖ − ‖g2 × j2‖."""
    bending_rad_s: float
    """RMS of the rate about the hinge, g1·j1 − g2·j2, whichever relative sign makes it smaller."""
    rival: float
    """Cost of the best quite different answer, in units of this one's: 1 is a tie."""


Axes = tuple[Array, Array]


def find_hinge(gyr1_rad_s: Array, gyr2_rad_s: Array, rate_hz: float) -> HingeAxes:
    """Gauss-Newton from several starts over rates (T, 3) of two units in their own frames.

    Rows with NaN are left out. Whether the answer can be trusted is for `check` to say.
    Raises PoorMotionError where there is not a second of data.
    """
    sound = np.isfinite(gyr1_rad_s).all(axis=1) & np.isfinite(gyr2_rad_s).all(axis=1)
    gyr1, gyr2 = gyr1_rad_s[sound], gyr2_rad_s[sound]
    if len(gyr1) < max(rate_hz, 20.0):
        raise PoorMotionError("less than a second of rates of both units: record 20 s of bending the joint")
    best, rival = _descend(gyr1, gyr2)
    axis1, axis2 = best.state
    misfit = math.sqrt(2.0 * best.cost / len(gyr1))
    # neighbouring samples of a band-limited misfit do not count as independent
    independent = max(len(gyr1) / max(rate_hz / 10.0, 1.0), 5.0)
    eigenvalues = np.linalg.eigvalsh(best.normal).astype(np.float64)
    variance = misfit**2 * len(gyr1) / independent
    covariance = variance * np.linalg.pinv(best.normal, rcond=1e-14).astype(np.float64)
    about1, about2 = gyr1 @ axis1, gyr2 @ axis2
    bending = min(float(np.mean((about1 - sign * about2) ** 2)) for sign in (1.0, -1.0))
    return HingeAxes(
        axis1,
        axis2,
        _sigma(covariance[:2, :2], eigenvalues),
        _sigma(covariance[2:, 2:], eigenvalues),
        float(eigenvalues[-1] / max(eigenvalues[0], 1e-300)),
        misfit,
        math.sqrt(bending),
        rival / best.cost if best.cost > 0.0 else math.inf,
    )


def check(hinge: HingeAxes, joint: str) -> None:
    """Raise PoorMotionError where the hinge cannot be trusted, saying what to do."""
    check_moved(hinge, joint)
    sigma = max(hinge.sigma1_rad, hinge.sigma2_rad)
    if sigma > _WORST_SIGMA_RAD:
        raise PoorMotionError(
            f"{joint}: its axis is only known to ± {math.degrees(sigma):.0f}°; {again(joint)}"
        )
    if hinge.rival < _WORST_RIVAL:
        raise PoorMotionError(f"{joint}: a quite different axis explains the motion as well; {again(joint)}")


def check_moved(hinge: HingeAxes, joint: str) -> None:
    """Raise PoorMotionError where the joint was not moved, or does not move like a hinge."""
    if hinge.bending_rad_s < _LEAST_RATE_RAD_S:
        raise PoorMotionError(
            f"{joint}: it was hardly bent ({math.degrees(hinge.bending_rad_s):.0f}°/s RMS, "
            f"{math.degrees(_LEAST_RATE_RAD_S):.0f} needed); {again(joint)}"
        )
    if hinge.misfit_rad_s > _WORST_MISFIT * hinge.bending_rad_s:
        raise PoorMotionError(
            f"{joint}: the two units do not move as on a hinge (misfit "
            f"{hinge.misfit_rad_s / hinge.bending_rad_s:.0%} of the bending); are they on the two segments "
            f"of this joint, and fixed? Then {again(joint)}"
        )


def again(joint: str) -> str:
    """What to do about poor motion."""
    return f"record again: bend {joint} ten times through its range while the whole limb moves about"


def check_rates(
    fit: JointFit, parent: Moving, child: Moving, spacing_s: float
) -> tuple[JointFit, CrossCheck]:
    """The answer with its uncertainty widened by what the rates alone say, and the comparison itself."""
    compared = "the hinge's axes against the rates alone"
    assert fit.axes is not None
    try:
        found = find_hinge(_in_sensor(parent), _in_sensor(child), 1.0 / spacing_s)
        check(found, "the joint")
    except PoorMotionError as error:
        return fit, not_judged(compared, f"the rotation rates alone do not decide: {error}")
    apart = [_angle(a, b) for a, b in zip((found.axis1, found.axis2), fit.axes, strict=True)]
    sigma = (
        max(fit.axis_sigma_rad[0], _SHARE * apart[0]),
        max(fit.axis_sigma_rad[1], _SHARE * apart[1]),
    )
    evidence = at_most(
        compared,
        math.degrees(max(apart)),
        math.degrees(WORST_APART_RAD),
        "°",
        advice=f"its axes by all readings are {math.degrees(max(apart)):.0f}° from those by the rates alone: "
        "one of the two units is loose, clipped or on another segment. Fix both, and record ten slow bends "
        "through the whole range",
    )
    return replace(fit, axis_sigma_rad=sigma), evidence


def _in_sensor(unit: Moving) -> Array:
    """The shared rates (K, 3) in the sensor's own frame."""
    out: Array = np.einsum("kji,kj->ki", unit.r, unit.rate)
    return out


def residuals(gyr1: Array, gyr2: Array, axis1: Array, axis2: Array) -> tuple[Array, Array]:
    """‖g1 × j1‖ − ‖g2 × j2‖ (T,), and its Jacobian (T, 4) along both axes' `tangents`.

    ∂‖g × j‖/∂j = ((g × j) × g) / ‖g × j‖ (Seel et al. 2014, Eq. 3).
    """
    across1, slope1 = _across(gyr1, axis1)
    across2, slope2 = _across(gyr2, axis2)
    return across1 - across2, np.concatenate([slope1, -slope2], axis=1)


def _across(gyr: Array, axis: Array) -> tuple[Array, Array]:
    """‖g × j‖ (T,), and its slopes along the tangents (T, 2)."""
    along = gyr @ axis
    squared = np.einsum("ti,ti->t", gyr, gyr) - along**2
    across = np.sqrt(np.maximum(squared, 0.0) + _BLUR_RAD_S**2)
    # (g × j) × g = j ‖g‖² − g (g·j), and of that only what touches the sphere
    slope = -(along / across)[:, None] * (gyr @ tangents(axis))
    return across, slope


def _descend(gyr1: Array, gyr2: Array) -> tuple[Minimum[Axes], float]:
    """The best answer over all samples, and the cost of the best quite different one."""
    rate = np.linalg.norm(gyr1, axis=1) + np.linalg.norm(gyr2, axis=1)
    # instants that tell most: a still limb tells nothing
    moving = np.flatnonzero(rate >= np.quantile(rate, 0.25))
    some = moving[:: max(1, len(moving) // _COARSE)]
    tried = [
        _minimum(gyr1[some], gyr2[some], start, most_steps=15)
        for start in itertools.product(half_sphere(_STARTS), repeat=2)
    ]
    different: list[Minimum[Axes]] = []
    for minimum in sorted(tried, key=lambda m: m.cost):
        if all(_apart(minimum.state, other.state) > _ALIKE_RAD for other in different):
            different.append(minimum)
    refined = [_minimum(gyr1, gyr2, minimum.state) for minimum in different[:_REFINED]]
    refined.sort(key=lambda m: m.cost)
    best = refined[0]
    rivals = [m.cost for m in refined[1:] if _apart(m.state, best.state) > _ALIKE_RAD]
    return best, min(rivals, default=math.inf)


def _minimum(gyr1: Array, gyr2: Array, start: Axes, most_steps: int = 50) -> Minimum[Axes]:
    return gauss_newton(
        lambda axes: residuals(gyr1, gyr2, *axes),
        lambda axes, x: (along_sphere(axes[0], x[:2]), along_sphere(axes[1], x[2:])),
        start,
        most_steps=most_steps,
    )


def _apart(one: Axes, other: Axes) -> float:
    """The larger of the two axes' angles, whatever their signs."""
    return max(_angle(a, b) for a, b in zip(one, other, strict=True))


def _angle(one: Array, other: Array) -> float:
    return math.acos(min(1.0, abs(float(one @ other))))


def _sigma(covariance: Array, eigenvalues: Array) -> float:
    """Direction's standard deviation; π where the data leave it open altogether."""
    if eigenvalues[0] <= 1e-12 * eigenvalues[-1]:
        return math.pi
    return min(math.pi, math.hypot(_GAIN_RAD, math.sqrt(max(0.0, float(np.linalg.eigvalsh(covariance)[-1])))))
