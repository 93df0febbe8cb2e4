"""`tandem trial`: which transport suits which care task over which network."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from common.errors import NetworkError, TandemError
from common.process.runtime import run as run_until_stopped
from deploy.experiments.trial.cell.options import (
    Blinded,
    LinkFile,
    MaxAge,
    Motion,
    Networks,
    OutageSeconds,
    PeopleFile,
    Record,
    Remote,
    ReportFolder,
    Router,
    Seconds,
    Seed,
    Slower,
    Strategies,
    Tasks,
)
from deploy.experiments.trial.paths.command import paths
from deploy.report.options import WhichRobot

if TYPE_CHECKING:
    from deploy.experiments.trial.cell.plan import TrialPlan
    from deploy.experiments.trial.progress import Progress
    from deploy.experiments.trial.run import RunCell
    from deploy.study.blinding import BlindKey

app = typer.Typer(invoke_without_command=True, no_args_is_help=False, rich_markup_mode="markdown")

app.command()(paths)
SHORTEST_OUTAGE_S = 1.0
"""A robot need not hold in a shorter outage, so its recovery could not be judged."""
STOP_S = 30.0
"""From a Ctrl-C until the cell's processes and hosts are gone."""


@app.callback()
def trial(
    context: typer.Context,
    transports: Annotated[
        str | None, typer.Option(help="Transports, separated by commas, or `all`; else tcp,udp.")
    ] = None,
    profiles: Networks = "4g",
    strategies: Strategies = "latest,predict",
    repeat: Annotated[int, typer.Option(help="Number of runs of each combination.", min=1, max=100)] = 3,
    seconds: Seconds = 20.0,
    outage: OutageSeconds = 2.0,
    motion: Motion = None,
    slower: Slower = None,
    people: PeopleFile = None,
    robot_profile: WhichRobot = "nursing",
    seed: Seed = 1,
    router: Router = False,
    blinded: Blinded = None,
    max_age: MaxAge = 0.0,
    report: ReportFolder = Path("trial"),
    record: Record = True,
    tasks: Tasks = None,
    remote: Remote = None,
    link: LinkFile = None,
) -> None:
    """Run each transport over each network with each tracking strategy, and rank them for each care task.

    Each run starts a fresh master and robot on two emulated hosts (network namespaces, needs root), plays the
    same motion, then an outage. The folder gets `report.html`, `report.json` and `cells.csv`. After Ctrl-C,
    run the same command again to continue.

    Example: `tandem trial --transports tcp,udp,quic --profiles lan,4g --repeat 3 --report trial`
    """
    if context.invoked_subcommand is not None:
        return
    from deploy.experiments.trial.cell.choice import choose
    from deploy.experiments.trial.cell.plan import TrialPlan

    if motion == "capture":
        _follow_people(robot_profile, choose("--strategies", strategies), (people, slower, seed, report))
        return
    if people is not None or slower is not None:
        raise TandemError("--people and --slower are for --motion capture: add it, or leave them out")
    if 0.0 < outage < SHORTEST_OUTAGE_S:
        raise TandemError(f"--outage {outage:g}: expected 0, or {SHORTEST_OUTAGE_S:g} s or longer")
    networks = (profiles,) if remote else choose("--profiles", profiles)
    hidden = None if blinded is None else _hidden(blinded, transports, report, remote)
    plan = TrialPlan(
        transports=choose("--transports", transports or "tcp,udp") if hidden is None else hidden.codes,
        blinded="" if hidden is None else hidden.commitment, profiles=networks,
        strategies=choose("--strategies", strategies), repeat=repeat, seconds=seconds,
        outage_s=0.0 if remote else outage, robot=robot_profile, motion=motion or _own_motion(robot_profile),
        seed=seed, router=router,
        max_age_s=max_age, hosts=remote or "namespaces",
    )  # fmt: skip
    if remote is None:
        _run_here(plan, report, tasks, record, hidden)
    else:
        _run_remote(plan, report, tasks, record, link)


