"""A fault of the robot's camera: the operator's newest picture grows old."""

from __future__ import annotations

from common.clock import to_ns
from deploy.harness.faults.fault import AT_ONCE_S, BRAKED_S
from deploy.harness.faults.scene import Scene
from deploy.harness.faults.virtual import holds
from slave.guard.body import Body
from slave.guard.eyes import video_loss

ALREADY_S = 2.5
"""How old the newest picture is when the trial begins."""
LIMIT_S = 3.0
"""`[guard] max_video_age_s` by default."""


def _no_more_pictures(scene: Scene) -> None:
    """As `slave.app` tells the guard of it."""
    captured_ns, config = scene.run.slave_ns - to_ns(ALREADY_S), scene.run.slave_config.guard
    scene.inject.body = lambda: Body(video=video_loss(captured_ns, scene.run.slave_ns, config))


def _still_refuses(scene: Scene) -> list[str]:
    """What is wrong where the operator asks to engage in spite of it."""
    scene.refuses_to_engage("restart the master")
    return [f"{what} was granted" for what in scene.granted]


CAMERA = (
    holds(
        name="camera gives no picture any more",
        done="The operator's newest picture is 2.5 s old, and none comes after it.",
        robot="Brakes all joints and stands, once the picture is older than `max_video_age_s` (3 s). Says "
        "how old it is, and refuses to engage.",
        person="Repair the camera or its link, then engage. To go on without pictures, restart the master "
        "first: it then relies on none.",
        act=_no_more_pictures,
        reacts_s=LIMIT_S - ALREADY_S + AT_ONCE_S, stands_s=LIMIT_S - ALREADY_S + AT_ONCE_S + BRAKED_S,
        also=_still_refuses, held_by={"video"},
    ),
)  # fmt: skip
