"""What the simulated operator does: the motions there are, by name."""

from __future__ import annotations

import math
import tomllib
from importlib import resources
from typing import Protocol, TypedDict, cast

import numpy as np
from numpy.typing import ArrayLike

from common.errors import ConfigError, ConfigMistake
from common.quaternion import Array
from common.skeleton import Skeleton
from deploy.sim.suit.gait import Curve, Gait, GaitError, Strides
from deploy.sim.suit.joint_moves import JointMoves
from deploy.sim.suit.minimum_jerk import MinimumJerkMotion, MotionError, Move
from deploy.sim.suit.people import PeopleConfig, load_people
from deploy.sim.suit.postures import posture_motion

MOTIONS = {
    "bottle": "nursing",
    "crossed": "nursing",
    "grasp": "hand",
    "walk": "lower_limb",
    "calibration_pose": None,
    "sweep": None,
    "postures": None,
    "move_joints": None,
    "tray": None,
    "calibration": None,
    "capture": "nursing",
}
"""Each motion, and the one profile that can make it; None: any can."""

STILL_S = 3.5
"""A sweep begins with standing still this long, so that filters settle and the robot can align."""
SWEEP_MARGIN_RAD = math.radians(1.0)
SWEEP_PAUSE_S = 0.2
SWEEP_SHARE = 0.4
"""A sweep takes this share of each joint's velocity and acceleration limit at most."""


class _MoveEntry(TypedDict):
    start_s: float
    duration_s: float
    to_deg: dict[str, float]


class _MovesTable(TypedDict):
    period_s: float
    rest_deg: dict[str, float]
    move: list[_MoveEntry]


class _CurveEntry(TypedDict):
    mean_deg: float
    cos_deg: list[float]
    sin_deg: list[float]


class _StridesEntry(TypedDict):
    start_s: float
    stop_s: float
    ramp_s: float
    stride_s: float


class _GaitTable(TypedDict):
    period_s: float
    strides: _StridesEntry
    ahead: dict[str, float]
    curve: dict[str, _CurveEntry]


class OperatorMotion(Protocol):
    """Joint angles as a smooth function of time; it loops after `period_s`."""

    @property
    def period_s(self) -> float:
        """Time after which it begins anew."""

    def state(self, t_s: ArrayLike) -> tuple[Array, Array, Array]:
        """Position rad, velocity rad/s and acceleration rad/s², (..., J), at times (...)."""


def motion_mistakes(name: str, profile: str) -> list[ConfigMistake]:
    """None for a motion that the profile can make; else which ones it can."""
    able = [motion for motion, only in MOTIONS.items() if only in (None, profile)]
    if name in able:
        return []
    return [ConfigMistake("motion", name, f"one of {', '.join(able)} for the profile {profile}")]


def load_motion(name: str, skeleton: Skeleton, people: PeopleConfig | None = None) -> OperatorMotion:
    """The named one of `MOTIONS` for a skeleton; `people` says what `capture` plays.

    Raises ConfigError for another name, for a motion of another profile, and for one whose joints the
    skeleton does not have or whose angles are beyond their limits.
    """
    mistakes = motion_mistakes(name, skeleton.name)
    if mistakes:
        raise ConfigError("motion", mistakes)
    if name == "sweep":
        return sweep(skeleton)
    if name in ("move_joints", "tray", "calibration"):  # off the tray the operator always does this
        return JointMoves(skeleton)
    if name == "capture":
        return load_people(people or PeopleConfig(), skeleton)
    if name == "postures":
        return posture_motion(skeleton)
    if name == "calibration_pose":
        return stand_still(skeleton)
    text = resources.files(__package__).joinpath(f"{name}.toml").read_text("utf-8")
    return parse_motion(text, skeleton, source=f"{name}.toml")