def _follow_people(
    robot_profile: str, strategies: tuple[str, ...], chosen: tuple[Path | None, float | None, int, Path]
) -> None:
    from common.skeleton import load_skeleton
    from deploy.experiments.trial.people.view import run_people_trial
    from deploy.sim.suit.people import PeopleConfig

    if robot_profile != "nursing":
        raise TandemError(f"--robot-profile {robot_profile}: --motion capture is of the profile nursing")
    people, slower, seed, folder = chosen
    skeleton = load_skeleton(robot_profile)
    run_people_trial(PeopleConfig(file=people), skeleton, strategies, slower, seed, folder, Console())


def _own_motion(robot_profile: str) -> str:
    from common.config.load import load_config
    from deploy.examples.profiles import example
    from deploy.sim.suit.config import SuitConfig

    return str(load_config(example("suit", robot_profile), SuitConfig).motion)


@app.command()
def serve(
    config: Annotated[
        Path | None,
        typer.Argument(help="The robot's TOML file; without it, the simulated robot is used.", exists=True),
    ] = None,
    listen: Annotated[
        str, typer.Option(help="Endpoint at which this host waits for `tandem trial --remote`.")
    ] = "tcp/0.0.0.0:7440",
    address: Annotated[str, typer.Option(help="Address at which the slaves listen.")] = "0.0.0.0",
    port: Annotated[int, typer.Option(help="Port at which the slaves listen.", min=1, max=65535)] = 7447,
    max_age: Annotated[
        float,
        typer.Option(
            help="Largest age limit, in seconds, that the operator's host may set for the guard.",
            min=0.05,
            max=2.0,
        ),
    ] = 1.0,
) -> None:
    """Serve a trial on the robot's host: start a fresh slave for each run that the operator's host asks for.

    Anyone who reaches the endpoint can start a slave and engage the robot. Use it on a network you trust, or
    listen at tls/… with keys in the robot's file.

    Example: `tandem trial serve slave.toml --listen tcp/0.0.0.0:7440`
    """
    from deploy.examples.profiles import example
    from deploy.experiments.trial.remote.serve import ServeOptions
    from deploy.experiments.trial.remote.serve import serve as serve_trial

    options = ServeOptions(config or example("slave"), listen, address, port, max_age)
    run_until_stopped(lambda stop: serve_trial(options, stop), STOP_S)


@app.command()
def verify(
    folder: Annotated[Path, typer.Argument(help="Report folder of a trial.", exists=True, file_okay=False)],
    tasks: Tasks = None,
) -> None:
    """Compute a trial's figures and tables again from its recordings, and compare them with the folder's.

    The recordings hold everything that this needs, so it works on any machine. A seal (`tandem session
    seal`) is verified first. It ends with status 1 and names the bytes, lines and figures that differ.
    Without recordings, the tables of a sealed trial are computed from its cells; one that has neither
    recordings nor a seal proves nothing, which is status 1 too.

    Example: `tandem trial verify trial`
    """
    from deploy.experiments.trial.cell.folder import Folder
    from deploy.experiments.trial.report.verify import differences
    from deploy.study.seal import SEAL
    from deploy.study.seal import verify as verify_seal

    sealed = (folder / SEAL).exists()
    changed = verify_seal(folder)[1] if sealed else []
    for one in changed:
        typer.echo(f"{one.name}: {one.words}")
    checked = differences(Folder(folder), tasks, lambda slug: typer.echo(f"computing {slug}", err=True))
    for words in checked.differences:
        typer.echo(words)
    given = "recordings give" if checked.recomputed else "cells give"
    if changed or checked.differences:
        count = len(changed) + len(checked.differences)
        raise TandemError(f"{folder}: {count} things are not as sealed, or not what the {given}")
    if not sealed and not checked.recomputed:
        raise TandemError(
            f"{folder}: nothing proves its cells: no recording was computed, and there is no seal; "
            "the tables are what the cells give. Run the trial with --record, or seal it by "
            "`tandem session seal`"
        )
    words = "the seal is whole" if sealed else "it is not sealed"
    from_files = f"{checked.recomputed} of {checked.cells} cells were computed from their recordings"
    typer.echo(f"{folder}: every table is what the {given}; {from_files}; {words}")


