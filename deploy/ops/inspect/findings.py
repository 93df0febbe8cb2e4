"""What one pass through each file finds: contents, guard events, and the joints over time for pictures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from common.clock import to_s
from common.recording import ChainCheck, Entry, RecordingStream, check_recording
from common.skeleton import Skeleton
from deploy.measure.ahead import AheadScore
from deploy.ops.inspect.foretold import ForetoldRobot
from deploy.ops.inspect.guard_changes import GuardChange, GuardChanges
from deploy.ops.inspect.jitter.robot_side import FOLLOWS
from deploy.ops.inspect.limited import LimitedJoints
from deploy.ops.inspect.pictures import draw_events, draw_joints, make_folder
from deploy.ops.inspect.thinned import ThinnedJoints
from deploy.recorded.contents import Contents, Survey
from deploy.recorded.profile import recorded_skeleton
from deploy.recorded.robots import robot_of


@dataclass(frozen=True, slots=True)
class FileFindings:
    """One file."""

    path: Path
    contents: Contents
    events: Sequence[GuardChange]
    more_events: int
    chain: ChainCheck
    """What the hashes in it say."""
    unread: str = ""
    """Why the joints of its states could not be read; empty where they could."""
    limited_s: dict[str, float] = field(default_factory=dict)
    """By joint, for how long a limit held it back."""
    foretold: dict[str, AheadScore] = field(default_factory=dict)
    """By robot, how well the page foretold where it is by now."""

    @property
    def span_s(self) -> float:
        """From its first message to its last."""
        topics = self.contents.topics.values()
        first, last = (
            min((t.first_ns for t in topics), default=0),
            max((t.last_ns for t in topics), default=0),
        )
        return to_s(last - first)

    @property
    def follows_s(self) -> float:
        """When the robot was first heard to follow, since the recording began; 0 where it was never heard."""
        return next((event.at_s for event in self.events if event.state == FOLLOWS), 0.0)

    def tree(self) -> dict[str, object]:
        """Plain values for JSON."""
        guard = [event.tree() for event in self.events]
        return {
            **self.contents.tree(),
            "span_s": self.span_s,
            "guard": guard,
            "more_guard": self.more_events,
            "unread": self.unread,
            "limited_s": self.limited_s,
            "chain": asdict(self.chain),
            "foretold": {robot: asdict(score) for robot, score in self.foretold.items()},
        }


def look_into(
    files: Sequence[Path], profile: str | None = None, plots: Path | None = None
) -> tuple[list[FileFindings], Skeleton]:
    """Go through each file once. Raises RecordingError where one is none of tandem's."""
    found = []
    contents = [(path, RecordingStream(path)) for path in files]
    skeleton = recorded_skeleton(files, profile)
    for number, (path, stream) in enumerate(contents):
        survey, guards, thinned = Survey(), dict[str, GuardChanges](), ThinnedJoints(skeleton)
        limited = LimitedJoints(skeleton.joint_names)
        foretold: dict[str, ForetoldRobot] = {}
        began: Entry | None = None
        for entry in _each(stream):
            began = began or entry
            survey.take(entry)
            # a slave's own recording is of one robot, and has topics without its name
            role = (stream.metadata or {}).get("role")
            robot = "" if role == "slave" else robot_of(entry.topic)
            if robot not in guards:
                guards[robot] = GuardChanges(skeleton.joint_names, began, robot)
            guards[robot].take(entry)
            thinned.take(entry)
            limited.take(entry)
            if role == "master":
                foretold.setdefault(robot, ForetoldRobot(skeleton)).take(entry)
        for guard in guards.values():
            guard.end()
        events = sorted((event for guard in guards.values() for event in guard.found), key=lambda e: e.at_ns)
        more = sum(guard.more for guard in guards.values())
        chain, held_s, scores = check_recording(path), limited.seconds(), _scores(foretold)
        unread = _unread(thinned, skeleton)
        found.append(FileFindings(path, survey.contents(stream), events, more, chain, unread, held_s, scores))
        if plots is not None:
            folder = plots if number == 0 else plots / path.stem
            make_folder(folder)
            draw_events(folder, events, skeleton.joint_names)
            if len(thinned.time_s) > 1:
                draw_joints(
                    folder / "joints.png", np.array(thinned.time_s), np.array(thinned.position_rad),
                    np.array(thinned.setpoint_rad), skeleton.joint_names,
                )  # fmt: skip
    return found, skeleton


def _unread(thinned: ThinnedJoints, skeleton: Skeleton) -> str:
    if thinned.read or not thinned.other:
        return ""
    return (
        f"its states have other joints than the profile {skeleton.name} ({len(skeleton.joints)}): "
        "give the robot's own as --profile FOLDER"
    )


def _scores(foretold: Mapping[str, ForetoldRobot]) -> dict[str, AheadScore]:
    scores = {robot: one.score() for robot, one in foretold.items()}
    return {robot: score for robot, score in scores.items() if score is not None}


def _each(stream: RecordingStream) -> Iterator[Entry]:
    yield from stream
