"""What can fail at both ends: nodes and bus of the suit; clocks, encoders, drives, base of the robot."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from common.clock import NS_PER_S
from common.quaternion import Array
from common.skeleton import load_skeleton
from common.wire.messages import Action, BaseAttitude
from common.wire.presence import ProcessPresence
from deploy.examples.profiles import NURSING
from deploy.experiments.faults.scene import Scene
from deploy.experiments.faults.setting import Setting
from deploy.sim.suit.faults import FaultsConfig, Loss, Twin
from deploy.sim.suit.lies import Lie, LieKind
from deploy.sim.suit.motion import OperatorMotion, parse_motion
from slave.guard import State
from slave.guard.body import Body
from slave.guard.tilt import base_loss
from slave.servos.servos import EncoderReading

HOUR_NS = 3_600 * NS_PER_S
NODE = "right_forearm"
RUNS_AWAY_RAD_S = math.radians(60.0)
JOINT = "right_shoulder_pitch"
"""In the middle of its reach when the fault comes."""


def node_lost(scene: Scene) -> None:
    """A node of the moving arm answers no more."""
    scene.run.suit.faults.config = FaultsConfig(lose=[Loss(node=NODE)])
    scene.undo = lambda: setattr(scene.run.suit.faults, "config", FaultsConfig())


def _lies(scene: Scene, kind: LieKind, axis: int | None = None) -> None:
    scene.run.suit.faults.config = FaultsConfig(lie=[Lie(node=NODE, kind=kind, axis=axis)])
    scene.undo = lambda: setattr(scene.run.suit.faults, "config", FaultsConfig())


def node_frozen(scene: Scene) -> None:
    """A node of the moving arm repeats its last reading."""
    _lies(scene, "frozen")


def node_zero(scene: Scene) -> None:
    """It reads zero on every axis, as after a reset."""
    _lies(scene, "zero")


def node_stuck(scene: Scene) -> None:
    """One axis of its accelerometer stands."""
    _lies(scene, "stuck", axis=0)


def node_saturated(scene: Scene) -> None:
    """One axis of its gyro is at the end of its range."""
    _lies(scene, "saturated", axis=4)


def nothing(_: Scene) -> None:
    """All that is amiss has been so from the beginning, by the row's setting."""


def leaning() -> OperatorMotion:
    """An operator who stands bowed by 25°."""
    moves = "".join(
        f"[[move]]\nstart_s = {start_s}\nduration_s = 1.0\nto_deg = {{ neck_yaw = {deg} }}\n"
        for start_s, deg in ((30.0, 10), (40.0, 0))
    )
    text = f"period_s = 60.0\n[rest_deg]\nwaist_pitch = 25\n{moves}"
    return parse_motion(text, load_skeleton(NURSING), source="leaning")


def leans(scene: Scene) -> None:
    """Somebody asks to engage who has leaned all the time."""
    scene.run.run(1.4)
    scene.refuses_to_engage("zero pose refused: leaned by 25°")


LEANS = Setting(aligned=True, master=("estimation.zero_pose_s=1.0",), motion=leaning)
GROSS_BIAS = Setting(lead_s=4.0, suit=(f'faults.lie=[{{node="{NODE}",kind="biased_gyro",offset=12.0}}]',))
IRON = Setting(
    lead_s=20.0, suit=(f'faults.lie=[{{node="{NODE}",kind="magnetised",offset=15.0,from_s=6.0}}]',)
)


def two_suits(scene: Scene) -> None:
    """A second suit on the same bus answers the same SYNCs with the same numbers."""
    scene.run.suit.faults.config = FaultsConfig(twin=[Twin()])
    scene.undo = lambda: setattr(scene.run.suit.faults, "config", FaultsConfig())


def joints_of_node(scene: Scene) -> set[str]:
    """The joints that are not known without it."""
    column = scene.skeleton.joint_needs_node[:, scene.skeleton.segment_names.index(NODE)]
    return {name for name, needs in zip(scene.skeleton.joint_names, column, strict=True) if needs}


def suit_bus_off(scene: Scene) -> None:
    """The CAN bus between suit and master fails."""
    scene.run.troubles.suit_heard = False


