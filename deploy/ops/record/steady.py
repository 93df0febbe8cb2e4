"""Records whatever a host's process says, as long as the host runs: `tandem record --config FILE`.

It waits for the process, records it, and waits again once the process has ended. A full disk ends a file and
not the recorder: it begins the next file once there is room.
"""

from __future__ import annotations

import asyncio
import logging
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from pydantic import ConfigDict

from common.clock import NS_PER_S, Clock, wall_ns
from common.config.console import ConsoleConfig
from common.config.load import load_config
from common.config.section import Section
from common.errors import ConfigError, ConfigMistake, TandemError
from common.log.throttle import LogThrottle
from common.process.runtime import until_stopped
from common.recording.config import RecordingConfig
from common.tap.config import TapConfig
from deploy.ops.record.from_tap import record_tap
from deploy.ops.record.retention import remove

log = logging.getLogger(__name__)
RETRY_S = 1.0
FULL_S = 10.0
"""Between two looks at a disk that was full."""
ROOM_BYTES = 50_000_000
"""Room for some minutes: with less no file is begun."""
TIDY_S = 60.0
QUIET_NS = 600 * NS_PER_S
"""A disk that stays full is said again after this time."""


class RecordedSide(Section):
    """What the recorder reads of a master's or a slave's file; all else is for that process."""

    model_config = ConfigDict(extra="ignore")
    tap: TapConfig = TapConfig()
    recording: RecordingConfig = RecordingConfig()
    console: ConsoleConfig = ConsoleConfig()


@dataclass(frozen=True, slots=True)
class SteadyOptions:
    """What a file asks for."""

    socket: Path
    folder: Path
    name: str
    """Begins the name of each file."""
    config: RecordingConfig
    study: Path | None = None
    """The folder of a study (`[console] study`): its sessions' marks are recorded, within their consent."""


def steady_options(file: Path) -> SteadyOptions:
    """What a master's or slave's file asks for. Raises ConfigError."""
    side = load_config(file, RecordedSide)
    if mistakes := side.recording.mistakes_with(side.tap.socket):
        raise ConfigError(file, mistakes)
    if side.recording.folder is None or side.tap.socket is None:
        raise TandemError(f"{file}: [recording] folder is not set: name a folder for the recordings")
    if not side.recording.folder.is_dir():
        wrong = ConfigMistake("recording.folder", str(side.recording.folder), "a folder that exists")
        raise ConfigError(file, [wrong])
    return SteadyOptions(
        side.tap.socket, side.recording.folder, file.stem, side.recording, side.console.study
    )


async def record_steadily(
    options: SteadyOptions,
    stop: asyncio.Event,
    report: Callable[[str], None],
    clock: Clock = wall_ns,
    room: Callable[[Path], int] = lambda folder: shutil.disk_usage(folder).free,
    retry_s: tuple[float, float] = (RETRY_S, FULL_S),
) -> None:
    """Record until `stop` is set. `clock`: time of day; `room`: free bytes of a folder's disk."""
    tidying = asyncio.create_task(_tidy(options, clock))
    try:
        await until_stopped(stop, _again_and_again(options, stop, report, clock, room, retry_s))
    finally:
        tidying.cancel()


async def _again_and_again(
    options: SteadyOptions,
    stop: asyncio.Event,
    report: Callable[[str], None],
    clock: Clock,
    room: Callable[[Path], int],
    retry_s: tuple[float, float],
) -> None:
    throttle = LogThrottle(QUIET_NS)
    while True:
        if room(options.folder) < ROOM_BYTES:
            if throttle.passes(clock()):
                log.error("%s: no room on the disk; recording goes on once there is", options.folder)
            await asyncio.sleep(retry_s[1])
            continue
        try:
            words = await record_tap(
                options.socket, _name(options, clock()), stop, report,
                each_s=60.0 * options.config.minutes_per_file, ends_when_failed=True,
                study=options.study,
            )  # fmt: skip
            log.info("%s", words)
        except TandemError as error:
            if options.socket.is_socket():
                log.error("%s", error)
            report(f"waiting for {options.socket}: {error}")
        await asyncio.sleep(retry_s[0])


def _name(options: SteadyOptions, now_ns: int) -> Path:
    """Such as operator-20261130T081500.123Z.mcap: they sort by time."""
    begun = datetime.fromtimestamp(now_ns // NS_PER_S, UTC).strftime("%Y%m%dT%H%M%S")
    return options.folder / f"{options.name}-{begun}.{now_ns // 1_000_000 % 1000:03}Z.mcap"


async def _tidy(options: SteadyOptions, clock: Clock) -> None:
    while True:
        await asyncio.to_thread(remove, options.folder, options.name, options.config, clock())
        await asyncio.sleep(TIDY_S)
