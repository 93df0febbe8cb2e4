"""The nearest rotation that three joint angles within their limits can make, in closed form.

A rotation made of turns by a, b and c about the x, y and z axis, one after another, is the unit quaternion
qx(a) qy(b) qz(c). Its angle to a wanted rotation q is 2 acos |f| with the scalar product

    f(a, b, c) = ⟨qx(a) qy(b) qz(c), q⟩,

which is linear in (cos a/2, sin a/2), in (cos b/2, sin b/2) and in (cos c/2, sin c/2): eight numbers
T[i, j, k] say it all. So the best value of one angle is an atan2, those of two angles are a sum and a
difference of two atan2, and those of three are the decomposition itself. Elsewhere f has only saddles and
minima. The nearest rotation within limits therefore either touches no limit or has an angle at a limit, of
which the same holds again: trying the limits in the order of what they can give at best finds it for certain,
without iterations.
"""

from __future__ import annotations

import math
from typing import NamedTuple

Tensor = tuple[float, float, float, float, float, float, float, float]
"""T[i, j, k] at 4 i + 2 j + k: i, j and k are 1 for the sine of a half angle, 0 for its cosine."""
Square = tuple[float, float, float, float]
"""The same of two angles."""
Triple = tuple[float, float, float]

TURN = 2.0 * math.pi
_SLACK_RAD = 1e-9
"""An angle beyond its limit by less than this stands at it."""


class Limit(NamedTuple):
    """An end of an angle's range, with the cosine and the sine of its half."""

    rad: float
    cosine: float
    sine: float


class Range(NamedTuple):
    """What an angle may be. One whose ends are equal is fixed; infinite ends are none."""

    lower: Limit
    upper: Limit
    ends: tuple[Limit, ...]
    """Those of the two that are finite."""

    @property
    def fixed(self) -> bool:
        """Whether there is only one value."""
        return self.lower.rad == self.upper.rad


Ranges = tuple[Range, Range, Range]


def angle_range(lower_rad: float, upper_rad: float) -> Range:
    """An angle's range, rad."""
    lower, upper = _limit(lower_rad), _limit(upper_rad)
    return Range(lower, upper, tuple(end for end in (lower, upper) if math.isfinite(end.rad)))


def _limit(rad: float) -> Limit:
    half = 0.5 * rad if math.isfinite(rad) else 0.0
    return Limit(rad, math.cos(half), math.sin(half))


class Nearest(NamedTuple):
    """Angles, rad, and |f|: the cosine of half the angle that is left between the two rotations."""

    angles: Triple
    cosine: float

    @property
    def left_rad(self) -> float:
        """The angle that is left, rad."""
        return left_rad(self.cosine)


NOTHING = Nearest((0.0, 0.0, 0.0), -1.0)
"""Anything is nearer."""


def left_rad(cosine: float) -> float:
    """The angle between two rotations, rad, from the cosine of its half."""
    return 2.0 * math.acos(min(abs(cosine), 1.0))


def tensor(w: float, x: float, y: float, z: float) -> Tensor:
    """T of the wanted rotation (w, x, y, z)."""
    return (w, z, y, x, x, -y, z, -w)


def scalar_product(t: Tensor, angles: Triple) -> float:
    """The scalar product f of those angles."""
    half = 0.5 * angles[0]
    m = _without(t, 0, Limit(angles[0], math.cos(half), math.sin(half)))
    c, s = math.cos(0.5 * angles[2]), math.sin(0.5 * angles[2])
    over, under = c * m[2] + s * m[3], c * m[0] + s * m[1]
    return math.cos(0.5 * angles[1]) * under + math.sin(0.5 * angles[1]) * over


def decompositions(t: Tensor) -> tuple[Triple, Triple]:
    """The two triples of angles that make the wanted rotation exactly; at the pole two of very many."""
    w, z, y, x = t[0], t[1], t[2], t[3]
    half_sum, half_difference = math.atan2(x + z, w + y), math.atan2(x - z, w - y)
    a, c = half_sum + half_difference, half_sum - half_difference
    b = 2.0 * math.atan2(math.hypot(w + y, x + z), math.hypot(w - y, x - z)) - 0.5 * math.pi
    return (a, b, c), (a + math.pi, math.pi - b, c + math.pi)


