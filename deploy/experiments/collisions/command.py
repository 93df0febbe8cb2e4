"""`tandem collisions`: a random operator tries to make the robot meet itself or what stands around it."""

from __future__ import annotations

import hashlib
import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from common.errors import TandemError
from deploy.harness.workers import OnProgress, jobs_here, run_each
from deploy.report.options import ReportFile
from deploy.report.output import write_json

if TYPE_CHECKING:
    from deploy.experiments.collisions.report import CollisionReport

PART = 100
"""Motions in a row, from home; parts go to workers, and a run that is stopped loses those at work."""


def collisions(
    file: Annotated[
        Path | None, typer.Argument(help="The robot's file, for its zones and limits; else the example's.")
    ] = None,
    motions: Annotated[
        int, typer.Option(help="How many motions: fresh random goals of the operator, 12.5 a second.", min=1)
    ] = 1000,
    minutes: Annotated[float, typer.Option(help="Stop after so long; 0: after all motions.", min=0.0)] = 0.0,
    seed: Annotated[int, typer.Option(help="Random seed of the operator.")] = 1,
    workers: Annotated[int, typer.Option(help="Processes; 0: one a core.", min=0, max=64)] = 1,
    resume: Annotated[
        Path | None,
        typer.Option(help="Keep what is done in this file, and go on from it.", dir_okay=False),
    ] = None,
    damper: Annotated[
        bool, typer.Option(help="Keep parts apart. Without it the run shows what would happen.")
    ] = True,
    report: ReportFile = None,
) -> None:
    """Let a random operator cross arms, and reach to the head, through the chest, into zones and anywhere.

    Each setpoint is judged: distances by closed formulas, the joints' limits, and that the robot can always
    be led back the way it came. Ctrl-C ends the run with what was found so far.

    Example: `tandem collisions slave.toml --motions 1000000 --workers 0 --resume collisions.json`
    """
    from common.config.load import load_config
    from deploy.examples.profiles import NURSING, example
    from deploy.experiments.collisions.progress import RunProgress, as_tree
    from deploy.harness.code_state import code_state
    from slave.config import SlaveConfig

    console = Console()
    path = file or example("slave", NURSING)
    load_config(path, SlaveConfig)  # a mistake is told here, not by a worker
    robot = hashlib.sha256(path.read_bytes()).hexdigest()[:16]
    run = {"code": code_state(), "robot": robot, "seed": seed, "damper": damper, "part": PART}
    progress = RunProgress(run, resume)
    progress.resume()
    parts = [part for part in range(-(-motions // PART)) if part not in progress.done]
    sizes = [(part, min(PART, motions - part * PART)) for part in parts]
    end_s = time.monotonic() + 60.0 * minutes if minutes else float("inf")
    found = progress.found
    call = partial(_part, path, seed, damper, end_s)
    with console.status("trying") as status:
        try:
            for (part, size), more in run_each(call, sizes, workers or jobs_here()):
                if more.motions == size:
                    progress.add(part, more)
                else:
                    found.add(more)  # time was up: not a whole part
                status.update(f"{found.motions} of {motions} motions; " + ("; ".join(found.wrong) or "clean"))
        except KeyboardInterrupt:
            console.print("stopped: this is what was found until then")
    if not found.ticks:
        raise TandemError("nothing was tried: give it more minutes")
    kinds = ", ".join(f"{count} {kind}" for kind, count in sorted(found.kinds.items()))
    console.print(f"{found.motions} motions ({kinds}), {found.ticks} ticks of the servo loop")
    console.print(f"a joint was held back in {100.0 * found.held_back / found.ticks:.1f} % of them")
    for what, spare_m in found.spare_m.items():
        console.print(f"{what}: least distance = margin {1000.0 * spare_m:+.2f} mm")
    console.print(f"limits exceeded in {found.beyond_limits} ticks; line died {found.stops} times")
    console.print(f"stuck on the straight way home {found.stuck} times; on the way it came {found.trapped}")
    p50, p99 = found.tick_at_most_us(0.5), found.tick_at_most_us(0.99)
    console.print(f"a step of the limiter, CPU time: half within {p50} µs, 99 % within {p99} µs")
    if report is not None:
        write_json(report, {**as_tree(found), "seed": seed, "motions": found.motions, "wrong": found.wrong})
    if found.wrong:
        raise TandemError("; ".join(found.wrong))


def _part(
    path: Path, seed: int, damper: bool, end_s: float, item: tuple[int, int], tell: OnProgress
) -> CollisionReport:
    from common.config.load import load_config
    from deploy.experiments.collisions.trial import CollisionTrial
    from slave.config import SlaveConfig

    trial = CollisionTrial(load_config(path, SlaveConfig), damper)
    found = trial.run(seed, *item, going_on=lambda: time.monotonic() < end_s)
    tell(found.motions)
    return found
