"""`tandem`: every command, its options and its help. The work is done elsewhere."""

from __future__ import annotations

import asyncio
import sys
from pathlib import Path
from typing import Annotated, Any, Literal

import typer
from rich.console import Console

from common.config.load import load_config
from common.errors import TandemError
from common.log.handler import describe_exception, flush_log, print_error
from common.log.streams import lost_output, secure
from common.process.extras import missing_extra
from common.process.runtime import run as run_until_stopped
from deploy.calibrate.commands import app as calibrate_app
from deploy.calibrate.live.command import live
from deploy.experiments.accuracy.commands import app as accuracy_app
from deploy.experiments.faults.command import faults
from deploy.experiments.soak.command import soak
from deploy.experiments.trial.command import app as trial_app
from deploy.log_options import Debug, Quiet, add_log_options, debugging, start_chosen_log
from deploy.ops.attitude.command import attitude
from deploy.ops.control.commands import COMMANDS as OPERATORS_ACTS
from deploy.ops.control.teller import acted
from deploy.ops.doctor.command import doctor
from deploy.ops.keys.commands import app as keys_app
from deploy.ops.record.command import record, recording
from deploy.ops.router.command import router
from deploy.ops.servos import servos
from deploy.ops.video import video
from deploy.report.output import in_a_folder, write_json
from deploy.report.panels import arrange
from deploy.sim.drives.process import drives
from deploy.sim.network.command import app as network_app

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
    help="A nurse moves; a humanoid upper body far away moves the same way, safely, "
    "and everyone knows how late it was.\n\nStart with `tandem demo`.",
)
calibrate_app.command("live")(live)
app.add_typer(calibrate_app, name="calibrate")
app.add_typer(accuracy_app, name="accuracy")
app.add_typer(keys_app, name="keys")
app.add_typer(network_app, name="network")
app.add_typer(trial_app, name="trial")
app.command("video")(video)
app.command()(drives)
app.command()(attitude)
app.command()(faults)
app.command()(router)
app.command()(servos)
app.command()(doctor)
app.command()(record)
app.command()(recording)
app.command()(soak)
EXIT_FAULT = 70
"""Status after a fault that no person caused (`EX_SOFTWARE`)."""
EXIT_OUTPUT = 74
"""Status of a report that could not be written (`EX_IOERR`); an act that was done keeps its own status."""


ConfigFile = Annotated[Path, typer.Argument(help="TOML file; deploy/examples has one to start from.")]
Overrides = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="KEY=VALUE", help="Set one key over the file: `--set 'robot=\"robot-2\"'`."
    ),
]
Figures = Annotated[
    Path | None,
    typer.Option(help="Write what was counted, as JSON, when stopped.", dir_okay=False, callback=in_a_folder),
]


def _a_png(path: Path | None) -> Path | None:
    if path is not None and path.suffix.lower() != ".png":
        raise typer.BadParameter(f"{path.name}: expected a name that ends in .png")
    return in_a_folder(path)


ReportFile = Annotated[
    Path | None, typer.Option(help="Write the figures as JSON.", dir_okay=False, callback=in_a_folder)
]


@app.callback()
def _options(
    debug: Debug = False,
    quiet: Quiet = False,
) -> None:
    start_chosen_log(debug=debug, quiet=quiet)


@app.command()
def master(config: ConfigFile, set_: Overrides = None, figures: Figures = None) -> None:
    """Run the operator's side: read the suit, compute the joint angles, command the robot.

    Example: `tandem master deploy/examples/master.toml`
    """
    from master.app import run
    from master.config import MasterConfig

    checked = load_config(config, MasterConfig, set_ or ())
    run_until_stopped(lambda stop: run(checked, stop, _write_figures(figures)))


@app.command()
def slave(config: ConfigFile, set_: Overrides = None, figures: Figures = None) -> None:
    """Run the robot's side: guard, drive and measure.

    Example: `tandem slave deploy/examples/slave.toml`
    """
    from slave.app import run
    from slave.config import SlaveConfig

    checked = load_config(config, SlaveConfig, set_ or ())
    run_until_stopped(lambda stop: run(checked, stop, _write_figures(figures)))


@app.command()
def suit(config: ConfigFile, set_: Overrides = None, figures: Figures = None) -> None:
    """Run the simulated suit: a real CAN peer that answers every SYNC as worn nodes would.

    Example: `tandem suit deploy/examples/suit.toml --set 'motion="sweep"'`
    """
    from deploy.sim.suit.config import SuitConfig
    from deploy.sim.suit.process import run

    checked = load_config(config, SuitConfig, set_ or ())
    run_until_stopped(lambda stop: run(checked, stop, _write_figures(figures)))