def drive_bus_off(scene: Scene) -> None:
    """The drives' CAN bus fails: no reading comes, no setpoint gets there, and the drives hold their last."""
    troubles = scene.run.troubles
    last: list[EncoderReading] = []
    held: list[Array] = []

    def read(reading: EncoderReading) -> EncoderReading:
        last.append(reading)
        return last[0]

    def write(position_rad: Array) -> Array:
        held.append(position_rad)
        return held[0]

    troubles.read, troubles.write = read, write


def one_joint(_: Scene) -> set[str]:
    """The joint whose encoder or drive fails."""
    return {JOINT}


def drive_fault(scene: Scene) -> None:
    """A drive reports over-current, and stands still where it is."""
    joint, held = scene.skeleton.joint_names.index(JOINT), []

    def write(position_rad: Array) -> Array:
        held.append(position_rad[joint])
        stuck: Array = position_rad.copy()
        stuck[joint] = held[0]
        return stuck

    scene.run.troubles.write = write
    scene.run.troubles.body = lambda: Body(drives={JOINT: "over-current"})


def encoder_silent(scene: Scene) -> None:
    """An encoder's readings are marked as not valid: magnet lost, parity wrong."""
    valid = np.array([name != JOINT for name in scene.skeleton.joint_names])
    scene.run.troubles.read = lambda reading: replace(reading, valid=reading.valid & valid)


def encoder_stuck(scene: Scene) -> None:
    """An encoder shows one angle for ever, and says that it is well."""
    joint, shown = scene.skeleton.joint_names.index(JOINT), []

    def read(reading: EncoderReading) -> EncoderReading:
        shown.append(reading.counts[joint])
        counts = reading.counts.copy()
        counts[joint] = shown[0]
        return replace(reading, counts=counts)

    scene.run.troubles.read = read


def drive_runs_away(scene: Scene) -> None:
    """A drive turns its joint by 60°/s, whatever it is told, until it is stopped by force."""
    joint, moved = scene.skeleton.joint_names.index(JOINT), [0.0]

    def write(position_rad: Array) -> Array:
        if scene.guard.state is not State.ESTOP:
            moved[0] += RUNS_AWAY_RAD_S / scene.run.slave_config.loop.rate_hz
        out: Array = position_rad.copy()
        out[joint] += moved[0]
        return out

    scene.run.troubles.write = write


def drive_lost_turns(scene: Scene) -> None:
    """A drive's own angle is off by 40° from its output encoder's."""
    joint, encoders = scene.skeleton.joint_names.index(JOINT), scene.encoders

    def read(reading: EncoderReading) -> EncoderReading:
        drive_rad = encoders.position_rad(reading.counts)
        drive_rad[joint] -= math.radians(40.0)
        return replace(reading, drive_rad=drive_rad)

    scene.run.troubles.read = read


def base_tilted(scene: Scene) -> None:
    """The base's sensor shows two degrees more tilt than is allowed."""
    config = scene.run.slave_config.guard
    tilt_rad = math.radians(config.max_tilt_deg + 2.0)

    def body() -> Body:
        now_ns = scene.run.slave_ns
        attitude = BaseAttitude(now_ns, tilt_rad, azimuth_rad=None, tool_face_rad=None, tilt_rad=tilt_rad)
        return Body(base=base_loss(attitude, now_ns, config))

    scene.run.troubles.body = body


def namesake(scene: Scene) -> None:
    """Another process shows itself under the robot's name."""
    other = ProcessPresence(scene.run.robot, "slave", 2, 1, "1.0", "another room, tcp/192.168.7.9:7447")
    scene.run.slave.namesakes.on_presence(other, here=True)


def master_clock_ahead(scene: Scene) -> None:
    """The master's clock is set ahead by an hour."""
    scene.run.troubles.master_stepped_ns = HOUR_NS


def master_clock_back(scene: Scene) -> None:
    """And back."""
    scene.run.troubles.master_stepped_ns = -HOUR_NS


def slave_clock_ahead(scene: Scene) -> None:
    """The robot's clock is set ahead by an hour."""
    scene.run.troubles.slave_stepped_ns = HOUR_NS


def slave_clock_back(scene: Scene) -> None:
    """And back."""
    scene.run.troubles.slave_stepped_ns = -HOUR_NS


def estop(scene: Scene) -> None:
    """Somebody asks for an emergency stop; then others try to go on, without the key."""
    scene.run.ask(Action.ESTOP, operator="a visitor")

    def others() -> None:
        for action in (Action.ENGAGE, Action.RESET):
            scene.ask(action, scene.run.master_config.operator.name)

    scene.each_period = others
