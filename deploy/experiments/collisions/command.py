"""`tandem collisions`: a random operator tries to make the robot meet itself or what stands around it."""

from __future__ import annotations

import time
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from common.errors import TandemError
from deploy.report.options import ReportFile
from deploy.report.output import write_json

CHUNK = 20


def collisions(
    file: Annotated[
        Path | None, typer.Argument(help="The robot's file, for its zones and limits; else the example's.")
    ] = None,
    motions: Annotated[int, typer.Option(help="How many motions of the operator.", min=1)] = 1000,
    minutes: Annotated[float, typer.Option(help="Stop after so long; 0: after all motions.", min=0.0)] = 0.0,
    seed: Annotated[int, typer.Option(help="Random seed of the operator.")] = 1,
    damper: Annotated[
        bool, typer.Option(help="Keep parts apart. Without it the run shows what would happen.")
    ] = True,
    report: ReportFile = None,
) -> None:
    """Let a random operator cross arms, and reach to the head, through the chest, into zones and anywhere.

    Each setpoint is judged: distances by closed formulas, the joints' limits, and that the robot comes home.

    Example: `tandem collisions slave.toml --motions 1000`
    """
    from common.config.load import load_config
    from deploy.examples.profiles import NURSING, example
    from deploy.experiments.collisions.trial import CollisionTrial
    from slave.config import SlaveConfig

    console = Console()
    end_s = time.monotonic() + 60.0 * minutes
    trial = CollisionTrial(load_config(file or example("slave", NURSING), SlaveConfig), seed, damper)
    found = trial.report
    with console.status("trying") as status:
        while (made := found.kinds.total()) < motions and (not minutes or time.monotonic() < end_s):
            trial.run(min(CHUNK, motions - made))
            status.update(f"{found.kinds.total()} motions")
    kinds = ", ".join(f"{count} {kind}" for kind, count in sorted(found.kinds.items()))
    console.print(f"{found.kinds.total()} motions ({kinds}), {found.ticks} ticks of the servo loop")
    console.print(f"a joint was held back in {100.0 * found.held_back / found.ticks:.1f} % of them")
    for what, spare_m in found.spare_m.items():
        console.print(f"{what}: least distance = margin {1000.0 * spare_m:+.2f} mm")
    console.print(f"limits exceeded in {found.beyond_limits} ticks; stuck {found.stuck} times")
    console.print("a step, CPU time: " + ", ".join(f"{k} {us:.0f} µs" for k, us in found.tick_us.items()))
    if report is not None:
        write_json(report, {**asdict(found), "kinds": dict(found.kinds), "seed": seed, "wrong": found.wrong})
    if found.wrong:
        raise TandemError("; ".join(found.wrong))
