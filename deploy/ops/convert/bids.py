"""A recording as BIDS-Motion: tables of numbers and JSON, which motion laboratories share.

One tracking system is the encoders, another the operator's joint angles as commanded. The channels' types are
the specification's (BIDS 1.9 and later, Motion): JNTANG in rad, LATENCY in s since the recording began.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from common.clock import NS_PER_S
from common.errors import RecordingError
from common.quaternion import Array
from common.recording import RecordingStream
from common.skeleton import Skeleton
from deploy.recorded.held import HeldFrame, HeldFrames
from deploy.report.output import writing

BIDS_VERSION = "1.10.0"
MISSING = "n/a"


@dataclass(frozen=True, slots=True)
class BidsNames:
    """How the files are called; letters and digits only, as BIDS has it."""

    subject: str
    session: str
    task: str

    def __post_init__(self) -> None:
        for name, value in (("subject", self.subject), ("session", self.session), ("task", self.task)):
            if not re.fullmatch(r"[A-Za-z0-9]+", value):
                raise RecordingError(f"--{name} {value!r}: expected letters and digits, such as 03")

    def file(self, ending: str, tracksys: str | None = None) -> str:
        """Such as sub-03_ses-1_task-reach_tracksys-encoders_motion.tsv."""
        system = f"_tracksys-{tracksys}" if tracksys else ""
        return f"sub-{self.subject}_ses-{self.session}_task-{self.task}{system}_{ending}"


def write_bids(root: Path, source: Path, skeleton: Skeleton, fps: float, names: BidsNames) -> str:
    """Write or extend a dataset; returns what is in it, in words. Raises RecordingError."""
    frames = HeldFrames(skeleton, fps)
    rows = list(frames.of(RecordingStream(source)))
    if len(rows) < 2:
        raise RecordingError(f"{source}: holds no states of the profile {skeleton.name}; see --profile")
    folder = root / f"sub-{names.subject}" / f"ses-{names.session}" / "motion"
    if (folder / names.file("motion.tsv", "encoders")).exists():
        raise RecordingError(
            f"{folder}: this subject, session and task is there already; choose another --session"
        )
    began_s = rows[0].time_s
    time_s = np.array([frame.time_s - began_s for frame in rows])
    systems = {
        "encoders": np.array([frame.encoder_rad for frame in rows]),
        "operator": np.array([frame.operator_rad for frame in rows]),
    }
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        _write_root(root, names.subject)
        for system, angles in systems.items():
            _write_system(folder, names, system, time_s, angles, skeleton, fps)
        _write_events(folder, names, rows, began_s)
        _write_scans(folder.parent, names, sorted(systems), rows[0].wall_ns)
    return f"{len(rows)} rows at {fps:g} Hz of {len(skeleton.joints)} joints, by encoders and as commanded"


def _write_root(root: Path, subject: str) -> None:
    description = root / "dataset_description.json"
    if not description.exists():
        content = {
            "Name": "tandem",
            "BIDSVersion": BIDS_VERSION,
            "DatasetType": "raw",
            "GeneratedBy": [{"Name": "tandem"}],
        }
        description.write_text(json.dumps(content, indent=2) + "\n", "utf-8")
        text = "Motion of a telerobot and its operator, written by tandem export.\n"
        (root / "README").write_text(text, "utf-8")
    participants = root / "participants.tsv"
    known = participants.read_text("utf-8").split() if participants.exists() else ["participant_id"]
    if f"sub-{subject}" not in known:
        known.append(f"sub-{subject}")
    participants.write_text("\n".join(known) + "\n", "utf-8")


def _write_system(
    folder: Path, names: BidsNames, system: str, time_s: Array, angles: Array, skeleton: Skeleton, fps: float
) -> None:
    table = np.column_stack([time_s, angles])
    lines = ["\t".join(_cell(value) for value in row) for row in table.tolist()]
    (folder / names.file("motion.tsv", system)).write_text("\n".join(lines) + "\n", "utf-8")
    head = "name\tcomponent\ttype\ttracked_point\tunits\tsampling_frequency"
    channels = [f"latency\t{MISSING}\tLATENCY\t{MISSING}\ts\t{fps:g}"]
    channels += [f"{joint}\t{MISSING}\tJNTANG\t{joint}\trad\t{fps:g}" for joint in skeleton.joint_names]
    (folder / names.file("channels.tsv", system)).write_text("\n".join([head, *channels]) + "\n", "utf-8")
    head_json = {
        "TaskName": names.task,
        "SamplingFrequency": fps,
        "TrackingSystemName": system,
        "Manufacturer": "tandem",
        "MotionChannelCount": 1 + len(skeleton.joints),
        "JNTANGChannelCount": len(skeleton.joints),
        "LATENCYChannelCount": 1,
        "TrackedPointsCount": len(skeleton.joints),
        "RecordingDuration": float(time_s[-1]),
        "RecordingType": "continuous",
        "MissingValues": MISSING,
    }
    text = json.dumps(head_json, indent=2) + "\n"
    (folder / names.file("motion.json", system)).write_text(text, "utf-8")


def _cell(value: float) -> str:
    return f"{value:.9g}" if np.isfinite(value) else MISSING


def _write_events(folder: Path, names: BidsNames, rows: Sequence[HeldFrame], began_s: float) -> None:
    """Each stay in a state of the guard, and each time without a state."""
    lines, since = ["onset\tduration\ttrial_type"], 0
    for number in range(1, len(rows) + 1):
        if number == len(rows) or rows[number].guard != rows[since].guard:
            onset, end = rows[since].time_s - began_s, rows[min(number, len(rows) - 1)].time_s - began_s
            told = f"guard_{rows[since].guard}" if rows[since].guard else "robot_silent"
            lines.append(f"{onset:.6f}\t{end - onset:.6f}\t{told}")
            since = number
    (folder / names.file("events.tsv")).write_text("\n".join(lines) + "\n", "utf-8")


def _write_scans(session: Path, names: BidsNames, systems: Sequence[str], began_ns: int) -> None:
    path = session / f"sub-{names.subject}_ses-{names.session}_scans.tsv"
    lines = path.read_text("utf-8").splitlines() if path.exists() else ["filename\tacq_time"]
    began = datetime.fromtimestamp(began_ns / NS_PER_S, UTC).strftime("%Y-%m-%dT%H:%M:%S.%fZ")
    lines += [f"motion/{names.file('motion.tsv', system)}\t{began}" for system in systems]
    path.write_text("\n".join(lines) + "\n", "utf-8")
