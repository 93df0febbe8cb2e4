"""Which parts of the robot can meet which: found from the table, not written by hand.

Parts that hang together cannot be kept apart, and the parts of a hand are made to close on each other. So the
capsules are gathered into groups: a whole limb end that is no longer than a hand, else a segment by itself.
Pairs within a group, and between a group and the one that carries it, are left out. All other pairs remain,
also those far apart: MuJoCo's own broad phase skips them at 20 ns each.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from common.skeleton import WORLD, Skeleton
from slave.model.capsules import capsules

HAND_M = 0.25
"""A limb end whose farthest point is never further than this from its joint is one group."""


def groups(skeleton: Skeleton) -> Sequence[str]:
    """For every segment, the name of the segment that its group hangs on."""
    reach = _reach_m(skeleton)
    group: dict[str, str] = {}
    for segment in skeleton.segments:
        above = group.get(segment.parent)
        # parents come first: the group of one that is short enough takes in all below it
        one_with_it = above is not None and reach[above] <= HAND_M
        group[segment.name] = above if above is not None and one_with_it else segment.name
    return [group[name] for name in skeleton.segment_names]


def _reach_m(skeleton: Skeleton) -> dict[str, float]:
    """How far from each segment's joint anything that hangs on it can be."""
    reach = dict.fromkeys(skeleton.segment_names, 0.0)
    for capsule in capsules(skeleton):
        name = skeleton.segment_names[capsule.segment]
        reach[name] = max(reach[name], float(np.linalg.norm(capsule.to_m)))
    for segment in reversed(skeleton.segments):
        if segment.parent != WORLD:
            further = float(np.linalg.norm(segment.origin_m)) + reach[segment.name]
            reach[segment.parent] = max(reach[segment.parent], further)
    return reach


def pairs(skeleton: Skeleton) -> list[tuple[int, int]]:
    """Capsules, by their place in `capsules(skeleton)`, that must be kept apart."""
    group = groups(skeleton)
    carrier = dict(zip(group, _carriers(skeleton, group), strict=True))
    shapes = [group[capsule.segment] for capsule in capsules(skeleton)]
    return [
        (a, b)
        for a, b in itertools.combinations(range(len(shapes)), 2)
        if shapes[a] != shapes[b] and carrier[shapes[a]] != shapes[b] and carrier[shapes[b]] != shapes[a]
    ]


def moving(skeleton: Skeleton) -> list[int]:
    """Capsules that can meet what is fixed to the base: all but those of the groups that hang on it."""
    group = groups(skeleton)
    carrier = dict(zip(group, _carriers(skeleton, group), strict=True))
    return [i for i, c in enumerate(capsules(skeleton)) if carrier[group[c.segment]] != WORLD]


def _carriers(skeleton: Skeleton, group: Sequence[str]) -> list[str]:
    """For every segment, the group that carries its own."""
    of = dict(zip(skeleton.segment_names, group, strict=True))
    parent = {segment.name: segment.parent for segment in skeleton.segments}
    return [of.get(parent[root], WORLD) for root in group]
