"""A robot's table as the page draws it: bodies, hinges, capsules, joints, the operator's nodes. Pure."""

from __future__ import annotations

from common.skeleton import Skeleton
from slave.model.capsules import capsules, links


def scene(skeleton: Skeleton) -> dict[str, object]:
    """Lengths in m, angles in rad, in the base frame of the table; a body stands after the one it hangs on.

    A hinge stands at the sum of ratio times position over its `joints`.
    """
    bodies = links(skeleton)
    place = {link.name: i for i, link in enumerate(bodies)}
    moved: dict[str, list[list[float]]] = {}
    for j, joint in enumerate(skeleton.joints):
        for hinge, ratio in joint.moves.items():
            moved.setdefault(hinge, []).append([j, ratio])
    shape: list[list[dict[str, object]]] = [[] for _ in bodies]
    for capsule in capsules(skeleton):
        shape[capsule.segment].append(
            {"from_m": capsule.from_m, "to_m": capsule.to_m, "radius_m": round(capsule.radius_m, 5)}
        )
    return {
        "profile": skeleton.name,
        "joints": [
            {
                "name": joint.name,
                "lower_rad": round(joint.lower_rad, 6),
                "upper_rad": round(joint.upper_rad, 6),
                "max_velocity_rad_s": round(joint.max_velocity_rad_s, 6),
            }
            for joint in skeleton.joints
        ],
        "links": [
            {
                "name": link.name,
                "parent": place.get(link.parent, -1),
                "origin_m": link.origin_m,
                "q_parent_from_link": link.q_parent_from_link,
                "hinges": [
                    {
                        "axis": hinge.axis,
                        "anchor_m": hinge.anchor_m,
                        "slides": hinge.slides,
                        "joints": moved.get(hinge.name, []),
                    }
                    for hinge in link.hinges
                ],
                "capsules": shape[i],
            }
            for i, link in enumerate(bodies)
        ],
        "stand": [
            {"from_m": post.from_m, "to_m": post.to_m, "radius_m": post.radius_m} for post in skeleton.stand
        ],
        "nodes": [
            {"name": s.name, "parent": s.parent, "origin_m": s.origin_m, "node_m": s.node_m}
            for s in skeleton.segments
        ],
    }
