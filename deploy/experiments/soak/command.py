"""`tandem soak`."""

from __future__ import annotations

import asyncio
import shutil
import tempfile
from contextlib import AsyncExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from common.errors import TandemError
from common.process.runtime import run as run_until_stopped
from common.process.runtime import until_stopped
from deploy.report.options import WhichRobot

if TYPE_CHECKING:
    from deploy.experiments.soak.files.events import AnyEvent
    from deploy.experiments.soak.files.options import SoakOptions
    from deploy.experiments.soak.judge.judge import JudgedSoak

REPORT_S = 60.0
"""How long stopping, judging and drawing may take after a Ctrl-C."""


Duration = Annotated[
    str, typer.Option(help="How long the robot follows the operator, such as 8h, 30m or 90s.")
]
Transport = Annotated[
    str,
    typer.Option(
        help="Transport between master and slave: tcp, udp, tls, quic, quic-datagram, ws or unixsock-stream."
    ),
]
NetworkProfile = Annotated[
    str | None,
    typer.Option(
        help="Run on two emulated hosts with this network between them: a profile "
        "such as 4g or wifi, or a TOML file (needs root)."
    ),
]
Router = Annotated[bool, typer.Option("--router", help="Connect master and slave through a router.")]
FaultNames = Annotated[
    str,
    typer.Option(
        help="Faults to inject: all, none, or names separated by commas; `--faults help` lists them."
    ),
]
FaultInterval = Annotated[
    float | None,
    typer.Option(help="Mean number of seconds between faults; without it, each kind comes twice.", min=5.0),
]
Seed = Annotated[
    int, typer.Option(help="Random seed for the fault schedule; the same seed gives the same faults.")
]
ReportFolder = Annotated[
    Path | None,
    typer.Option(help="New folder for the report and everything that is recorded.", file_okay=False),
]
EarlierSoak = Annotated[
    Path | None,
    typer.Option(help="Do not run: judge the report folder of an earlier soak.", exists=True),
]


def soak(
    duration: Duration = "10m",
    transport: Transport = "tcp",
    profile: NetworkProfile = None,
    router: Router = False,
    faults: FaultNames = "all",
    every: FaultInterval = None,
    seed: Seed = 1,
    robot_profile: WhichRobot = "nursing",
    report: ReportFolder = None,
    judge: EarlierSoak = None,
) -> None:
    """Run the whole system for hours, inject faults, and judge losses, recovery and memory growth.

    Example: `tandem soak --duration 30m --faults all --report soak-1`
    """
    from deploy.experiments.soak.faults import FAULTS, chosen
    from deploy.experiments.soak.files.options import SoakOptions, seconds
    from deploy.experiments.soak.judge.judge import judge_soak

    console = Console()
    if faults == "help":
        table = Table("fault", "what is done", box=SIMPLE_HEAD, pad_edge=False)
        table.columns[0].no_wrap = True
        for fault in FAULTS.values():
            table.add_row(fault.name, fault.words)
        console.print(table)
        return
    if judge is not None:
        _report(judge_soak(judge), judge, console)
        return
    options = SoakOptions(
        seconds(duration), transport, profile, router, faults=tuple(chosen(faults)), every_s=every, seed=seed,
        robot_profile=robot_profile,
    )  # fmt: skip
    with tempfile.TemporaryDirectory(prefix="tandem-soak-") as temporary:
        from deploy.experiments.soak.run import folder_for

        folder = folder_for(report, Path(temporary))
        run_until_stopped(lambda stop: _soak(options, folder, stop, console), shutdown_s=REPORT_S)
        _report(judge_soak(folder), folder if report is not None else None, console)


def _report(judged: JudgedSoak, folder: Path | None, console: Console) -> None:
    from deploy.experiments.soak.report.write import write_report
    from deploy.measure.verdict import counts, failed, verdict_table

    if folder is not None:
        write_report(judged, folder)
    console.print(verdict_table("criterion", judged.verdicts))
    console.print(
        f"{judged.ended}; {counts(judged.verdicts)}" + (f"; report: {folder}/report.html" if folder else "")
    )
    wrong = failed(judged.verdicts)
    if wrong:
        raise TandemError("the soak failed: " + "; ".join(f"{v.group}: {v.name}" for v in wrong))


def _print_event(event: AnyEvent, console: Console) -> None:
    """In a log file, which shows no live table, print each event as a line."""
    from deploy.experiments.soak.view import HIDDEN, line

    if not console.is_terminal and event.what.kind not in HIDDEN:
        console.print(line(event), soft_wrap=True)


async def _soak(options: SoakOptions, folder: Path, stop: asyncio.Event, console: Console) -> None:
    """Run it; whatever happens, its files are whole and say how it ended."""
    from rich.live import Live

    from deploy.experiments.soak.files.happenings import SoakEnded
    from deploy.experiments.soak.files.log import SoakLog
    from deploy.experiments.soak.run import SOAK, Soak
    from deploy.experiments.soak.stage import Stage
    from deploy.experiments.soak.watch import Watch
    from deploy.harness.host import watch_host
    from deploy.harness.link_settings import needed_age_s, open_timeout_s
    from deploy.harness.rig import open_rig
    from deploy.sim.network import open_network

    async with AsyncExitStack() as stack:
        host = await stack.enter_async_context(watch_host())
        network = None
        if options.profile is not None:
            network = await stack.enter_async_context(open_network(options.profile, seed=options.seed))
        # over a long line a robot with the default limit would take no command at all
        slave, master = [], []
        if network is not None:
            master = [f"link.open_timeout_s={open_timeout_s(network.profile)}"]
            slave = [*master, f"guard.max_age_s={needed_age_s(network.profile)}"]
        overrides = {"slave": slave, "master": master}
        rigging = open_rig(
            options.transport, overrides, options.robot_profile, routed=options.router, network=network
        )
        rig = await stack.enter_async_context(rigging)
        log: SoakLog | None = None
        watch = Watch(rig.skeleton, lambda what: log.add(what) if log else None)
        stage = Stage(rig, watch, lambda what: log.add(what) if log else None)
        log = SoakLog(folder, [*stage.names, SOAK], on_event=lambda event: _print_event(event, console))
        stack.callback(log.close)
        watch.listen(rig.link())
        how, error = "interrupted", False
        live = stack.enter_context(Live(console=console, refresh_per_second=2, transient=True))
        try:
            await until_stopped(stop, Soak(options, stage, log, host, live).run())
            how = "interrupted" if stop.is_set() else "it ran its time"
        except TandemError as wrong:
            how, error = str(wrong), True
        finally:
            log.add(SoakEnded(how, error, await stage.close()))
            for child in stage.children.values():
                if child.log.exists():
                    shutil.copy(child.log, folder / child.log.name)
