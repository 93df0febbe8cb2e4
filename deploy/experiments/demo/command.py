"""`tandem demo`."""

from __future__ import annotations

import asyncio
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Literal

import typer
from rich.console import Console

from common.errors import TandemError
from common.process.runtime import run as run_until_stopped
from deploy.report.options import PlotsFile, ReportFile
from deploy.report.output import write_json

Seconds = Annotated[float, typer.Option(help="How many seconds the robot follows the operator.", min=3.0)]
Transport = Annotated[
    str,
    typer.Option(
        help="Transport between master and slave: tcp, udp, tls, quic, quic-datagram, ws or unixsock-stream."
    ),
]
ReplayFile = Annotated[
    Path | None,
    typer.Option(help="Play this recording of a person instead of a simulated motion.", exists=True),
]
RobotProfile = Annotated[
    str, typer.Option(help="Robot profile: nursing, hand or lower_limb, or the folder of your own.")
]
Motion = Annotated[
    str | None,
    typer.Option(
        help="Motion of the simulated operator: sweep, calibration_pose, crossed (the operator reaches into "
        "herself), or the profile's own (bottle, grasp or walk), which is the default.",
        show_default=False,
    ),
]
Strategy = Annotated[
    str, typer.Option(help="Tracking strategy of the slave: predict, interpolate or latest.")
]
Filter = Annotated[
    str, typer.Option("--filter", help="Orientation filter of the master: vqf, mahony or ekf.")
]
Seed = Annotated[int, typer.Option(help="Random seed for the simulated sensor errors.")]
RobotCount = Annotated[
    int,
    typer.Option(
        help="Number of robots that follow the one operator; with several, the cameras are off.",
        min=1,
        max=32,
    ),
]
ServoBackend = Annotated[
    Literal["mujoco", "canopen", "makers"],
    typer.Option(
        help="Servo backend: mujoco simulates the robot inside the slave, canopen "
        "simulates drives on CAN buses, makers builds these as five makers do."
    ),
]
Slower = Annotated[
    float,
    typer.Option(help="With `--motion capture`: how many times slower than recorded.", min=0.5, max=10.0),
]
Camera = Annotated[bool, typer.Option(help="Send video from the robot's camera.")]
WithConsole = Annotated[
    bool, typer.Option("--console/--no-console", help="Serve the web page too; needs the extra `console`.")
]
Listen = Annotated[
    str | None,
    typer.Option(help="Address and port of the page; else 127.0.0.1:8080, or any port if that is taken."),
]
Keep = Annotated[
    bool, typer.Option("--keep", help="Go on until Ctrl-C, for the web page: nothing is judged then.")
]

RecordFolder = Annotated[
    Path | None,
    typer.Option(
        help="Record master and robot into this folder, for tandem replay, inspect and export.",
        file_okay=False,
    ),
]


def demo(
    seconds: Seconds = 20.0,
    report: ReportFile = None,
    transport: Transport = "tcp",
    replay: ReplayFile = None,
    profile: RobotProfile = "nursing",
    motion: Motion = None,
    slower: Slower = 1.0,
    strategy: Strategy = "predict",
    filter_: Filter = "vqf",
    seed: Seed = 1,
    robots: RobotCount = 1,
    servos: ServoBackend = "mujoco",
    camera: Camera = True,
    console_: WithConsole = True,
    listen: Listen = None,
    keep: Keep = False,
    record: RecordFolder = None,
    plots: PlotsFile = None,
) -> None:
    """Run simulated suit, master and robot on this machine, and judge how well the robot follows.

    Example: `tandem demo --profile hand --seconds 20 --report report.json --plots fingers.png`
    """
    from deploy.experiments.demo.draw_curves import as_png
    from deploy.experiments.demo.options import DemoOptions
    from deploy.experiments.demo.run import keep_demo, run_demo
    from deploy.experiments.demo.tree import report_tree
    from deploy.experiments.demo.view import print_report

    console = Console()
    options = DemoOptions(
        profile=profile, seconds=seconds, transport=transport, replay=replay, motion=motion, slower=slower,
        strategy=strategy, filter=filter_, seed=seed, robots=robots, servos=servos, camera=camera,
        console=console_ and find_spec("aiohttp") is not None, listen=listen, keep=keep,
        record=record,
    )  # fmt: skip

    async def run_and_report(stop: asyncio.Event) -> None:
        if options.keep:
            await keep_demo(options, stop, console)
            return
        result = await run_demo(options, stop, console)
        if report is not None:
            write_json(report, report_tree(result))
        print_report(result, console)
        if plots is not None and result.curves is not None:
            as_png(result.curves, plots)
            console.print(f"every joint's curves: {plots}", highlight=False)
        if result.problems:
            raise TandemError("the demo failed: " + "; ".join(result.problems))

    run_until_stopped(run_and_report)
