"""`tandem calibrate live`: guides a person at the suit, records, computes, writes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from deploy.calibrate.options import HemisphereOption
from deploy.report.options import AsJson, Overrides, ReportFile

if TYPE_CHECKING:
    import asyncio

    from deploy.calibrate.live.guide import GuideOptions, What
    from deploy.calibrate.live.run import LiveRecordings
    from master.config import MasterConfig


def live(
    config: Annotated[
        Path,
        typer.Argument(metavar="MASTER.toml", help="The master's TOML file, which names nodes and buses."),
    ],
    out: Annotated[
        Path, typer.Option(help="Folder for the calibration files NODE.toml, pictures and recordings.")
    ] = Path("calibration"),
    what: Annotated[
        str, typer.Option(help="Steps to do, separated by commas: imu, mag, align.")
    ] = "imu,mag,align",
    still_s: Annotated[float, typer.Option(help="Seconds to rest in each attitude.", min=1.0)] = 3.0,
    attitudes: Annotated[int, typer.Option(help="Number of attitudes to rest in.", min=12, max=100)] = 20,
    tumble_s: Annotated[
        float, typer.Option(help="Shortest time of free rotation, in seconds.", min=0.0)
    ] = 30.0,
    coverage: Annotated[
        float,
        typer.Option(
            help="Share of all directions that each magnetometer must have seen, 0 to 1.", min=0.5, max=0.95
        ),
    ] = 0.85,
    move_joints_s: Annotated[
        float, typer.Option(help="Seconds in which every joint is to move.", min=2.0)
    ] = 20.0,
    gravity: Annotated[float, typer.Option(help="Gravity at your place, m/s².", min=9.7, max=9.9)] = 9.80665,
    hemisphere: HemisphereOption = "north",
    pictures: Annotated[
        bool, typer.Option(help="Draw a picture of every node before and after calibration.")
    ] = True,
    report: ReportFile = None,
    as_json: AsJson = False,
    set_: Overrides = None,
) -> None:
    """Calibrate the suit step by step: see what to do, which node needs more, and how good the result is.

    First all nodes lie in one tray, which you put down in many attitudes and rotate; then you wear them.
    Ctrl-C keeps what was recorded for `calibrate imu`, `mag` and `align`.

    Example: `tandem calibrate live deploy/examples/master.toml --out calibration --what imu,mag`
    """
    from common.config.load import load_config
    from common.errors import TandemError
    from deploy.calibrate.live.compute import Choice, compute
    from deploy.calibrate.live.guide import GuideOptions
    from deploy.calibrate.session import make_folder, output_json
    from master.calibrate.magnetometer_axes import hemisphere_named
    from master.config import MasterConfig

    checked = load_config(config, MasterConfig, set_ or ())
    wanted = parts(what)
    make_folder(out)
    console = Console(stderr=True)
    by_word = console.is_terminal
    options = GuideOptions(
        wanted, still_s, attitudes, coverage, tumble_s, move_joints_s=move_joints_s, by_word=by_word
    )
    session = _guided(checked, options, out, console)
    choice = Choice(wanted, gravity, still_s, hemisphere_named(hemisphere), pictures)
    figures, refusals = compute(checked, session, choice, out, console)
    output_json(figures, report, to_stdout=as_json)
    if refusals:
        raise TandemError("\n".join(refusals))


def led() -> None:
    """What the console's page of calibration starts."""
    from deploy.calibrate.live.led import main

    raise typer.Exit(main())


def _guided(config: MasterConfig, options: GuideOptions, out: Path, console: Console) -> LiveRecordings:
    """Lead the person through the steps and record them. Raises TandemError where it was stopped early."""
    from common.errors import TandemError
    from common.process.runtime import run as run_until_stopped
    from deploy.calibrate.live.run import LiveRecordings, LiveSession

    recorded = LiveRecordings()

    async def guide(stop: asyncio.Event) -> None:
        nonlocal recorded
        session = LiveSession(config, options, out, console)
        recorded = session.session
        await session.run(stop)

    run_until_stopped(guide)
    if not recorded.finished:
        kept = ", ".join(str(path) for path in (recorded.tray, recorded.worn) if path is not None)
        raise TandemError(
            f"stopped before the end; recorded so far: {kept or 'nothing'}. "
            "`tandem calibrate imu`, `mag` and `align` can read it"
        )
    return recorded


def parts(text: str) -> tuple[What, ...]:
    """`imu,mag` as the parts there are. Raises ConfigError."""
    from common.errors import ConfigError, ConfigMistake
    from deploy.calibrate.live.guide import WHATS

    asked = [word.strip() for word in text.split(",") if word.strip()]
    if not asked or any(word not in WHATS for word in asked):
        expected = f"one or more of {', '.join(WHATS)}, with commas"
        raise ConfigError("live", [ConfigMistake("--what", text, expected)])
    return tuple(what for what in WHATS if what in asked)
