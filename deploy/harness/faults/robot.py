"""Faults of the robot: its drives and their bus, its encoders, its base."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Generic, TypeVar

import numpy as np

from common.clock import NS_PER_S, to_s
from common.quaternion import Array
from common.wire.messages import BaseAttitude
from deploy.harness.faults.fault import AT_ONCE_S, BRAKED_S, ENGAGE, NOTHING
from deploy.harness.faults.scene import Scene
from deploy.harness.faults.virtual import VirtualFault, goes_on, holds, holds_joints, stops
from slave.attitude.config import BaseConfig
from slave.attitude.frame import FrameAngles, FrameParser, encode
from slave.attitude.port import of_frame
from slave.attitude.vote import Vote
from slave.guard import State
from slave.guard.body import Body
from slave.guard.tilt import base_loss
from slave.servos.canopen.config import CanopenConfig
from slave.servos.canopen.drives import Drives
from slave.servos.canopen.pdo import SYNC
from slave.servos.servos import EncoderReading

JOINT = "right_shoulder_pitch"
"""In the middle of its reach when the fault comes."""
RUNS_AWAY_RAD_S = math.radians(60.0)
FRAMES_HZ = 10.0
"""The attitude instrument's frame rate, the slowest allowed."""
FALLS_DEG_S = 100.0
SWITCH_ON = (
    "Remove the cause. Drives that stopped by themselves are switched on by an emergency stop and its reset "
    "with the key, or by starting the robot's program anew; then engage."
)
T = TypeVar("T")


class _Frozen(Generic[T]):
    """Returns the first value that it was given, for ever."""

    def __init__(self) -> None:
        self._first: list[T] = []

    def __call__(self, value: T) -> T:
        if not self._first:
            self._first.append(value)
        return self._first[0]


def _name(scene: Scene) -> str:
    """The nursing robot's, or the first joint of another robot's right upper arm, or of all."""
    skeleton = scene.skeleton
    if JOINT in skeleton.joint_names:
        return JOINT
    if "right_upper_arm" not in skeleton.segment_names:
        return skeleton.joint_names[0]
    arm = skeleton.segment_names.index("right_upper_arm")
    turns = (
        joint.name for joint in skeleton.joints for a in joint.drives if skeleton.angle_slots[a][0] == arm
    )
    return next(turns)


def _joint(scene: Scene) -> int:
    return scene.skeleton.joint_names.index(_name(scene))


def _one_joint(scene: Scene) -> set[str]:
    return {_name(scene)}


def _with(values: Array, joint: int, value: float) -> Array:
    """A copy with one joint's value replaced."""
    changed: Array = values.copy()
    changed[joint] = value
    return changed


def _bus_off(scene: Scene) -> None:
    scene.inject.read, scene.inject.write = _Frozen[EncoderReading](), _Frozen[Array]()


def _drive_fault(scene: Scene) -> None:
    joint, held = _joint(scene), _Frozen[float]()
    scene.inject.write = lambda position_rad: _with(position_rad, joint, held(position_rad[joint]))
    scene.inject.body = lambda: Body(drives={_name(scene): "over-current"})


def _encoder_silent(scene: Scene) -> None:
    valid = np.array([name != _name(scene) for name in scene.skeleton.joint_names])
    scene.inject.read = lambda reading: replace(reading, valid=reading.valid & valid)


def _encoder_stuck(scene: Scene) -> None:
    joint, shown = _joint(scene), _Frozen[float]()

    def read(reading: EncoderReading) -> EncoderReading:
        counts = reading.counts.copy()
        counts[joint] = shown(counts[joint])
        return replace(reading, counts=counts)

    scene.inject.read = read


def _drive_runs_away(scene: Scene) -> None:
    """Until it is stopped by force."""
    joint, moved_rad = _joint(scene), 0.0

    def write(position_rad: Array) -> Array:
        nonlocal moved_rad
        if scene.guard.state is not State.ESTOP:
            moved_rad += RUNS_AWAY_RAD_S / scene.run.slave_config.loop.rate_hz
        return _with(position_rad, joint, position_rad[joint] + moved_rad)

    scene.inject.write = write


