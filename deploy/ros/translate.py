"""What a robot says, as messages of ROS 2 on their topics. Pure: the wall clock is an argument."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from common.clock import NS_PER_S, to_s
from common.quaternion import Array
from common.skeleton import Skeleton
from common.skeleton.kinematics import relative_orientations
from common.wire.messages import RobotState
from common.wire.video import VideoFrame
from deploy.ros.cdr import (
    COMPRESSED_IMAGE,
    DIAGNOSTICS,
    JOINT_STATE,
    TF,
    Diagnostic,
    Transform,
    compressed_image,
    diagnostics,
    joint_state,
    tf_message,
    type_hash,
)
from deploy.ros.keys import RosTopic, ros_name

OK, WARN, ERROR, STALE = range(4)
_LEVELS = {"track": OK, "align": OK, "estop": ERROR}
"""Of the guard's states; the others are a warning."""
_TF_DEPTH = 100
_DRIFT = 100e-6
"""Of two hosts' clocks against each other."""
Published = tuple[RosTopic, bytes]


class WallTime:
    """The robot's own clock as this host's wall clock, by the message that was fastest on its way.

    A stamp is late by the least delay of the link, never early; both clocks may drift by 100 ppm.
    """

    def __init__(self) -> None:
        self._instance, self._noted_ns, self._offset_ns = 0, 0, 0

    def note(self, robot_ns: int, wall_ns: int, instance: int) -> None:
        """A message that the robot sent at `robot_ns` is here at `wall_ns`."""
        offset_ns = wall_ns - robot_ns
        if self._noted_ns and instance == self._instance:
            allowed_ns = self._offset_ns + round(_DRIFT * max(0, robot_ns - self._noted_ns))
            offset_ns = min(offset_ns, allowed_ns)
        self._instance, self._noted_ns, self._offset_ns = instance, robot_ns, offset_ns

    def of(self, robot_ns: int) -> int:
        """A stamp of the robot's, ns since 1970."""
        return robot_ns + self._offset_ns


@dataclass(frozen=True, slots=True)
class RobotTopics:
    """The topics of one robot."""

    encoders: RosTopic
    targets: RosTopic
    diagnostics: RosTopic
    tf: RosTopic

    def camera(self, name: str) -> RosTopic:
        """The pictures of one camera."""
        namespace = self.encoders.name.rpartition("/")[0]
        topic = f"{namespace}/{ros_name(name)}/image/compressed"
        return RosTopic(topic, COMPRESSED_IMAGE, type_hash(COMPRESSED_IMAGE))


def topics_of(robot: str) -> RobotTopics:
    """Below the robot's name, but for /diagnostics and /tf, which ROS has once."""
    name = ros_name(robot)
    joints = type_hash(JOINT_STATE)
    return RobotTopics(
        RosTopic(f"/{name}/joint_states", JOINT_STATE, joints),
        RosTopic(f"/{name}/joint_targets", JOINT_STATE, joints),
        RosTopic("/diagnostics", DIAGNOSTICS, type_hash(DIAGNOSTICS)),
        RosTopic("/tf", TF, type_hash(TF), _TF_DEPTH),
    )


class Translator:
    """One robot's states and pictures."""

    def __init__(self, robot: str, skeleton: Skeleton) -> None:
        self.topics = topics_of(robot)
        self._robot = robot
        self._frame = ros_name(robot)
        self._skeleton = skeleton
        self._wall = WallTime()
        self._driven = (
            np.abs(skeleton.angles_from_joints).reshape(-1, 3, len(skeleton.joints)).sum(axis=1) > 0.0
        )
        self._told: tuple[int, str, str] = (0, "", "")
        """When the diagnostics were last told, and of which state."""
        self._heard_wall_ns = 0

    def state(self, state: RobotState, wall_ns: int) -> list[Published]:
        """Encoders, targets, frames, and once a second or at a change the diagnostics."""
        self._wall.note(state.sent_ns, wall_ns, state.instance)
        self._heard_wall_ns = wall_ns
        names = self._skeleton.joint_names
        measured = np.where(state.encoder_valid, state.position_rad, np.nan)
        read_ns = self._wall.of(state.encoder_ns)
        out: list[Published] = [
            (self.topics.encoders, joint_state(names, measured, read_ns, state.effort_nm)),
            (self.topics.targets, joint_state(names, state.setpoint_rad, self._wall.of(state.sent_ns))),
            (self.topics.tf, tf_message(self._transforms(measured), read_ns)),
        ]
        told_ns, guard, reason = self._told
        if wall_ns - told_ns >= NS_PER_S or (guard, reason) != (state.guard, state.reason):
            self._told = (wall_ns, state.guard, state.reason)
            out.append((self.topics.diagnostics, diagnostics(self._rows(state), wall_ns)))
        return out

    def silence(self, wall_ns: int) -> list[Published]:
        """The diagnostics of a robot of which nothing was heard for a second; [] while it is heard."""
        silent_s = to_s(wall_ns - self._heard_wall_ns)
        if silent_s < 1.0:
            return []
        words = f"no state for {silent_s:.0f} s" if self._heard_wall_ns else "no state yet"
        row = Diagnostic(STALE, f"{self._robot}: guard", words, self._robot, {})
        return [(self.topics.diagnostics, diagnostics([row], wall_ns))]

    def picture(self, camera: str, frame: VideoFrame) -> Published:
        """A picture, stamped when it was taken."""
        image = compressed_image(frame.body, f"{self._frame}/{camera}", self._wall.of(frame.captured_ns))
        return self.topics.camera(camera), image

    def _transforms(self, position_rad: Array) -> list[Transform]:
        """Each segment in its parent; without those that a joint drives whose angle is not known."""
        known = np.isfinite(position_rad)
        turns = relative_orientations(self._skeleton, np.nan_to_num(position_rad))
        names = self._skeleton.segment_names
        out = []
        for i, segment in enumerate(self._skeleton.segments):
            if (self._driven[i] & ~known).any():
                continue
            parent = segment.parent if segment.parent in names else "base_link"
            frames = f"{self._frame}/{parent}", f"{self._frame}/{segment.name}"
            out.append(Transform(*frames, np.array(segment.origin_m), turns[i]))
        return out

    def _rows(self, state: RobotState) -> list[Diagnostic]:
        values = {
            "state": state.guard,
            "operator": state.operator,
            "resting": ", ".join(state.resting),
            "blind_cm": f"{100.0 * max(state.blind_m, default=0.0):.1f}",
        }
        level = _LEVELS.get(state.guard, WARN)
        rows = [Diagnostic(level, f"{self._robot}: guard", state.reason or state.guard, self._robot, values)]
        for part, words in state.faults.items():
            rows.append(Diagnostic(ERROR, f"{self._robot}: {part}", words, self._robot, {}))
        return rows
