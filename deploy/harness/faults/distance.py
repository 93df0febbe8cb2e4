"""The operator reaches into the robot itself, or into what stands around it; a zone that is wrong."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from common.clock import NS_PER_S
from common.config.load import load_config
from common.errors import ConfigError
from common.quaternion import Array
from common.wire.codec import decode, encode
from common.wire.messages import Command
from deploy.examples.profiles import example
from deploy.harness.faults.fault import BRAKED_S, ENGAGE, NOTICED_S
from deploy.harness.faults.scene import Scene
from deploy.harness.faults.setting import Setting
from deploy.harness.faults.virtual import follows_limited, goes_on, holds
from deploy.measure.apart import Distances
from deploy.sim.world.injection import Delivery, Traffic
from slave.config import SlaveConfig

REACH_S = 1.0
SLACK_M = 0.002
CAME_NEAR_M = 0.015
CUT_S = 0.6
"""Well into the reach."""
AFTER_CUT_S = 0.08 + NOTICED_S
ARMS = ("shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow_pitch")
CROSSED = (45.0, -10.0, -75.0, 90.0)
ON_THE_HEAD = (135.0, 0.0, -50.0, 122.0)
AHEAD = (85.0, 0.0, 0.0, 10.0)
BED = '{name="bed", shape="box", center_m=[0.75, 0.0, 1.25], size_m=[0.5, 1.6, 0.6], margin_cm=4}'
ON_THE_ROBOT = BED.replace("0.75", "0.2")
BESIDE_A_BED = Setting(slave=(f"guard.zones=[{BED}]",))


def _posture(scene: Scene, degrees: Sequence[float]) -> Array:
    """Both arms alike, all else at zero."""
    names = scene.skeleton.joint_names
    angles: Array = np.zeros(len(names))
    for side in ("left", "right"):
        for joint, degree in zip(ARMS, degrees, strict=True):
            angles[names.index(f"{side}_{joint}")] = math.radians(degree)
    return angles


def _goes_to(degrees: Sequence[float], cut_s: float = math.inf) -> Callable[[Scene], None]:
    return goes_to(lambda scene: _posture(scene, degrees), cut_s)


def goes_to(
    posture: Callable[[Scene], Array], cut_s: float = math.inf, reach_s: float = REACH_S
) -> Callable[[Scene], None]:
    """From now on the operator goes to joint angles (J,); after `cut_s` nothing comes any more."""

    def act(scene: Scene) -> None:
        begin, begin_ns = scene.newest().position_rad, scene.run.now_ns
        end = posture(scene)

        def carry(way: Traffic, payload: bytes) -> Sequence[Delivery]:
            since_s = (scene.run.now_ns - begin_ns) / NS_PER_S
            if since_s > cut_s:
                return ()
            if way is Traffic.COMMAND:
                command = decode(payload, Command, len(begin))
                share = min(since_s / reach_s, 1.0)
                rate = (end - begin) / reach_s if share < 1.0 else np.zeros_like(begin)
                position = begin + share * (end - begin)
                payload = encode(replace(command, position_rad=position, velocity_rad_s=rate))
            return ((0, payload),)

        scene.inject.carry = carry

    return act


def came_near(scene: Scene) -> list[str]:
    """What is wrong with how near the setpoints came: they must come near, but not too near."""
    config = scene.run.slave_config.guard
    distances, course = Distances(scene.skeleton, config.zones), scene.course().setpoint_rad
    spare = [distances.own_m(course).min() - config.self_margin_cm / 100.0]
    to_zones = distances.to_zones_m(course)
    spare += [to_zones[:, i].min() - zone.margin_m for i, zone in enumerate(config.zones)]
    least_m = float(min(spare))
    wrong = [f"came {-1000.0 * least_m:.1f} mm nearer than the margin"] * (least_m < -SLACK_M)
    wrong += [f"came no nearer than {100.0 * least_m:.1f} cm: nothing was tried"] * (least_m > CAME_NEAR_M)
    if not scene.guard.counters.clamps["distance"]:
        wrong.append("no clamp by distance was told")
    return wrong


def wrong_file(scene: Scene, zone: str = ON_THE_ROBOT) -> None:
    """What `tandem slave` and the doctor do with a file with such a zone."""
    try:
        load_config(example("slave", scene.profile), SlaveConfig, [f"guard.zones=[{zone}]"])
    except ConfigError as error:
        if "zones.0" in str(error) and "in the zero pose" in str(error):
            return
    scene.granted.append("a file whose zone stands in the robot")


SLIDES = "Stops short at its margin, or slides along, and says what is held back by what; all else follows."
LEAVES = "Nothing: it follows again as soon as the way is free."

DISTANCE = (
    follows_limited(
        name="arms crossed",
        done="The operator crosses the arms where the robot's would meet.",
        robot=SLIDES, person=LEAVES, act=_goes_to(CROSSED), also=came_near,
    ),
    follows_limited(
        name="hand to own head",
        done="The operator lays both hands on the head.",
        robot=SLIDES, person=LEAVES, act=_goes_to(ON_THE_HEAD), also=came_near,
    ),
    follows_limited(
        name="hand into a zone",
        done="The operator reaches where a bed stands before the robot.",
        robot=SLIDES, person=LEAVES, act=_goes_to(AHEAD), setting=BESIDE_A_BED, also=came_near,
    ),
    holds(
        name="link cut while a hand comes near a zone",
        done="The operator reaches for the bed, and on the way the link is cut.",
        robot="Brakes and stands, before the margin: there was always room to brake.",
        person=ENGAGE, act=_goes_to(AHEAD, CUT_S), setting=BESIDE_A_BED, also=came_near,
        reacts_s=CUT_S + AFTER_CUT_S, stands_s=CUT_S + AFTER_CUT_S + BRAKED_S,
        held_by={"command", "lease"},
    ),
    goes_on(
        name="zone file wrong",
        done="A robot is to be started with a file in which a zone stands where the robot itself does.",
        robot="The new program refuses the file, and names the zone and the part that stands in it; "
        "a robot that runs goes on with the zones that it has.",
        person="Correct the zone's coordinates: metres in the robot's base frame.",
        act=wrong_file,
        strays_deg=0.0,
    ),
)  # fmt: skip
