"""Which parts of the robot can meet which: found from the table, not written by hand.

Parts that hang together cannot be kept apart, and the parts of a hand are made to close on each other. So the
capsules are gathered into groups: a whole limb end that is no longer than a hand, else a segment by itself.
A robot's own links are grouped by the segment of the operator that they follow: the three of a shoulder, say.
Pairs within a group, and between a group and the one that carries it, are left out. All other pairs remain,
also those far apart: MuJoCo's own broad phase skips them at 20 ns each.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from common.skeleton import WORLD, Skeleton
from slave.model.capsules import capsules, links

HAND_M = 0.25
"""A limb end whose farthest point is never further than this from its joint is one group."""


def groups(skeleton: Skeleton) -> Sequence[str]:
    """For every body of the robot, the name of the one that its group hangs on."""
    if skeleton.own_links:
        return _by_segment(skeleton)
    reach = _reach_m(skeleton)
    group: dict[str, str] = {}
    for segment in links(skeleton):
        above = group.get(segment.parent)
        # parents come first: the group of one that is short enough takes in all below it
        one_with_it = above is not None and reach[above] <= HAND_M
        group[segment.name] = above if above is not None and one_with_it else segment.name
    return [group[link.name] for link in links(skeleton)]


def _by_segment(skeleton: Skeleton) -> Sequence[str]:
    """A link belongs to the segment that it leads to; if to several, to itself; if to none, as its parent."""
    follower = {segment.link: segment.name for segment in skeleton.segments if segment.link}
    below: dict[str, set[str]] = {link.name: set() for link in skeleton.own_links}
    for link in reversed(skeleton.own_links):
        if link.name in follower:
            below[link.name] = {follower[link.name]}
        below.setdefault(link.parent, set()).update(below[link.name])
    owner: dict[str, str] = {}
    first: dict[str, str] = {}
    for link in skeleton.own_links:
        leads_to = below[link.name]
        own = next(iter(leads_to)) if len(leads_to) == 1 else owner.get(link.parent, link.name)
        owner[link.name] = link.name if len(leads_to) > 1 else own
        first.setdefault(owner[link.name], link.name)
    return [first[owner[link.name]] for link in skeleton.own_links]


def _reach_m(skeleton: Skeleton) -> dict[str, float]:
    """How far from each segment's joint anything that hangs on it can be."""
    bodies = links(skeleton)
    reach = {body.name: 0.0 for body in bodies}
    for capsule in capsules(skeleton):
        name = bodies[capsule.segment].name
        reach[name] = max(reach[name], float(np.linalg.norm(capsule.to_m)))
    for segment in reversed(bodies):
        if segment.parent != WORLD:
            further = float(np.linalg.norm(segment.origin_m)) + reach[segment.name]
            reach[segment.parent] = max(reach[segment.parent], further)
    return reach


def pairs(skeleton: Skeleton) -> list[tuple[int, int]]:
    """Capsules, by their place in `capsules(skeleton)`, that must be kept apart."""
    group = groups(skeleton)
    carrier = dict(zip(group, _carriers(skeleton, group), strict=True))
    shapes = [group[capsule.segment] for capsule in capsules(skeleton)]
    moved = _moved(skeleton)
    free = [moved[capsule.segment] for capsule in capsules(skeleton)]
    return [
        (a, b)
        for a, b in itertools.combinations(range(len(shapes)), 2)
        if shapes[a] != shapes[b] and carrier[shapes[a]] != shapes[b] and carrier[shapes[b]] != shapes[a]
        # two that no joint moves stay as far apart as they are
        if free[a] or free[b]
    ]


def _moved(skeleton: Skeleton) -> Sequence[bool]:
    """For every body, whether a joint moves it."""
    driven = {hinge for joint in skeleton.joints for hinge in joint.moves}
    moved = {WORLD: False}
    for body in links(skeleton):
        moved[body.name] = moved[body.parent] or any(hinge.name in driven for hinge in body.hinges)
    return [moved[body.name] for body in links(skeleton)]


def moving(skeleton: Skeleton) -> list[int]:
    """Capsules that can meet what is fixed to the base: all but those of the groups that hang on it."""
    group = groups(skeleton)
    carrier = dict(zip(group, _carriers(skeleton, group), strict=True))
    return [i for i, c in enumerate(capsules(skeleton)) if carrier[group[c.segment]] != WORLD]


def _carriers(skeleton: Skeleton, group: Sequence[str]) -> list[str]:
    """For every body, the group that carries its own."""
    bodies = links(skeleton)
    of = {body.name: own for body, own in zip(bodies, group, strict=True)}
    parent = {body.name: body.parent for body in bodies}
    return [of.get(parent[root], WORLD) for root in group]
