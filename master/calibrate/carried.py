"""How a gyroscope's rates carry a direction that stands still in the room: gravity, or the earth's field.

Such a direction m, in the sensor's coordinates, obeys dm/dt = m × ω. Where the rates come in other axes,
another unit and with a bias, dm/dt = m × (A ω + b), which is linear in A and b: integrated over windows it
is one linear least-squares problem, whatever the motion, without orientations and without small angles. A is
the unit times a signed permutation where axes were confused. A magnetometer whose axes are turned or
mirrored by O reads O m, and then A = det(O) O: always a proper rotation, so only the gyroscope itself can
make A a mirror image. O and -O give the same A; the sign of the field's dip tells them apart.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations, product

import numpy as np

from common.quaternion import Array, cross

_WINDOW_S = 0.4
_FEWEST_WINDOWS = 20
_LEAST_TURN_RAD = 1.5
"""About each axis, root of the sum of squares over the windows; less tells nothing of that axis."""
_LEAST_EXPLAINED = 0.6
"""Of the direction's change, by the axes that fit best; below it the motion was too rough to tell."""
_CLEARLY_BETTER = 3.0
"""So many times less must the best axes leave unexplained than those that were delivered."""
AXES = "xyz"


def signed_permutations() -> Array:
    """The 48 matrices (48, 3, 3) that permute and negate axes, the identity first."""
    found = []
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            matrix = np.zeros((3, 3))
            matrix[np.arange(3), order] = signs
            found.append(matrix)
    return np.array(found)


_CANDIDATES = signed_permutations()


@dataclass(frozen=True, slots=True)
class Carried:
    """What the rates say about a direction, and the direction about the rates."""

    axes: Array
    """(3, 3), the signed permutation of the rates that fits best."""
    scale: float
    """By which the rates are to be multiplied, with those axes."""
    explained: float
    """Share of the direction's change that those axes and that scale explain, at most 1."""
    left_over: float
    """What the axes as delivered leave unexplained, over what the best ones leave; 1: they are the best."""
    matrix: Array
    """(3, 3), A by least squares."""
    explained_by_matrix: float
    """Share that A explains, at most 1."""
    signs_known: bool
    """Whether the best axes with any one of them negated would fit clearly worse."""

    @property
    def confused(self) -> bool:
        """Whether other axes than those delivered fit, clearly."""
        return self.explained > _LEAST_EXPLAINED and self.left_over > _CLEARLY_BETTER

    @property
    def known(self) -> bool:
        """Whether the data tell anything: axes that are turned by other than quarter turns count too."""
        return self.explained_by_matrix > _LEAST_EXPLAINED


def carried(direction: Array, rates: Array, rate_hz: float) -> Carried | None:
    """Compare a direction (T, 3), of any constant length, with rates (T, 3). NaN rows are left out.

    None where the sensor did not turn about all of its axes, or too little is there.
    """
    change, regressors, turned = _windows(direction, rates, rate_hz)
    if len(change) < _FEWEST_WINDOWS:
        return None
    # in the unit of the rates: a scale that turns the direction as far as it did turn
    size = float(np.median(np.linalg.norm(direction[np.isfinite(direction).all(axis=1)], axis=1)))
    if not size > 0.0 or not np.all(turned > 0.0) or not np.any(change):
        return None
    a = (regressors / size).reshape(-1, 12)
    y = (change / size).ravel()
    normal, right, whole = a.T @ a, a.T @ y, float(y @ y)
    scaling = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    solved = np.linalg.lstsq(normal / np.outer(scaling, scaling), right / scaling, rcond=1e-12)[0] / scaling
    costs, scales = np.array([_cost(p, normal, right, whole) for p in _CANDIDATES]).T
    best = int(np.argmin(costs))
    if np.any(np.abs(scales[best]) * turned < _LEAST_TURN_RAD):
        return None
    # what noise alone leaves: without it a perfect sensor would make any ratio
    floor = 1e-6 * whole
    return Carried(
        _CANDIDATES[best],
        float(scales[best]),
        1.0 - float(costs[best]) / whole,
        float((costs[0] + floor) / (costs[best] + floor)),
        solved[:9].reshape(3, 3),
        1.0 - float(whole - 2.0 * solved @ right + solved @ normal @ solved) / whole,
        all(
            _cost(_CANDIDATES[best] @ np.diag(signs), normal, right, whole)[0] + floor
            > _CLEARLY_BETTER * (costs[best] + floor)
            for signs in 1.0 - 2.0 * np.eye(3)
        ),
    )


