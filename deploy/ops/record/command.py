"""`tandem record`."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from common.errors import TandemError
from common.process.runtime import run as run_until_stopped
from deploy.report.options import MetricsFile
from deploy.report.output import in_a_folder, metrics_writer


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
    tap: Annotated[
        Path | None,
        typer.Option(
            help="Record at a process of this host instead: the path of its `[tap] socket`. It holds what "
            "the sensors said, so that `tandem replay` can compute it again.",
        ),
    ] = None,
    connect: Annotated[
        list[str] | None,
        typer.Option(help="Endpoint to connect to, such as tcp/192.168.7.2:7447; repeat for more."),
    ] = None,
    link: Annotated[
        Path | None,
        typer.Option(
            help="Take endpoints and keys from the section [link] of this TOML file.", dir_okay=False
        ),
    ] = None,
    video: Annotated[
        list[str] | None, typer.Option(help="Also record the pictures of this camera, such as `head`.")
    ] = None,
    minutes_per_file: Annotated[
        float,
        typer.Option(
            help="Begin a new file (FILE-2.mcap, …) after this many minutes; 0: keep one file.", min=0.0
        ),
    ] = 60.0,
    seconds: Annotated[
        float | None,
        typer.Option(help="Stop after this many seconds; without it, stop with Ctrl-C.", min=0.1),
    ] = None,
    session: Annotated[
        Path | None,
        typer.Option(help="With --tap: the folder of a session (`tandem session start`).", file_okay=False),
    ] = None,
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
    from deploy.client.observer import link_of
    from deploy.ops.record.from_tap import record_tap
    from deploy.ops.record.record import RecordOptions
    from deploy.ops.record.record import record as record_until

    if config is not None:
        _record_for_good(config)
        return
    if out is None:
        raise TandemError(
            "record: name the file to write by --out, or a master's or slave's file by --config"
        )
    if out.suffix.lower() != ".mcap":
        raise TandemError(f"{out}: expected a name that ends in .mcap")
    each_s = 60.0 * minutes_per_file if minutes_per_file else None
    console = Console(stderr=True)
    if tap is not None:
        from deploy.study.session import Session

        of_study = None if session is None else Session(session)

        async def take(stop: asyncio.Event) -> None:
            with console.status("waiting for the process") as status:
                console.print(
                    await record_tap(tap, out, stop, status.update, seconds, each_s, session=of_study),
                    highlight=False,
                )

        run_until_stopped(take)
        return
    if robot is None:
        raise TandemError("record: name the robot by --robot, or a process's socket by --tap")
    where = link_of(connect or (), link)
    options = RecordOptions(where, robot, out, tuple(video or ()), seconds, each_s, may_miss=may_miss)

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
