"""`tandem network`: the profiles, and whether this machine's emulated link is as they say."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import Progress

from common.errors import TandemError
from common.process.runtime import run, until_stopped
from deploy.ops.network.figures import DELAY_MS, LOSS_POINTS, RATE_SHARE, Measured
from deploy.ops.network.verify import measure
from deploy.ops.network.view import measured_table, profiles_table
from deploy.report.output import in_a_folder, write_json
from deploy.sim.network.network import Backend, open_network
from deploy.sim.network.profile import Profile, load_profile, profile_names

app = typer.Typer(no_args_is_help=True)


@app.callback()
def _group() -> None:
    """Show the emulated networks, and check that this machine emulates them correctly.

    Example: `tandem network list 4g`
    """


@app.command("list")
def list_profiles(
    profiles: Annotated[
        list[str] | None, typer.Argument(help="Names of profiles, or TOML files; without any, all profiles.")
    ] = None,
) -> None:
    """Show the network profiles, and the source of each number.

    Example: `tandem network list 4g`
    """
    console = Console()
    chosen = [load_profile(name) for name in profiles or profile_names()]
    console.print(profiles_table(chosen))
    for profile in chosen:
        console.print(f"[bold]{profile.name}[/bold]: {profile.about}", highlight=False)
        if profiles:
            console.print(" ".join(profile.source.split()), style="dim", highlight=False)
            outages = ", ".join(f"{outage.for_s:g} s at {outage.at_s:g} s" for outage in profile.outages)
            console.print(f"outages: {outages or 'none'}", style="dim", highlight=False)


@app.command()
def verify(
    profiles: Annotated[
        list[str] | None, typer.Argument(help="Names of profiles, or TOML files; without any, all profiles.")
    ] = None,
    seconds: Annotated[
        float, typer.Option(help="Seconds for which each profile is measured.", min=1.0, max=600.0)
    ] = 10.0,
    backend: Annotated[Backend, typer.Option(help="Program that emulates the link.")] = "auto",
    report: Annotated[
        Path | None,
        typer.Option(
            "--report", "--json", help="Write the figures as JSON.", dir_okay=False, callback=in_a_folder
        ),
    ] = None,
) -> None:
    """Measure the emulated link and compare it with its profile.

    It sends 200 packets/s both ways, then more than the link's rate. It needs root. It ends with status 1 if
    delay differs by more than 1 ms or loss by more than 0.5 percentage points.

    Example: `tandem network verify 4g adsl --seconds 30 --report network.json`
    """
    chosen = [load_profile(name) for name in profiles or profile_names()]
    console = Console()
    measured: list[Measured] = []

    async def work() -> None:
        with Progress(console=console, transient=True) as progress:
            task = progress.add_task("measuring", total=len(chosen))
            for profile in chosen:
                progress.update(task, description=f"measuring {profile.name}")
                measured.append(await _measure(profile, seconds, backend))
                progress.advance(task)

    run(lambda stop: until_stopped(stop, work()))
    _report(measured, seconds, console)
    if report is not None:
        write_json(report, {"seconds": seconds, "profiles": [each.tree() for each in measured]})
    if len(measured) < len(chosen):
        raise TandemError("interrupted: not all profiles were measured")
    off = [each.profile for each in measured if not each.kept]
    if off:
        raise TandemError(f"the emulated link differs from these profiles: {', '.join(off)}")


async def _measure(profile: Profile, seconds: float, backend: Backend) -> Measured:
    # an outage is no property of the packets that pass
    async with open_network(profile.model_copy(update={"outages": []}), backend=backend) as network:
        return await measure(network, seconds)


def _report(measured: list[Measured], seconds: float, console: Console) -> None:
    if not measured:
        return
    console.print(measured_table(measured))
    by = ", ".join(sorted({each.backend for each in measured}))
    console.print(
        f"{seconds:g} s at 200 packets/s each way, by the {by}. Red: more than {DELAY_MS:g} ms of delay or "
        f"{LOSS_POINTS:g} points of loss from what was drawn by chance, or that beyond ± of the profile, or "
        f"{RATE_SHARE:.0%} of the rate off.",
        style="dim",
        highlight=False,
    )