@app.command()
def report(
    folder: Annotated[Path, typer.Argument(help="Report folder of a trial.", exists=True, file_okay=False)],
    tasks: Tasks = None,
) -> None:
    """Build the report again from the results in the folder, with other weights if you like.

    Example: `tandem trial report trial --tasks my-tasks.toml`
    """
    _finish(folder, tasks, Console())


def _hidden(key: Path, transports: str | None, report: Path, remote: str | None) -> BlindKey:
    """The key of a blinded trial. Raises TandemError where it cannot be run."""
    from deploy.experiments.trial.cell.choice import why_impossible
    from deploy.study.blinding import read_key

    if transports is not None or remote is not None:
        raise TandemError("--blinded: expected without --transports and --remote; the key names transports")
    hidden = read_key(key, report)
    if any(why_impossible(condition.transport) for condition in hidden.conditions.values()):
        raise TandemError(f"{key}: one of its transports does not cross hosts: draw a key without it")
    return hidden


def _run_here(plan: TrialPlan, path: Path, tasks: Path | None, record: bool, hidden: BlindKey | None) -> None:
    from functools import partial

    from deploy.experiments.trial.cell.stage import run_cell
    from deploy.sim.network.namespaces import why_not

    reason = why_not()
    if reason is not None:
        raise NetworkError(f"{reason}; with the robot on another host, no such rights are needed: --remote")
    _run(plan, path, tasks, partial(run_cell, folder=path if record else None, hidden=hidden))


def _run_remote(plan: TrialPlan, path: Path, tasks: Path | None, record: bool, link: Path | None) -> None:
    from dataclasses import replace
    from functools import partial

    from common.config.load import load_config
    from deploy.experiments.trial.remote.operator import run_remote_cell
    from master.config import MasterConfig
    from slave.guard.config import GuardConfig

    tls = None if link is None else load_config(link, MasterConfig).link.tls
    plan = replace(plan, max_age_s=plan.max_age_s or GuardConfig().max_age_s)
    _run(plan, path, tasks, partial(run_remote_cell, tls=tls, folder=path if record else None))


def _run(plan: TrialPlan, path: Path, tasks: Path | None, run_cell: RunCell) -> None:
    from deploy.experiments.trial.cell.folder import Folder
    from deploy.experiments.trial.report.tasks import TASKS, load_tasks
    from deploy.experiments.trial.run import run_trial

    console, folder = Console(), Folder(path)
    load_tasks(tasks or TASKS)  # its mistakes now, not after an hour
    progress: Progress | None = None

    async def work(stop: asyncio.Event) -> None:
        nonlocal progress
        progress = await run_trial(plan, folder, run_cell, stop, console)

    run_until_stopped(work, STOP_S)
    # after the loop: neither a signal nor the shutdown's deadline cuts the report short
    _finish(path, tasks, console)
    if progress is not None and progress.done < progress.total:
        left = progress.total - progress.done
        raise TandemError(f"interrupted with {left} cells to go: run the same command again to continue")
    if progress is not None and progress.failed:
        raise TandemError(f"{progress.failed} cells failed: the same command tries them again")


def _finish(path: Path, tasks: Path | None, console: Console) -> None:
    from deploy.experiments.trial.cell.folder import Folder
    from deploy.experiments.trial.report.tasks import TASKS
    from deploy.experiments.trial.report.write import HTML, write
    from deploy.experiments.trial.view import print_findings

    findings = write(Folder(path), tasks or TASKS)
    print_findings(findings, console)
    console.print(f"\nreport: {path / HTML}", highlight=False, soft_wrap=True)
