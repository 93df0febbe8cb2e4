"""Of the postures that a group of joints may take, which one: the nearest, or one that needs less turning.

The nearest posture can lie far from the last one although the operator hardly moved: it is not always taken.
"""

from __future__ import annotations

import math

from common.reach.chart import JointGroup
from common.reach.nearest import Nearest, Range, Tensor, Triple, left_rad, scalar_product

MOST_GAIN = 3.0
"""No joint turns faster than this times the operator's segment."""
BESIDE_POLE_RAD = math.acos(1.0 / MOST_GAIN)
"""From this middle angle on (70.5°) joints may have to turn `MOST_GAIN` times as fast as the segment."""
SAME_RAD = math.radians(0.1)
TURN = 2.0 * math.pi
_KEPT_RAD = math.radians(15.0)
"""The kept decomposition, clamped, may be farther from the operator by this than the nearest posture,"""
_KEPT_SHARE = 4.0
"""and by this times the angle that the nearest one leaves: what can be reached, is."""
_NEAR_RAD, _FAR_RAD = math.radians(15.0), math.radians(30.0)
"""A nearest posture whose joints are within the first of the kept one's is taken, beyond the second never."""
_IDLE_RAD, _WORTH_RAD = math.radians(1.0), math.radians(4.0)
"""Beyond a limit beside the pole, turning that gains the first is not done, and the second at once."""


def kept_decomposition(exact: Triple, group: JointGroup, last: Triple) -> Triple:
    """Of the two decompositions, of which `exact` is one, the one nearer to the last angles: clamped."""
    kept, least = last, math.inf
    x, y, z = last
    one, two, three = group.box.ranges
    for a, b, c in (exact, (exact[0] + math.pi, math.pi - exact[1], exact[2] + math.pi)):
        # unwrapped: of whole turns the one nearest to the last posture
        a -= TURN * round((a - x) / TURN)
        b -= TURN * round((b - y) / TURN)
        c -= TURN * round((c - z) / TURN)
        way = max(abs(a - x), abs(b - y), abs(c - z))
        if way < least:
            kept, least = (_clamped(a, one), _clamped(b, two), _clamped(c, three)), way
    return kept


def choose(wanted: Tensor, nearest: Nearest, kept: Nearest) -> Nearest:
    """The nearest posture, or the kept one where much turning would gain little."""
    left = nearest.left_rad
    if left < SAME_RAD or kept.left_rad > left + min(_KEPT_SHARE * left, _KEPT_RAD):
        return nearest
    (a, b, c), (x, y, z) = kept.angles, nearest.angles
    apart = max(abs(a - x), abs(b - y), abs(c - z))
    if apart >= _FAR_RAD:
        return kept
    share = min((_FAR_RAD - apart) / (_FAR_RAD - _NEAR_RAD), 1.0)
    angles = (a + share * (x - a), b + share * (y - b), c + share * (z - c))
    return Nearest(angles, abs(scalar_product(wanted, angles)))


def worth_turning(wanted: Tensor, group: JointGroup, aim: Nearest, last: Triple) -> Nearest:
    """Towards `aim`, along the pole's valley only as far as that gains.

    At a middle angle of ±90° the first and the third turn about one axis: while their sum (at -90° their
    difference) is kept, turning them changes nothing, and close by next to nothing. What passes by the pole
    beyond a limit would otherwise fling them about.
    """
    (a, b, c), x = aim.angles, last[0]
    if aim.left_rad < SAME_RAD or abs(b) < BESIDE_POLE_RAD:
        return aim
    stay = (x, b, _clamped(a + c - x if b > 0.0 else c - a + x, group.box.ranges[2]))
    gain = left_rad(scalar_product(wanted, stay)) - aim.left_rad
    share = min(max((gain - _IDLE_RAD) / (_WORTH_RAD - _IDLE_RAD), 0.0), 1.0)
    if share == 1.0:
        return aim
    z = stay[2]
    angles = (x + share * (a - x), b, z + share * (c - z))
    return Nearest(angles, abs(scalar_product(wanted, angles)))


def _clamped(angle: float, allowed: Range) -> float:
    return min(max(angle, allowed.lower.rad), allowed.upper.rad)