def _windows(direction: Array, rates: Array, rate_hz: float) -> tuple[Array, Array, Array]:
    """Change of the direction (W, 3), its regressors (W, 3, 12), and the turn about each axis (3,)."""
    width = max(2, round(_WINDOW_S * rate_hz))
    count = (len(direction) - 1) // width
    middle, rate = 0.5 * (direction[1:] + direction[:-1]), 0.5 * (rates[1:] + rates[:-1])
    middle, rate = middle[: count * width], rate[: count * width]
    # m × (A ω + b): by A_ij it changes by (m × e_i) ω_j, by b_i by m × e_i
    by_axis = cross(middle[:, None, :], np.eye(3)[None])
    by_matrix = (by_axis[:, :, :, None] * rate[:, None, None, :]).transpose(0, 2, 1, 3).reshape(-1, 3, 9)
    both = np.concatenate([by_matrix, by_axis.transpose(0, 2, 1)], axis=2) / rate_hz
    regressors = both.reshape(count, width, 3, 12).sum(axis=1)
    change = direction[width : count * width + 1 : width] - direction[0 : count * width : width]
    whole = np.isfinite(regressors).all(axis=(1, 2)) & np.isfinite(change).all(axis=1)
    angle = rate.reshape(count, width, 3).sum(axis=1)[whole] / rate_hz
    turned: Array = np.sqrt(np.sum((angle - angle.mean(axis=0)) ** 2, axis=0)) if whole.any() else np.zeros(3)
    return change[whole], regressors[whole], turned


def _cost(axes: Array, normal: Array, right: Array, whole: float) -> tuple[float, float]:
    """Sum of squares left with A = scale · axes and the best bias, and that scale, which is not negative."""
    basis = np.zeros((12, 4))
    basis[:9, 0] = axes.ravel()
    basis[9:, 1:] = np.eye(3)
    inner, outer = basis.T @ normal @ basis, basis.T @ right
    weight = np.sqrt(np.maximum(np.diag(inner), 1e-300))
    x = np.linalg.lstsq(inner / np.outer(weight, weight), outer / weight, rcond=1e-12)[0] / weight
    if x[0] < 0.0:
        x = np.concatenate([[0.0], np.linalg.lstsq(inner[1:, 1:], outer[1:], rcond=None)[0]])
    return float(whole - 2.0 * x @ outer + x @ inner @ x), float(x[0])


def axes_text(axes: Array) -> str:
    """A signed permutation as a person writes it: `y,x,-z` where x is to be taken from the reading's y."""
    words = []
    for row in axes:
        place = int(np.argmax(np.abs(row)))
        words.append(f"{'-' if row[place] < 0.0 else ''}{AXES[place]}")
    return ",".join(words)


def confusion(axes: Array) -> str:
    """What was done to axes that such a matrix puts right: "its x axis is negated"."""
    place = np.argmax(np.abs(axes), axis=1)
    signs = axes[np.arange(3), place]
    moved = [AXES[i] for i in range(3) if place[i] != i]
    negated = [AXES[i] for i in range(3) if signs[i] < 0.0]
    words = []
    if len(moved) == 2:
        words.append(f"its {moved[0]} and {moved[1]} axes are swapped")
    elif moved:
        words.append("its three axes are rotated in order")
    if negated and words:
        words.append(f"{' and '.join(negated)} negated")
    elif negated:
        words.append(f"its {' and '.join(negated)} {'axis is' if len(negated) == 1 else 'axes are'} negated")
    return ", ".join(words) or "its axes are as they should be"
