"""A recording as Foxglove, Lichtblick, Rerun and PlotJuggler open it: the robot moves with no set-up."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from common.clock import to_ms
from common.errors import CodecError
from common.latency.one_way import master_offset, one_way_ns
from common.quaternion import Array
from common.recording import Entry, RecordingStream
from common.skeleton import Skeleton
from common.wire.codec import decode
from common.wire.messages import Command, RobotState
from common.wire.video import VideoFrame, decode_frame
from deploy.viewer import protobuf
from deploy.viewer.frames import ROOT, FrameEdge, transforms
from deploy.viewer.mcap_out import ViewerFile
from deploy.viewer.urdf import urdf

ROOT_ABOVE = "tf#/"
"""The frame above the world. Rerun draws nothing in 3D without it."""
MOVING = ("align", "track")
EYES = FrameEdge("head", "", np.array([0.09, 0.0, 0.1]), np.array([0.5, -0.5, 0.5, -0.5]), None)
"""Where the simulated robot's camera sits in its head; z looks ahead, x to the right, y down."""
FOVY_RAD = math.radians(70.0)
"""Of the simulated camera. A recording does not hold that of a real camera: its scale in 3D is not right."""


def write_foxglove(path: Path, source: Path, skeleton: Skeleton) -> str:
    """Write one recording of a tap or of the link. Returns what is in the file, in words.

    Raises ModuleNotFoundError without the extra `viewer`.
    """
    import foxglove_schemas_protobuf  # noqa: F401  # before a file is begun

    with ViewerFile(path, {"from": source.name, "sha256": _digest(source)}) as out:
        viewer = _Viewer(out, skeleton)
        stream = RecordingStream(source)
        for entry in stream:
            viewer.take(entry)
    words = ", ".join(f"{topic} {count}" for topic, count in out.counts.items())
    if viewer.unreadable:
        words += f"; {viewer.unreadable} messages of another profile or version are left out"
    return words


class _Viewer:
    """Takes the messages of a recording in order."""

    def __init__(self, out: ViewerFile, skeleton: Skeleton) -> None:
        self._out = out
        self._skeleton = skeleton
        self._described = False
        self._guard: tuple[str, str] = "", ""
        self._faults: dict[str, str] = {}
        self._echoed = -1
        self._cameras: set[str] = set()
        self.unreadable = 0

    def take(self, entry: Entry) -> None:
        """One message; one that is not for viewers is left out."""
        parts = entry.topic.split("/")
        take: Callable[[Entry], None] | None = None
        if parts[-1] == "state":
            take = self._state
        elif parts[-1] == "command":
            take = self._command
        elif len(parts) > 2 and parts[-2] == "video":
            take = self._picture
        if take is None:
            return
        if not self._described:
            self._described = True
            self._out.put_string("/robot_description", urdf(self._skeleton), entry.wall_ns)
        try:
            take(entry)
        except CodecError:
            self.unreadable += 1

    def _state(self, entry: Entry) -> None:
        state = decode(entry.payload, RobotState, len(self._skeleton.joints))
        at_ns, names = entry.wall_ns, self._skeleton.joint_names
        placed = transforms(self._skeleton, state.position_rad)
        self._out.put("/tf", protobuf.frame_transforms([*placed, *self._eyes()], ROOT_ABOVE, at_ns), at_ns)
        measured = np.where(state.encoder_valid, state.position_rad, np.nan)
        self._out.put("/joint_states", protobuf.joint_states(names, measured, at_ns, state.effort_nm), at_ns)
        self._out.put("/targets", protobuf.joint_states(names, state.setpoint_rad, at_ns), at_ns)
        self._guarded(state, at_ns)
        self._latency(state, at_ns)

    def _eyes(self) -> list[tuple[FrameEdge, Array, Array]]:
        """Each camera's frame; one that has no place on the robot stands at its root."""
        heads = {segment.name for segment in self._skeleton.segments}
        found = []
        for camera in sorted(self._cameras):
            parent = EYES.parent if EYES.parent in heads else ROOT
            edge = replace(EYES, parent=parent, child=_camera_frame(camera))
            found.append((edge, edge.translation_m, edge.q_parent_from_child))
        return found

    def _guarded(self, state: RobotState, at_ns: int) -> None:
        values = {
            "state": state.guard, "reason": state.reason, "operator": state.operator,
            "moving": state.guard in MOVING,
        }  # fmt: skip
        self._out.put("/guard", protobuf.own("Guard", at_ns, values), at_ns)
        if (state.guard, state.reason) != self._guard:
            self._guard = state.guard, state.reason
            level = "ERROR" if state.guard == "estop" else "INFO" if state.guard in MOVING else "WARNING"
            self._log(level, f"{state.guard}: {state.reason}", "guard", at_ns)
        for part, words in state.faults.items():
            if self._faults.get(part) != words:
                self._log("ERROR", words, part, at_ns)
        for part in self._faults.keys() - state.faults.keys():
            self._log("INFO", "well again", part, at_ns)
        self._faults = dict(state.faults)

    def _log(self, level: str, text: str, name: str, at_ns: int) -> None:
        self._out.put("/log", protobuf.log_line(level, text, name, at_ns), at_ns)

    def _latency(self, state: RobotState, at_ns: int) -> None:
        echo = state.echo
        if echo is None or echo.sequence == self._echoed:
            return
        self._echoed = echo.sequence
        offset = master_offset(state)
        one_way = one_way_ns(echo.put_ns, echo.received_ns, offset)
        values = {
            "one_way_ms": None if one_way is None else to_ms(one_way),
            "bound_ms": to_ms(offset.bound_ns) if offset.trusted else None,
            "robot_ms": to_ms(echo.written_ns - echo.received_ns) if echo.written_ns else None,
        }
        self._out.put("/latency", protobuf.own("Latency", at_ns, values), at_ns)

    def _command(self, entry: Entry) -> None:
        command = decode(entry.payload, Command, len(self._skeleton.joints))
        known = np.where(command.valid, command.position_rad, np.nan)
        names, at_ns = self._skeleton.joint_names, entry.wall_ns
        self._out.put("/operator", protobuf.joint_states(names, known, at_ns), at_ns)

    def _picture(self, entry: Entry) -> None:
        picture: VideoFrame = decode_frame(entry.payload)
        camera = entry.topic.rpartition("/")[2]
        self._cameras.add(camera)
        frame, at_ns = _camera_frame(camera), entry.wall_ns
        self._out.put(f"/camera/{camera}", protobuf.picture(picture, frame, at_ns), at_ns)
        calibration = protobuf.camera_calibration(picture.width, picture.height, FOVY_RAD, frame, at_ns)
        self._out.put(f"/camera/{camera}/calibration", calibration, at_ns)


def _camera_frame(camera: str) -> str:
    return f"camera_{camera}"


def _digest(path: Path) -> str:
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
