"""Keeps the messages of one cell in a recording, from which its figures are computed, now and ever after.

The head holds the cell's key, the settings, the network and the slave's configuration with its files; the
messages are as they came; the last one (`COURSE`) says what no message does. A recording without it is not
whole: the cell was interrupted, the disk failed, or the recording reached its largest size.
"""

from __future__ import annotations

import json
import platform
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path

import msgpack
import numpy as np

from common.clock import monotonic_ns
from common.metrics.tree import to_tree
from common.recording import McapRecorder
from common.wire.topics import Topic
from common.wire.version import software
from deploy.experiments.trial.cell.plan import CellKey
from deploy.experiments.trial.cell.recording import CellCourse, ScriptedOutage
from deploy.harness.rig import OPERATOR, ROBOT
from deploy.report.output import writing
from master.journal.context import embedded
from slave.config import SlaveConfig

RECORDINGS = "recordings"
"""The folder of the recordings, in that of the trial."""
STRETCH, COURSE = "trial/stretch", "trial/course"
JUDGED, AFTER, NEITHER = "judged", "after", ""
CONFIG, FILES, KEY, SETTINGS = "slave_config", "slave_files", "cell", "settings"
MOST_BYTES = 500_000_000
"""Of payload in one recording, before compression: more than an hour of one cell."""
WAITING = 100_000
"""Messages that may wait for the disk: some 6 minutes."""
_NOT_READ = {"link", "tap", "recording", "process", "console", "voice", "camera", "estop", "call", "clock"}
"""Sections of the slave's file that no figure depends on; endpoints and keys are not to be shared."""


@dataclass(frozen=True, slots=True)
class CourseFacts:
    """What no message says of a course: all fields of CellCourse but the messages."""

    max_age_s: float
    shared_clock: bool
    has_after: bool
    outage: ScriptedOutage | None = None
    cpu_percent: Mapping[str, float] = field(default_factory=dict)
    up_bytes_s: float | None = None
    down_bytes_s: float | None = None
    remarks: tuple[str, ...] = ()
    ended: tuple[str, ...] = ()
    """How processes ended that should not have: remarks after the course's own."""


def facts_of(course: CellCourse, ended: tuple[str, ...]) -> CourseFacts:
    """A course without its messages."""
    return CourseFacts(
        max_age_s=course.max_age_s,
        shared_clock=course.shared_clock,
        has_after=course.after is not None,
        outage=course.outage,
        cpu_percent=course.cpu_percent,
        up_bytes_s=course.up_bytes_s,
        down_bytes_s=course.down_bytes_s,
        remarks=course.remarks,
        ended=ended,
    )


def recording_of(folder: Path, key: CellKey) -> Path:
    """Where a cell's recording lies in the folder of its trial."""
    return folder / RECORDINGS / f"{key.slug}.mcap"


def head(key: CellKey, config: SlaveConfig, settings: Mapping[str, str]) -> dict[str, str]:
    """What the recording's head says, so that no other file is needed. Raises OSError."""
    table, files = embedded(config.profile, config.model_dump(exclude=_NOT_READ))
    return {
        "robot": ROBOT,
        "profile": config.skeleton.name,
        "joints": json.dumps(list(config.skeleton.joint_names)),
        "payload": "msgpack, see common/wire/codec.py",
        "tandem": software().tandem,
        "numpy": np.__version__,
        "machine": f"{platform.machine()} {platform.system()}",
        KEY: json.dumps(asdict(key)),
        SETTINGS: json.dumps(dict(settings)),
        CONFIG: table,
        FILES: files,
    }


class CellTape:
    """Writes one recording. A failing disk costs the recording, never the cell."""

    def __init__(self, path: Path, about: Mapping[str, str], most_bytes: int = MOST_BYTES) -> None:
        """Replaces what an earlier run of the same cell left. Raises TandemError where it cannot be made."""
        with writing(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            path.unlink(missing_ok=True)
        self.path = path
        self._recorder = McapRecorder(path, about, capacity=WAITING)
        self._left = most_bytes
        self._full = False

    def hear(self, topic: Topic, payload: bytes, arrived_ns: int) -> None:
        """Keep one message as it came."""
        self._put(topic.of(OPERATOR).key_for(ROBOT), payload, arrived_ns)

    def stretch(self, name: str) -> None:
        """All messages from here on are of that stretch: JUDGED, AFTER or NEITHER."""
        self._put(STRETCH, msgpack.packb(name), monotonic_ns())

    def close(self, facts: CourseFacts | None) -> str:
        """Close the file; without `facts` it is not whole. Returns why it is not, empty where it is."""
        if facts is not None and not self.fault:
            self._put(COURSE, msgpack.packb(to_tree(facts)), monotonic_ns())
        self._recorder.close()
        return self.fault

    @property
    def fault(self) -> str:
        """Why something is missing from it; empty where nothing is."""
        counters = self._recorder.counters
        if counters.failed:
            return counters.failed
        if self._full:
            return f"it reached its largest size, {MOST_BYTES / 1e6:.0f} MB of messages"
        return "the disk was too slow" if counters.refused + counters.lost else ""

    def _put(self, topic: str, payload: bytes, at_ns: int) -> None:
        if self._full:
            return
        self._left -= len(payload)
        if self._left < 0:
            self._full = True
            return
        self._recorder.put(topic, payload, at_ns)
