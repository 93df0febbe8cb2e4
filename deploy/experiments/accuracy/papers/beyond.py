"""Beyond the papers: elbows and knees while magnets turn the field at one of the two nodes beside each."""

from __future__ import annotations

import math
from collections.abc import Sequence

from deploy.experiments.accuracy.papers.figures import PaperValue
from deploy.measure import accuracy
from deploy.sim.world.world import VirtualWorld, WorldSettings

RATIO_TARGET = 1.2
SECONDS = 16.5
TURN_DEG = 40.0
"""Turned about the vertical, its strength and dip as before: no node alone can tell."""
JOINTS = {
    "nursing": (
        "elbow",
        "forearm",
        ("left_elbow_pitch", "left_elbow_roll", "right_elbow_pitch", "right_elbow_roll"),
    ),
    "lower_limb": ("knee", "shank", ("left_knee_flexion", "right_knee_flexion")),
}
"""By profile: the joint, the segment whose field is turned, and the angles judged."""


def experiment(
    seed: int, seconds: float = SECONDS, profiles: Sequence[str] = tuple(JOINTS)
) -> list[PaperValue]:
    """RMSE of each profile's angles with the joints' constraints and without, field disturbed and not."""
    figures = []
    for profile in profiles:
        name = JOINTS[profile][0]
        for constraints in ("online", "off"):
            quiet, turned = (rmse_deg(seed, profile, constraints, seconds, turn) for turn in (0.0, TURN_DEG))
            of = f"{name}, constraints {constraints}"
            target = RATIO_TARGET if constraints == "online" else None
            ratio = () if quiet is None or turned is None else (turned / quiet,)
            figures += [
                PaperValue(f"{of}: RMSE undisturbed", "°", () if quiet is None else (quiet,)),
                PaperValue(f"{of}: RMSE disturbed", "°", () if turned is None else (turned,)),
                PaperValue(f"{of}: disturbed / undisturbed", "", ratio, None, target),
            ]
    return figures


def rmse_deg(seed: int, profile: str, constraints: str, seconds: float, turn_deg: float) -> float | None:
    """Over all the profile's angles of a run on the virtual clock; None where one was never solved."""
    _, segment, joints = JOINTS[profile]
    suit = [f"seed={seed}"]
    if turn_deg:
        nodes = f'["left_{segment}", "right_{segment}"]'
        suit.append(
            f"disturbance.local=[{{ nodes = {nodes}, from_s = 5.0, ramp_s = 1.0, turn_deg = {turn_deg} }}]"
        )
    master = [f'estimation.constraints="{constraints}"']
    run = VirtualWorld(WorldSettings(profile=profile, overrides={"suit": suit, "master": master}))
    run.run(seconds)
    judged = accuracy(run.trace.truth(), run.trace.solved(), run.trace.joint_names).joints
    rows = [row for joint in joints if (row := judged[joint]) is not None]
    if len(rows) < len(joints):
        return None
    return math.sqrt(sum(row.rmse_deg**2 for row in rows) / len(rows))
