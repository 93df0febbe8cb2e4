"""Faults of the suit: nodes that fail or read wrongly, a zero pose that is none, its CAN bus."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from common.skeleton import load_skeleton
from deploy.examples.profiles import NURSING
from deploy.harness.faults.fault import AT_ONCE_S, BRAKED_S, ENGAGE, NOTICED_S
from deploy.harness.faults.scene import Scene
from deploy.harness.faults.setting import Setting
from deploy.harness.faults.virtual import goes_on, holds, holds_joints
from deploy.sim.suit.faults import FaultsConfig, Loss, Twin
from deploy.sim.suit.minimum_jerk import MinimumJerkMotion, Move
from deploy.sim.suit.motion import OperatorMotion, parse_motion
from deploy.sim.suit.postures import robot_posture
from deploy.sim.suit.wrong_readings import WrongReading, WrongReadingKind
from slave.guard import State

NODE = "right_forearm"
"""A node of the reaching arm."""
LEAN_DEG = 25.0
LIARS: tuple[tuple[str, str, WrongReadingKind, int | None], ...] = (
    ("sensor node frozen", "A node of the reaching arm repeats one reading.", "frozen", None),
    ("sensor node reads zero", "The node answers with zeros, as after a reset.", "zero", None),
    ("sensor axis stuck", "One axis of the node's accelerometer stands.", "stuck", 0),
    ("sensor axis saturated", "One axis of its gyro is at its range's end.", "saturated", 4),
)


def _suit(faults: FaultsConfig) -> Callable[[Scene], None]:
    """The simulated suit has these faults from now on."""

    def act(scene: Scene) -> None:
        scene.run.suit.faults.config = faults

    return act


def _joints_of_node(scene: Scene) -> set[str]:
    """The joints that are not known without it."""
    column = scene.skeleton.joint_needs_node[:, scene.skeleton.segment_names.index(NODE)]
    return {name for name, needs in zip(scene.skeleton.joint_names, column, strict=True) if needs}


def _bus_off(scene: Scene) -> None:
    scene.inject.suit_heard = False


def _from_the_beginning(_: Scene) -> None:
    """The row's setting holds all that is wrong."""


def _leaning() -> OperatorMotion:
    """An operator that stands bowed by 25°."""
    moves = "".join(
        f"[[move]]\nstart_s = {start_s}\nduration_s = 1.0\nto_deg = {{ neck_yaw = {deg} }}\n"
        for start_s, deg in ((30.0, 10), (40.0, 0))
    )
    text = f"period_s = 60.0\n[rest_deg]\nwaist_pitch = 25\n{moves}"
    return parse_motion(text, load_skeleton(NURSING), source="leaning")


def leaning_of(profile: str) -> OperatorMotion:
    """An operator of another robot: bowed by 25°, or with the arms as far out where the trunk cannot bow."""
    skeleton = load_skeleton(profile)
    place, left_rad = robot_posture(skeleton, {"waist_pitch": LEAN_DEG})
    if left_rad.max() > math.radians(1.0):
        place, _ = robot_posture(skeleton, {"shoulder_roll": LEAN_DEG})
    rest = np.clip(place, skeleton.lower_rad, skeleton.upper_rad)
    later = Move(skeleton.joint_names[0], 30.0, 1.0, float(rest[0]))
    return MinimumJerkMotion(skeleton.joint_names, rest, [later], period_s=60.0)


def _leans(scene: Scene) -> None:
    scene.run.run(1.4)
    scene.refuses_to_engage("zero pose refused: leaned by 25°")


LEANS = Setting(aligned=True, master=("estimation.zero_pose_s=1.0",), motion=_leaning)
GROSS_BIAS = Setting(
    lead_s=4.0, suit=(f'faults.wrong_reading=[{{node="{NODE}",kind="biased_gyro",offset=12.0}}]',)
)
IRON = Setting(
    lead_s=20.0, suit=(f'faults.wrong_reading=[{{node="{NODE}",kind="magnetised",offset=15.0,from_s=6.0}}]',)
)

SUIT = (
    holds_joints(
        name="sensor node lost",
        done="A node of the reaching arm does not answer any more.",
        robot="Holds the joints that need the node; the others follow.",
        person="Repair the node. Its joints come back slowly by themselves.",
        act=_suit(FaultsConfig(lose=[Loss(node=NODE)])),
        concerns=_joints_of_node, strays_deg=1.0, sway_deg=1.0,
        stands_s=0.1 + 0.08 + BRAKED_S,
    ),
    # the master sends a command out of turn to name a node: it is fresher, and the others follow closer
    *(
        holds_joints(
            name=name,
            done=done,
            robot="Holds the joints that need the node; the others follow. "
            "The node is named with what is wrong.",
            person="Repair the node. Its joints come back slowly by themselves; "
            "until then engage is refused.",
            act=_suit(FaultsConfig(wrong_reading=[WrongReading(node=NODE, kind=kind, axis=axis)])),
            concerns=_joints_of_node, strays_deg=2.5, sway_deg=1.0, stands_s=0.2 + BRAKED_S,
        )
        for name, done, kind, axis in LIARS
    ),
    holds(
        name="zero pose of somebody who leans",
        done="The suit is put on, and the operator stands bowed by 25° where the zero pose is to be taken.",
        robot="Refuses to engage, and says which segment leaned by how much. It stands.",
        person="Stand upright, arms hanging, and still for `zero_pose_s`; then engage.",
        act=_leans,
        begins=State.HOLD, setting=LEANS, stands_s=AT_ONCE_S,
    ),
    # compared with an operator who stood still for less time; that alone makes 3° of difference
    goes_on(
        name="gyro with a gross bias",
        done="A gyro of the reaching arm has read 12 °/s too much on each axis since it was put on; the "
        "operator stood still for 5 s before engaging.",
        robot="Follows: the bias was learnt at rest. The node is named with its rate; beyond "
        "`rest_bias_limit_deg_s` its joints would be held, or engage refused.",
        person="Calibrate the node (`tandem calibrate imu`).",
        act=_from_the_beginning,
        setting=GROSS_BIAS, strays_deg=5.0,
    ),
    goes_on(
        name="iron at a magnetometer while it is worn",
        done="Iron sticks to a node of the reaching arm: 15 µT more on each axis, since 14 s before the "
        "trial.",
        robot="Follows. The node's gyro keeps its heading; `tandem status` names the node.",
        person="Take the iron away, or calibrate the node (`tandem calibrate mag`).",
        act=_from_the_beginning,
        setting=IRON, strays_deg=5.0,
    ),
    holds(
        name="second suit on the bus",
        done="Another suit answers the same SYNCs with the same node numbers.",
        robot="Believes neither: brakes and stands. The log and `tandem status` name the nodes.",
        person="Take one suit off the bus, or give it other numbers. " + ENGAGE,
        act=_suit(FaultsConfig(twin=[Twin()])),
        reacts_s=0.02 + NOTICED_S, stands_s=0.02 + 0.08 + BRAKED_S, held_by={"valid"},
    ),
    holds(
        name="CAN bus of the suit off",
        done="The bus between the suit and the master fails.",
        robot="Brakes and stands. When the bus is back it still stands.",
        person=ENGAGE,
        act=_bus_off,
        # the joints brake with the first command in which none is valid; the robot holds by the time-out
        reacts_s=NOTICED_S, stands_s=0.08 + BRAKED_S, held_by={"valid"},
    ),
)  # fmt: skip