@app.command()
def demo(
    seconds: Annotated[float, typer.Option(help="How long to follow the operator.", min=3.0)] = 20.0,
    report: ReportFile = None,
    transport: Annotated[
        str, typer.Option(help="tcp, udp, tls, quic, quic-datagram, ws or unixsock-stream.")
    ] = "tcp",
    replay: Annotated[
        Path | None, typer.Option(help="A person's recording (.npz) instead of a simulated one.", exists=True)
    ] = None,
    profile: Annotated[str, typer.Option(help="nursing, hand or lower_limb.")] = "nursing",
    motion: Annotated[
        str | None,
        typer.Option(
            help="sweep, calibration_pose or the profile's own, which is the default: bottle, grasp, walk.",
            show_default=False,
        ),
    ] = None,
    strategy: Annotated[str, typer.Option(help="predict, interpolate or latest.")] = "predict",
    filter_: Annotated[str, typer.Option("--filter", help="vqf, mahony or ekf.")] = "vqf",
    seed: Annotated[int, typer.Option(help="Of the simulated sensors' errors.")] = 1,
    robots: Annotated[
        int, typer.Option(help="How many follow the one operator; with several, no cameras.", min=1, max=32)
    ] = 1,
    servos: Annotated[
        Literal["mujoco", "canopen"], typer.Option(help="The robot: in the slave, or drives on CAN buses.")
    ] = "mujoco",
    camera: Annotated[bool, typer.Option(help="Whether the robot sends what it sees.")] = True,
    plots: Annotated[
        Path | None,
        typer.Option(
            help="Draw every joint's angle and angular velocity (PNG).", dir_okay=False, callback=_a_png
        ),
    ] = None,
) -> None:
    """Run the whole way here: simulated suit, master and robot as three processes, and judge it.

    Example: `tandem demo --profile hand --seconds 20 --report report.json --plots fingers.png`
    """
    from deploy.experiments.demo.draw_curves import as_png
    from deploy.experiments.demo.options import DemoOptions
    from deploy.experiments.demo.run import run_demo
    from deploy.experiments.demo.view import print_report

    console = Console()
    options = DemoOptions(
        profile=profile, seconds=seconds, transport=transport, replay=replay, motion=motion,
        strategy=strategy, filter=filter_, seed=seed, robots=robots, servos=servos, camera=camera,
    )  # fmt: skip

    async def tell(stop: asyncio.Event) -> None:
        result = await run_demo(options, stop, console)
        if report is not None:
            write_json(report, result.tree)
        print_report(result, console)
        if plots is not None and result.curves is not None:
            as_png(result.curves, plots)
            console.print(f"every joint's curves: {plots}", highlight=False)
        if result.problems:
            raise TandemError("the demo failed: " + "; ".join(result.problems))

    run_until_stopped(tell)


@app.command()
def bench(
    report: ReportFile = None,
    quick: Annotated[bool, typer.Option(help="A few seconds, rougher figures.")] = False,
) -> None:
    """Measure whether this machine is good enough.

    Example: `tandem bench --report bench.json`
    """
    from deploy.experiments.bench.run import bench as measure

    figures = measure(quick=quick, console=Console())
    if report is not None:
        write_json(report, figures)


for _act in OPERATORS_ACTS:
    app.command()(_act)
add_log_options(app)
arrange(app)


def _write_figures(path: Path | None) -> Any:
    def write(figures: dict[str, object]) -> None:
        if path is not None:
            write_json(path, figures)

    return write


def main() -> None:
    """Entry point: errors a person can cause are one clear line each, and status 1."""
    secure()
    status = _run()
    flush_log()
    if status == 0 and not acted() and (why := lost_output()) is not None:
        print_error("tandem", f"not all of the output could be written: {why}")
        status = EXIT_OUTPUT
    sys.exit(status)


def _run() -> int:
    """The status: 1 for what a person can mend, EXIT_FAULT for a fault of tandem itself."""
    try:
        app()
    except SystemExit as done:
        return done.code if isinstance(done.code, int) else int(done.code is not None)
    except TandemError as error:
        if debugging():
            raise
        print_error("tandem", str(error))
        return 1
    except Exception as error:
        if debugging():
            raise
        if isinstance(error, ModuleNotFoundError) and (missing := missing_extra(error)):
            print_error("tandem", missing)
            return 1
        fault = f"a fault of tandem itself: {describe_exception(error)}; with --debug it shows the traceback"
        print_error("tandem", fault)
        return EXIT_FAULT
    return 0


if __name__ == "__main__":
    main()