class Box(NamedTuple):
    """What three angles may be together. Make one with `box`."""

    ranges: Ranges
    free: tuple[int, ...]
    """Those that are not fixed."""
    fixed: int
    """The first that is; -1 where none is."""
    twofold: bool
    """Whether more than one triple within the ranges may make the same rotation."""


def box(one: Range, two: Range, three: Range) -> Box:
    """The ranges of three angles."""
    ranges = (one, two, three)
    free = tuple(k for k in range(3) if not ranges[k].fixed)
    fixed = next((k for k in range(3) if k not in free), -1)
    past_the_pole = len(free) == 3 and max(-two.lower.rad, two.upper.rad) > 0.5 * math.pi
    # without ends it is a heading, which nobody unwraps
    whole_turn = any(TURN <= r.upper.rad - r.lower.rad < math.inf for r in ranges)
    return Box(ranges, free, fixed, past_the_pole or whole_turn)


def nearest_angles(
    t: Tensor, within: Box, towards: Triple, inside: bool = True, known: Nearest = NOTHING
) -> Nearest:
    """The angles within their ranges whose rotation is the nearest to the wanted one.

    `towards` lies within the ranges, and decides between equals: of angles that differ by whole turns, and of
    two exact decompositions, those that are nearer to it are taken. `inside` may be False where it is known
    that no three angles within the ranges make the wanted rotation exactly: that saves looking for them. So
    does a `known` triple within the ranges, where it is near already.
    """
    ranges, free, k, _ = within
    if k < 0:
        exact = _exact(t, ranges, towards) if inside else None
        return exact or _at_a_limit(t, ranges, towards, known)
    if not free:
        angles = (ranges[0].lower.rad, ranges[1].lower.rad, ranges[2].lower.rad)
        return Nearest(angles, abs(scalar_product(t, angles)))
    first, second = _OTHERS[k]
    rest = _without(t, k, ranges[k].lower)
    if len(free) == 2:
        found = _two(rest, ranges[first], ranges[second], towards[first], towards[second], -1.0)
        return Nearest(_placed(k, ranges[k].lower.rad, found[0], found[1]), found[2])
    of_first = second == free[0]
    at = ranges[first if of_first else second].lower
    angle, cosine = _one(*_less(rest, of_first, at), ranges[free[0]], towards[free[0]])
    one, two = (at.rad, angle) if of_first else (angle, at.rad)
    return Nearest(_placed(k, ranges[k].lower.rad, one, two), cosine)


_OTHERS = ((1, 2), (0, 2), (0, 1))


def _placed(k: int, fixed: float, first: float, second: float) -> Triple:
    if k == 0:
        return (fixed, first, second)
    return (first, fixed, second) if k == 1 else (first, second, fixed)


def _exact(t: Tensor, ranges: Ranges, towards: Triple) -> Nearest | None:
    """The decomposition within the ranges that is nearer to `towards`, if there is one."""
    found: Nearest | None = None
    least = math.inf
    for angles in decompositions(t):
        one, two, three = (into(angles[k], ranges[k], towards[k]) for k in range(3))
        if one is None or two is None or three is None:
            continue
        way = max(abs(one - towards[0]), abs(two - towards[1]), abs(three - towards[2]))
        if way < least:
            found, least = Nearest((one, two, three), 1.0), way
    return found


