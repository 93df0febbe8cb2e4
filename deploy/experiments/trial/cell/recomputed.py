"""Computes a cell from its recording alone: messages, settings, limits and profile are all in that file."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import msgpack

from common.errors import CodecError, RecordingError
from common.metrics.tree import from_tree
from common.recording import read_recording
from common.recording.reader import Entry
from common.wire.codec import decode
from common.wire.messages import Command, RobotState, Statistics, Truth
from deploy.experiments.trial.cell.judge import judged
from deploy.experiments.trial.cell.plan import CellKey
from deploy.experiments.trial.cell.recording import CellCourse, CellMessages, on_masters_clock
from deploy.experiments.trial.cell.result import Cell
from deploy.experiments.trial.cell.tape import (
    AFTER,
    CONFIG,
    COURSE,
    FILES,
    JUDGED,
    KEY,
    SETTINGS,
    STRETCH,
    CourseFacts,
)
from deploy.harness.observer import KINDS, Heard
from deploy.recorded.recorded_config import config_of
from slave.config import SlaveConfig


def recompute(path: Path) -> Cell:
    """The cell of a recording. Raises RecordingError where it is not whole or not one of a trial's cell."""
    recording = read_recording(path)
    about = recording.metadata
    try:
        key = from_tree(CellKey, json.loads(about[KEY]))
        settings: dict[str, str] = json.loads(about[SETTINGS])
        held = (json.loads(about[CONFIG]), json.loads(about[FILES]))
    except (KeyError, ValueError, CodecError):
        raise RecordingError(f"{path.name}: not the recording of a trial's cell") from None
    with config_of(SlaveConfig, path.name, held, about.get("tandem", "")) as config:
        try:
            course, ended = _course(recording.entries, len(config.skeleton.joints))
        except CodecError as error:
            raise RecordingError(f"{path.name}: a message cannot be read ({error})") from None
        if course is None:
            raise RecordingError(f"{path.name}: it is not whole{recording.cut and f' ({recording.cut})'}")
        return judged(key, course, config, settings, ended)


def _course(entries: list[Entry], joints: int) -> tuple[CellCourse | None, tuple[str, ...]]:
    """The course, and how processes ended; None where the end is missing. Raises CodecError."""
    stretches: dict[str, list[Heard]] = {}
    now, facts = "", None
    for entry in entries:
        if entry.topic == STRETCH:
            now = str(msgpack.unpackb(entry.payload))
        elif entry.topic == COURSE:
            facts = from_tree(CourseFacts, msgpack.unpackb(entry.payload))
        elif (kind := KINDS.get(entry.topic.rpartition("/")[2])) is not None:
            stretches.setdefault(now, []).append(decode(entry.payload, kind, joints))
    if facts is None:
        return None, ()
    return _of(facts, {name: by_kind(heard) for name, heard in stretches.items()}), facts.ended


def _of(facts: CourseFacts, stretches: Mapping[str, CellMessages]) -> CellCourse:
    nothing = by_kind([])
    judged_time = stretches.get(JUDGED, nothing)
    if not facts.shared_clock:
        judged_time = replace(judged_time, states=on_masters_clock(judged_time.states))
    return CellCourse(
        judged=judged_time,
        max_age_s=facts.max_age_s,
        shared_clock=facts.shared_clock,
        after=stretches.get(AFTER, nothing) if facts.has_after else None,
        outage=facts.outage,
        cpu_percent=dict(facts.cpu_percent),
        up_bytes_s=facts.up_bytes_s,
        down_bytes_s=facts.down_bytes_s,
        remarks=facts.remarks,
    )


def by_kind(heard: list[Heard]) -> CellMessages:
    """Messages by kind, in the order they came."""
    return CellMessages(
        commands=[m for m in heard if isinstance(m, Command)],
        states=[m for m in heard if isinstance(m, RobotState)],
        truth=[m for m in heard if isinstance(m, Truth)],
        statistics=[m for m in heard if isinstance(m, Statistics)],
    )
