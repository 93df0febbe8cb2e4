"""The formats that take a whole recording, by their names on the command line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from common.errors import RecordingError, TandemError
from common.recording import RecordingStream
from common.skeleton import Skeleton
from common.wire.topics import COMMAND, STATE

TABLE_HZ, LEARNING_HZ = 50.0, 25.0
TASK = "follow the operator"
TASK_WORD = "teleoperation"


@dataclass(frozen=True, slots=True)
class WholeOptions:
    """What the command line chose; None: the format's own default."""

    source: Path
    out: Path
    skeleton: Skeleton
    rate_hz: float | None
    task: str | None
    subject: str
    session: str


def write_whole(kind: str, options: WholeOptions) -> str:
    """Write one format; returns what is in it, in words. Raises TandemError, ModuleNotFoundError."""
    source, out, skeleton = options.source, options.out, options.skeleton
    _check_one_sender(source, (STATE.name,) if kind == "foxglove" else (STATE.name, COMMAND.name))
    if kind == "foxglove":
        from deploy.ops.convert.foxglove import write_foxglove

        return write_foxglove(out, source, skeleton)
    if kind == "parquet":
        from deploy.ops.convert.parquet import write_parquet

        return write_parquet(out, source, skeleton, options.rate_hz or TABLE_HZ)
    if kind == "lerobot":
        from deploy.ops.convert.lerobot.dataset import write_lerobot

        rate_hz = options.rate_hz or LEARNING_HZ
        if rate_hz != int(rate_hz):
            raise TandemError(
                f"--rate {rate_hz:g}: a LeRobot dataset has a whole number of frames per second"
            )
        return write_lerobot(out, source, skeleton, int(rate_hz), options.task or TASK)
    from deploy.ops.convert.bids import BidsNames, write_bids

    names = BidsNames(options.subject, options.session, options.task or TASK_WORD)
    return write_bids(out, source, skeleton, options.rate_hz or TABLE_HZ, names)


def _check_one_sender(source: Path, names: Sequence[str]) -> None:
    """Raise RecordingError where two robots, or two operators, speak: their messages would be mixed."""
    heard: dict[str, set[str]] = {name: set() for name in names}
    for entry in RecordingStream(source):
        name = entry.topic.rpartition("/")[2]
        if name in heard:
            heard[name].add(entry.topic)
    for name, keys in heard.items():
        if len(keys) > 1:
            raise RecordingError(
                f"{source}: holds {name}s of {', '.join(sorted(keys))}: record one at a time"
            )
