"""`tandem record`."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from common.errors import TandemError
from common.process.runtime import run as run_until_stopped
from deploy.report.options import Cameras, ConnectTo, LinkFile, MetricsFile, StopAfter
from deploy.report.output import in_a_folder, metrics_writer

if TYPE_CHECKING:
    from deploy.ops.record.record import RecordOptions

TapSocket = Annotated[
    Path | None,
    typer.Option(
        help="Record at a process of this host instead: the path of its `[tap] socket`. It holds what "
        "the sensors said, so that `tandem replay` can compute it again.",
    ),
]
MinutesPerFile = Annotated[
    float,
    typer.Option(
        help="Begin a new file (FILE-2.mcap, …) after this many minutes; 0: keep one file.", min=0.0
    ),
]
SessionFolder = Annotated[
    Path | None,
    typer.Option(help="With --tap: the folder of a session (`tandem session start`).", file_okay=False),
]


def record(
    out: Annotated[
        Path | None, typer.Option(help="New .mcap file to write.", dir_okay=False, callback=in_a_folder)
    ] = None,
    config: Annotated[
        Path | None,
        typer.Option(
            help="Record for good, beside the master or slave of this file, as its [recording] says.",
            dir_okay=False,
        ),
    ] = None,
    robot: Annotated[str | None, typer.Option(help="Name of the robot.")] = None,
    tap: TapSocket = None,
    connect: ConnectTo = None,
    link: LinkFile = None,
    video: Cameras = None,
    minutes_per_file: MinutesPerFile = 60.0,
    seconds: StopAfter = None,
    session: SessionFolder = None,
    may_miss: Annotated[
        bool, typer.Option("--may-miss", help="End with status 0 even if numbered messages are missing.")
    ] = False,
    metrics: MetricsFile = None,
) -> None:
    """Record a live robot's commands, states and statistics until Ctrl-C. It changes nothing.

    With --tap it records at the master itself: every sensor frame, command and state, and what the
    computation needs to be repeated.

    The robot's endpoint gives states. Commands come from an endpoint where the master listens (`[link]
    listen` in its file), or from a router. It ends with status 1 if the disk failed or messages are missing.

    With --config it records as long as the host runs: it waits for the process, begins a new file each hour,
    removes the oldest files within `keep_gb` and `max_hours`, and survives a full disk.

    Beside a master: `tandem record --tap /run/tandem/master.sock --out morning.mcap`

    For good: `tandem record --config /etc/tandem/operator.toml`

    Example: `tandem record --connect tcp/192.168.7.2:7447 --robot robot-1 --out morning.mcap`
    """
    of_a_robot = {
        "--robot": robot, "--connect": connect, "--link": link, "--video": video, "--may-miss": may_miss,
        "--metrics": metrics,
    }  # fmt: skip
    if config is not None:
        _refuse("--config", {"--tap": tap, "--out": out, "--session": session, **of_a_robot})
        _record_for_good(config)
        return
    file, each_s = _mcap(out), 60.0 * minutes_per_file if minutes_per_file else None
    if tap is not None:
        _refuse("--tap", of_a_robot)
        _record_at(tap, file, seconds, each_s, session)
        return
    if session is not None:
        raise TandemError("record: --session goes with --tap, as only a process knows what it decided")
    if robot is None:
        raise TandemError("record: name the robot by --robot, or a process's socket by --tap")
    from deploy.client.observer import link_of
    from deploy.ops.record.record import RecordOptions

    where = link_of(connect or (), link)
    options = RecordOptions(where, robot, file, tuple(video or ()), seconds, each_s, may_miss=may_miss)
    _record_robot(options, metrics)


def _refuse(source: str, others: Mapping[str, object]) -> None:
    """Raise TandemError for options that mean nothing beside a source."""
    given = [name for name, value in others.items() if value]
    if given:
        raise TandemError(
            f"record: {source} says already what is recorded; leave out {', '.join(given)}, or {source}"
        )


def _mcap(out: Path | None) -> Path:
    if out is None:
        raise TandemError(
            "record: name the file to write by --out, or a master's or slave's file by --config"
        )
    if out.suffix.lower() != ".mcap":
        raise TandemError(f"{out}: expected a name that ends in .mcap")
    return out


def _record_at(
    tap: Path, out: Path, seconds: float | None, each_s: float | None, session: Path | None
) -> None:
    from deploy.ops.record.from_tap import record_tap
    from deploy.study.session import Session

    of_study = None if session is None else Session(session)
    console = Console(stderr=True)

    async def work(stop: asyncio.Event) -> None:
        with console.status("waiting for the process") as status:
            summary = await record_tap(tap, out, stop, status.update, seconds, each_s, session=of_study)
        console.print(summary, highlight=False)

    run_until_stopped(work)


def _record_robot(options: RecordOptions, metrics: Path | None) -> None:
    from deploy.ops.record.record import record as record_until

    console = Console(stderr=True)

    async def work(stop: asyncio.Event) -> None:
        with console.status("waiting for the robot") as status:
            summary = await record_until(options, stop, status.update, metrics_writer(metrics))
        console.print(summary, highlight=False)

    run_until_stopped(work)


def _record_for_good(config: Path) -> None:
    from deploy.ops.record.steady import record_steadily, steady_options

    options = steady_options(config)
    console = Console(stderr=True)

    async def work(stop: asyncio.Event) -> None:
        with console.status("waiting for the process") as status:
            await record_steadily(options, stop, status.update)

    run_until_stopped(work)