def _drive_lost_turns(scene: Scene) -> None:
    joint = _joint(scene)

    def read(reading: EncoderReading) -> EncoderReading:
        drive_rad = scene.encoders.position_rad(reading.counts)
        return replace(reading, drive_rad=_with(drive_rad, joint, drive_rad[joint] - math.radians(40.0)))

    scene.inject.read = read


def _second_master(scene: Scene) -> None:
    """NMT then stops the drives: they brake and hold."""
    drives = Drives(CanopenConfig(), scene.skeleton)
    drives.start(scene.run.slave_ns)
    drives.on_frame("left", SYNC, b"", scene.run.slave_ns)
    scene.inject.write = _Frozen[Array]()
    scene.inject.body = lambda: Body(drives=drives.faults)


def _base_tilted(scene: Scene) -> None:
    config = scene.run.slave_config.guard
    tilt_rad = math.radians(config.max_tilt_deg + 2.0)

    def body() -> Body:
        now_ns = scene.run.slave_ns
        attitude = BaseAttitude(now_ns, tilt_rad, azimuth_rad=None, tool_face_rad=None, tilt_rad=tilt_rad)
        return Body(base=base_loss(attitude, now_ns, config))

    scene.inject.body = body


def _base_falls(scene: Scene) -> None:
    _instrument(scene, lambda at_s: min(90.0, FALLS_DEG_S * at_s), lambda frame, _: frame)


