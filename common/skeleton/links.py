"""How a robot's own links turn with the operator's segments: its joints as rotations between segments.

In the operator's zero pose every segment's frame is aligned with the body's. So is the link that follows the
segment, whatever frame the robot's own model gives that link. There the hinges between two followed links
stand along a1, a2, … in the base frame, and as they turn from there by θ1, θ2, …

    R_parent_from_segment = exp(a1 θ1) exp(a2 θ2) …        (a product of exponentials, Brockett 1984)

so any number of joints, in any order and about any axes, is one more row of the table.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from common.errors import ConfigMistake
from common.quaternion import IDENTITY, Array, from_axis_angle, multiply, rotate
from common.skeleton.table import WORLD, Joint, RobotLink, Segment, Skeleton, Turn


def hinge_values(joints: Sequence[Joint], position_rad: Array) -> dict[str, Array]:
    """Where every moved hinge stands, rad or m, (...), for joint positions (..., J)."""
    return {
        hinge: ratio * position_rad[..., j]
        for j, joint in enumerate(joints)
        for hinge, ratio in joint.moves.items()
    }


def place_links(links: Sequence[RobotLink], values: Mapping[str, Array]) -> dict[str, tuple[Array, Array]]:
    """Origin (..., 3) m and orientation (..., 4) of every link, base from link.

    Hinges that have no value stand at 0.
    """
    shape = np.broadcast_shapes(*(value.shape for value in values.values()))
    placed = {WORLD: (np.zeros((*shape, 3)), np.broadcast_to(IDENTITY, (*shape, 4)))}
    for link in links:
        origin, q = placed[link.parent]
        origin = origin + rotate(q, np.array(link.origin_m))
        q = multiply(q, np.array(link.q_parent_from_link))
        for hinge in link.hinges:
            value, axis = values.get(hinge.name, np.zeros(shape)), np.array(hinge.axis)
            if hinge.slides:
                origin = origin + rotate(q, axis) * value[..., None]
                continue
            turned = multiply(q, from_axis_angle(axis, value))
            anchor = np.array(hinge.anchor_m)
            origin, q = origin + rotate(q, anchor) - rotate(turned, anchor), turned
        placed[link.name] = origin, q
    return placed


def path(links: Sequence[RobotLink], to: str, above: str = WORLD) -> list[RobotLink] | None:
    """The links below `above` down to and including `to`; None where it does not hang there."""
    by_name = {link.name: link for link in links}
    found: list[RobotLink] = []
    while to != above:
        if to not in by_name:
            return None
        found.insert(0, by_name[to])
        to = by_name[to].parent
    return found


def chain_of(
    segment: Segment, parent: Segment | None, links: Sequence[RobotLink], joints: Sequence[Joint]
) -> tuple[Turn, ...] | None:
    """The turns of a segment that a link follows; None where the link does not hang on the parent's."""
    above = parent.link if parent is not None and parent.link is not None else WORLD
    if segment.link is None or (way := path(links, segment.link, above)) is None:
        return None
    zero_rad = np.array([joint.zero_rad for joint in joints])
    values = hinge_values(joints, zero_rad)
    placed = place_links(links, values)
    turns = []
    for link in way:
        for h, hinge in enumerate(link.hinges):
            if hinge.slides or hinge.name not in values:
                continue
            # the axis in the link's frame is turned by the link's hinges after this one
            turned = placed[link.name][1]
            for later in reversed(link.hinges[h + 1 :]):
                turned = multiply(turned, from_axis_angle(later.axis, -values.get(later.name, np.zeros(()))))
            x, y, z = rotate(turned, np.array(hinge.axis)).tolist()
            turns.append(Turn(hinge.name, (x, y, z)))
    return tuple(turns)


def link_mistakes(skeleton: Skeleton) -> list[ConfigMistake]:
    """Links, hinges and segments of a robot's own model that do not fit together."""
    mistakes: list[ConfigMistake] = []

    def wrong(key: str, value: object, expected: str) -> None:
        mistakes.append(ConfigMistake(key, value, expected))

    if skeleton.model is None:
        wrong("model", None, "the MJCF file of the robot whose links the table lists")
    elif not skeleton.model.is_file():
        wrong("model", str(skeleton.model), "a file there; import the robot anew")
    links: set[str] = {WORLD}
    hinges: set[str] = set()
    for link in skeleton.own_links:
        if link.parent not in links or link.name in links:
            wrong(f"link.{link.name}.parent", link.parent, "each link once, after the link it hangs on")
        links.add(link.name)
        for hinge in link.hinges:
            if hinge.name in hinges or not any(hinge.axis):
                wrong(f"link.{link.name}.hinges", hinge.name, "a name used once, and an axis that is not 0")
            hinges.add(hinge.name)
    if mistakes:
        return mistakes
    above = {segment.name: segment.link for segment in skeleton.segments}
    for segment in skeleton.segments:
        if segment.link is None:
            continue
        if segment.link not in links:
            wrong(f"{segment.name}.link", segment.link, f"one of {', '.join(sorted(links - {WORLD}))}")
        elif path(skeleton.own_links, segment.link, above.get(segment.parent) or WORLD) is None:
            wrong(f"{segment.name}.link", segment.link, f"a link that hangs on {above[segment.parent]}")
    for joint in skeleton.joints:
        for hinge_name, ratio in joint.moves.items():
            if hinge_name not in hinges or not ratio:
                wrong(f"{joint.name}.hinges", hinge_name, "a hinge of a link, its ratio not 0")
    moved = [name for joint in skeleton.joints for name in joint.moves]
    for name in sorted({name for name in moved if moved.count(name) > 1}):
        wrong("joint.hinges", name, "a hinge that one joint alone moves")
    return mistakes