def _at_a_limit(t: Tensor, ranges: Ranges, towards: Triple, known: Nearest) -> Nearest:
    """Three angles, at least one of them at a limit; those that are known unless there are nearer ones."""
    faces = []
    for k in range(3):
        for end in ranges[k].ends:
            rest = _without(t, k, end)
            faces.append((-_most(rest), k, end, rest))
    faces.sort()
    best, most = known
    for bound, k, end, rest in faces:
        if -bound <= most:
            break
        first, second = _OTHERS[k]
        one, two, cosine = _two(rest, ranges[first], ranges[second], towards[first], towards[second], most)
        if cosine > most:
            best, most = _placed(k, end.rad, one, two), cosine
    return Nearest(best, most)


def into(angle: float, allowed: Range, towards: float) -> float | None:
    """The angle plus whole turns, within its range and near `towards`, which is in it; None: none is."""
    angle -= TURN * round((angle - towards) / TURN)
    lower, upper = allowed.lower.rad, allowed.upper.rad
    if lower <= angle <= upper:
        return angle
    if angle < lower:
        if angle >= lower - _SLACK_RAD:
            return lower
        angle += TURN
        return angle if angle <= upper else None
    if angle <= upper + _SLACK_RAD:
        return upper
    angle -= TURN
    return angle if angle >= lower else None


def _without(t: Tensor, k: int, at: Limit) -> Square:
    """What is left of T with angle k fixed."""
    _, c, s = at
    t0, t1, t2, t3, t4, t5, t6, t7 = t
    if k == 0:
        return (c * t0 + s * t4, c * t1 + s * t5, c * t2 + s * t6, c * t3 + s * t7)
    if k == 1:
        return (c * t0 + s * t2, c * t1 + s * t3, c * t4 + s * t6, c * t5 + s * t7)
    return (c * t0 + s * t1, c * t2 + s * t3, c * t4 + s * t5, c * t6 + s * t7)


def _most(m: Square) -> float:
    """The greatest |f| of two free angles: the larger singular value."""
    return 0.5 * (math.hypot(m[0] + m[3], m[2] - m[1]) + math.hypot(m[0] - m[3], m[2] + m[1]))


def _two(
    m: Square, first: Range, second: Range, towards_first: float, towards_second: float, least: float
) -> tuple[float, float, float]:
    """Two angles within their ranges, and |f|; only an |f| above `least` is of interest."""
    half_sum = math.atan2(m[2] + m[1], m[0] - m[3])
    half_difference = math.atan2(m[2] - m[1], m[0] + m[3])
    one = into(half_sum + half_difference, first, towards_first)
    if one is not None:
        two = into(half_sum - half_difference, second, towards_second)
        if two is not None:
            return one, two, _most(m)
    best = (towards_first, towards_second)
    for end in first.ends:
        over, under = _less(m, True, end)
        if math.hypot(over, under) > least:
            angle, cosine = _one(over, under, second, towards_second)
            if cosine > least:
                best, least = (end.rad, angle), cosine
    for end in second.ends:
        over, under = _less(m, False, end)
        if math.hypot(over, under) > least:
            angle, cosine = _one(over, under, first, towards_first)
            if cosine > least:
                best, least = (angle, end.rad), cosine
    return best[0], best[1], least


def _less(m: Square, of_first: bool, at: Limit) -> tuple[float, float]:
    """What is left of two angles with one of them fixed."""
    _, c, s = at
    if of_first:
        return c * m[0] + s * m[2], c * m[1] + s * m[3]
    return c * m[0] + s * m[1], c * m[2] + s * m[3]


def _one(cosine: float, sine: float, allowed: Range, towards: float) -> tuple[float, float]:
    """One angle within its range, and |f|, of f = `cosine` cos a/2 + `sine` sin a/2."""
    angle = into(2.0 * math.atan2(sine, cosine), allowed, towards)
    if angle is not None:
        return angle, math.hypot(cosine, sine)
    # |f| falls the farther one goes round the circle from its greatest: the nearer limit it is
    (low, c0, s0), (high, c1, s1), _ = allowed
    at_low, at_high = abs(cosine * c0 + sine * s0), abs(cosine * c1 + sine * s1)
    if at_low > at_high or (at_low == at_high and towards < 0.5 * (low + high)):
        return low, at_low
    return high, at_high