def _frames_spoiled(scene: Scene) -> None:
    flips = np.random.default_rng(5)

    def spoil(frame: bytes, number: int) -> bytes:
        bit = int(flips.integers(8, 56))
        spoiled = bytearray(frame)
        spoiled[bit // 8] ^= (1 << bit % 8) * (number % 4 == 3)
        return bytes(spoiled)

    _instrument(scene, lambda _: 0.0, spoil)


def _instrument(
    scene: Scene, lean_deg: Callable[[float], float], on_wire: Callable[[bytes, int], bytes]
) -> None:
    """From now on the base's attitude is what an instrument's frames say, read as the slave reads them."""
    config = BaseConfig(source="serial", port="-")
    guard = scene.run.slave_config.guard
    parser, vote = FrameParser(), Vote(math.radians(config.most_deg_s))
    known: list[BaseAttitude] = []
    began_ns = scene.run.slave_ns
    period_ns = round(NS_PER_S / FRAMES_HZ)
    sent = -3

    def body() -> Body:
        nonlocal sent
        now_ns = scene.run.slave_ns
        # the three before the fault: the instrument has been read already
        while began_ns + sent * period_ns <= now_ns:
            came_ns = began_ns + sent * period_ns
            lean = round(10.0 * lean_deg(max(0.0, to_s(came_ns - began_ns)))) % 3600
            for angles in parser.feed(on_wire(encode(FrameAngles(900, 0, lean)), max(0, sent))):
                heard = vote.hear(angles, came_ns)
                found = None if heard is None else of_frame(heard.angles, heard.came_ns, config)
                known[:] = known if found is None else [found]
            sent += 1
        return Body(base=base_loss(known[0] if known else None, now_ns, guard))

    scene.inject.body = body


ROBOT = (
    holds(
        name="CAN bus of the drives off",
        done="No reading comes from the drives, and no setpoint gets to them.",
        robot="The drives hold their last setpoint, and stop by themselves when they miss the robot's "
        "heartbeat.",
        person=SWITCH_ON,
        act=_bus_off,
        reacts_s=0.11, stands_s=0.11 + BRAKED_S, held_by={"encoder"},
    ),
    holds(
        name="drive fault",
        done="The drive of a moving joint reports over-current and stands still.",
        robot="Brakes all joints and stands; names the joint and what its drive says.",
        person=SWITCH_ON,
        act=_drive_fault,
        reacts_s=AT_ONCE_S, stands_s=AT_ONCE_S + BRAKED_S, held_by={"drive"},
    ),
    holds(
        name="encoder silent",
        done="The encoder of a moving joint says that its readings are not valid: magnet lost, wrong parity.",
        robot="Brakes all joints and stands; names the joint.",
        person=ENGAGE,
        act=_encoder_silent,
        reacts_s=0.11, stands_s=0.11 + BRAKED_S, held_by={"encoder"},
    ),
    holds(
        name="encoder stuck",
        done="The encoder of a moving joint shows one angle for ever, and says that it is well.",
        robot="Takes it for a joint that is held up from outside: a protective stop. Where the torques do "
        "not show it, the guard holds that joint alone and names it.",
        person="Repair the encoder, then engage.",
        act=_encoder_stuck,
        reacts_s=0.1, stands_s=0.1 + 1.0, yields=True, held_by={"contact"},
    ),
    stops(
        name="drive moves by itself",
        done="While nobody is engaged a drive turns its joint by 60°/s, whatever its setpoint is.",
        robot="Stops all drives by force; names the joint.",
        person="Find out why before you reset with the key at the robot; then engage.",
        act=_drive_runs_away,
        begins=State.HOLD, reacts_s=0.1, stands_s=0.1 + BRAKED_S,
    ),
    holds(
        name="drive and output encoder differ",
        done="A drive's own angle is 40° off its output encoder's: turns lost, or wrong zero, gear or "
        "direction.",
        robot="Brakes all joints and stands; names joint and both angles. "
        "At a start: does not enable the drive.",
        person="Look at the joint: correct the drive's zero, gear or direction, or repair the encoder; "
        "then engage.",
        act=_drive_lost_turns,
        reacts_s=0.02, stands_s=0.02 + BRAKED_S, held_by={"drive"},
    ),
    holds(
        name="base tilted",
        done="The base leans by 12° where 10° is the most it may.",
        robot="Brakes all joints and stands.",
        person=ENGAGE,
        act=_base_tilted,
        reacts_s=AT_ONCE_S, stands_s=AT_ONCE_S + BRAKED_S, held_by={"base"},
    ),
    holds(
        name="base falls",
        done="The base tips over at 100°/s, as an instrument with ten frames a second reports it.",
        robot="Brakes all joints and stands, with the second frame beyond the limit.",
        person=ENGAGE,
        act=_base_falls,
        reacts_s=0.1 + 0.2 + AT_ONCE_S, stands_s=0.1 + 0.2 + AT_ONCE_S + BRAKED_S, held_by={"base"},
    ),
    goes_on(
        name="attitude frames spoiled",
        done="Every fourth frame of the attitude instrument has one flipped bit; the base stands level.",
        robot="Follows. Of three frames in a row each angle's median counts.",
        person=NOTHING,
        act=_frames_spoiled,
        strays_deg=0.1,
    ),
    holds(
        name="second master at the drives",
        done="Another program sends SYNC on a bus of the drives.",
        robot="Stops all drives by NMT, brakes and stands; names the second master by what it sends.",
        person="End the other program, then emergency stop and its reset with the key; then engage.",
        act=_second_master,
        reacts_s=AT_ONCE_S, stands_s=AT_ONCE_S + BRAKED_S, held_by={"drive"},
    ),
)  # fmt: skip

OTHERWISE: dict[str, VirtualFault] = {
    "encoder stuck": holds_joints(
        name="encoder stuck, not seen in the torques",
        done="As in the row itself.",
        robot="Holds that joint alone and names it.",
        person="Repair the encoder, then engage.",
        act=_encoder_stuck,
        concerns=_one_joint, sway_deg=1.0, stands_s=1.0, strays_deg=1.0,
    ),
}  # fmt: skip
"""What a robot that is not the nursing robot may do as well, by row: how much a fault changes the torques
depends on the masses and the speeds."""