def parse_motion(text: str, skeleton: Skeleton, source: str) -> OperatorMotion:
    """A motion from TOML text (its forms are described at the heads of bottle.toml and walk.toml)."""
    read = tomllib.loads(text)
    if "strides" in read:
        return _gait(cast(_GaitTable, read), skeleton, source)
    table = cast(_MovesTable, read)
    mistakes = _mistakes(table, skeleton)
    if mistakes:
        raise ConfigError(source, mistakes)
    rest = {joint: math.radians(angle) for joint, angle in table["rest_deg"].items()}
    moves = [
        Move(joint, move["start_s"], move["duration_s"], math.radians(angle))
        for move in table["move"]
        for joint, angle in move["to_deg"].items()
    ]
    rest_rad = np.array([rest.get(joint, 0.0) for joint in skeleton.joint_names])
    try:
        return MinimumJerkMotion(skeleton.joint_names, rest_rad, moves, table["period_s"])
    except MotionError as error:
        raise ConfigError(source, [ConfigMistake("move", "", str(error))]) from None


def _gait(table: _GaitTable, skeleton: Skeleton, source: str) -> OperatorMotion:
    curves = {
        f"{side}_{joint}": (_curve(curve), ahead)
        for side, ahead in table["ahead"].items()
        for joint, curve in table["curve"].items()
    }
    try:
        return Gait(skeleton.joint_names, curves, Strides(period_s=table["period_s"], **table["strides"]))
    except GaitError as error:
        raise ConfigError(source, [ConfigMistake("strides", table["strides"], str(error))]) from None


def _curve(table: _CurveEntry) -> Curve:
    cosines, sines = (tuple(map(math.radians, degrees)) for degrees in (table["cos_deg"], table["sin_deg"]))
    return Curve(math.radians(table["mean_deg"]), cosines, sines)


def stand_still(skeleton: Skeleton) -> OperatorMotion:
    """The zero pose, or as near to it as the limits let: what a calibration asks of the operator."""
    return MinimumJerkMotion(skeleton.joint_names, _nearest_to_zero(skeleton, 0.0), [], period_s=1.0)


def sweep(skeleton: Skeleton) -> OperatorMotion:
    """Each joint after the other up, down and back, to one degree inside its limits."""
    rest_rad = _nearest_to_zero(skeleton, SWEEP_MARGIN_RAD)
    moves = []
    now_s = STILL_S
    for joint, rest in zip(skeleton.joints, rest_rad.tolist(), strict=True):
        at = rest
        for to in (joint.upper_rad - SWEEP_MARGIN_RAD, joint.lower_rad + SWEEP_MARGIN_RAD, rest):
            if to != at:
                # peaks of a minimum-jerk move: 1.875 Δ / T and 10 / √3 Δ / T²
                for_velocity = 1.875 * abs(to - at) / (SWEEP_SHARE * joint.max_velocity_rad_s)
                for_acceleration = math.sqrt(
                    10.0 / math.sqrt(3.0) * abs(to - at) / (SWEEP_SHARE * joint.max_acceleration_rad_s2)
                )
                duration_s = max(for_velocity, for_acceleration)
                moves.append(Move(joint.name, now_s, duration_s, to))
                now_s += duration_s
            at = to
        now_s += SWEEP_PAUSE_S
    return MinimumJerkMotion(skeleton.joint_names, rest_rad, moves, period_s=now_s)


def _nearest_to_zero(skeleton: Skeleton, margin_rad: float) -> Array:
    out: Array = np.clip(skeleton.zero_rad, skeleton.lower_rad + margin_rad, skeleton.upper_rad - margin_rad)
    return out


def _mistakes(table: _MovesTable, skeleton: Skeleton) -> list[ConfigMistake]:
    """Angles of joints that the skeleton does not have, or beyond their limits."""
    joints = {joint.name: joint for joint in skeleton.joints}
    angles = [("rest_deg", table["rest_deg"])]
    angles += [(f"move.{i}.to_deg", move["to_deg"]) for i, move in enumerate(table["move"])]
    mistakes = []
    for where, entries in angles:
        for name, angle in entries.items():
            joint = joints.get(name)
            if joint is None:
                expected = f"a joint of the skeleton {skeleton.name}"
                mistakes.append(ConfigMistake(f"{where}.{name}", angle, expected))
            elif not joint.lower_rad <= math.radians(angle) <= joint.upper_rad:
                limits = f"{math.degrees(joint.lower_rad):g} to {math.degrees(joint.upper_rad):g}"
                mistakes.append(ConfigMistake(f"{where}.{name}", angle, limits))
    return mistakes
