"""`tandem prove`."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from common.errors import TandemError
from common.process.runtime import run as run_until_stopped
from deploy.experiments.prove.table import proof_table
from deploy.measure.proof import ProofRow, prove
from deploy.recorded.files import entries_of, head_of
from deploy.recorded.recorded_config import recorded_config
from deploy.report.options import AsJson
from deploy.report.output import in_a_folder
from master.suit.protocol import SuitProtocol

if TYPE_CHECKING:
    from deploy.experiments.prove.guide import ProofStep, ProofView

DEFAULT_NODE = 100
STEP_MS = 5
"""Of a planted delay: the ticks of servo and encoder."""

_LEAD = (
    "Tape one of the suit's own nodes to the robot's hand, and give it a number that no segment has. It may "
    "hang on the suit's bus, which is the most exact, or on one at the robot."
)

PollFile = Annotated[
    Path | None,
    typer.Option(
        help="At the robot: poll the node on a bus there, never the drives', until Ctrl-C; TOML file with "
        "[bus].",
        exists=True,
        dir_okay=False,
    ),
]
ProofRecording = Annotated[
    Path,
    typer.Option(help="With --lead or --poll: the recording to write.", dir_okay=False, callback=in_a_folder),
]


def prove_motion(
    files: Annotated[
        list[Path] | None,
        typer.Argument(help="A recording of the master's tap while the robot followed.", dir_okay=False),
    ] = None,
    hand: Annotated[
        str, typer.Option(help="The segment of the robot that the node is taped to.")
    ] = "right_hand",
    node: Annotated[
        int, typer.Option(help="The number of the node on the robot's hand.", min=0)
    ] = DEFAULT_NODE,
    node_recording: Annotated[
        Path | None,
        typer.Option(
            help="A recording made at the robot, where the node hangs on a bus there.", dir_okay=False
        ),
    ] = None,
    simulate_over: Annotated[
        str | None,
        typer.Option("--simulate", help="Instead of a recording: simulate over this network profile."),
    ] = None,
    lead: Annotated[
        Path | None,
        typer.Option(help="Instead of a recording: be led through one, at the master's `[tap] socket`."),
    ] = None,
    poll: PollFile = None,
    out: ProofRecording = Path("proof.mcap"),
    seconds: Annotated[
        float, typer.Option(help="How long the hand moves, with --lead or --simulate.", min=14.0)
    ] = 28.0,
    plant: Annotated[
        list[str] | None,
        typer.Option(help="With --simulate: plant a delay, such as `servo=20`; also encoder, camera (ms)."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Measure hand to hand by a node on the robot's hand, beside what tandem's stamps claim.

    The node belongs to no part that it judges. The operator stands and moves that hand irregularly for half
    a minute, trunk still. --lead says what to tape where and which motion for how long, counts down, shows
    progress and records it. Each figure is printed with its bound; a stamp that the hand refutes ends with
    status 1.

    Led: `tandem prove --lead /run/tandem/operator.sock --out proof.mcap`

    Without hardware: `tandem prove --simulate 4g --plant encoder=20`

    Example: `tandem prove morning.mcap --hand right_hand --node 100`
    """
    if poll is not None:
        _polled(poll, out, node)
        return
    if simulate_over is not None:
        # here: MuJoCo and scipy would cost each `tandem` command their time and memory
        from deploy.experiments.prove.simulated import judge, simulate

        rows = judge(simulate(simulate_over, seconds, _planted(plant or ())))
    elif lead is not None:
        rows = _led(lead, out, hand, node, seconds)
    elif files:
        rows = _of_recording(files, hand, node, node_recording)
    else:
        raise TandemError(f"expected a recording, --lead SOCKET, --poll FILE, or --simulate lan. {_LEAD}")
    if as_json:
        typer.echo(json.dumps([asdict(row) for row in rows], indent=2))
    else:
        Console().print(proof_table(rows))
    if any(row.wrong for row in rows):
        raise typer.Exit(1)


def _led(tap: Path, out: Path, hand: str, node: int, seconds: float) -> list[ProofRow]:
    from deploy.experiments.prove.lead import lead

    if out.exists():
        raise TandemError(f"{out}: exists already; name another file by --out")
    console = Console(stderr=True)
    finished: list[bool] = []

    async def work(stop: asyncio.Event) -> None:
        with console.status("waiting for the master") as status:
            steps: list[ProofStep] = []

            def show(view: ProofView) -> None:
                status.update(view.line)
                if view.step not in steps[-1:]:
                    steps.append(view.step)
                    console.print(view.line, highlight=False)

            finished.append(await lead(tap, out, hand, node, seconds, stop, show))

    run_until_stopped(work)
    console.print(f"recorded into {out}", highlight=False, soft_wrap=True)
    if finished != [True]:
        raise TandemError(
            f"interrupted before the hand had moved enough; `tandem prove {out}` judges what is in it"
        )
    return _of_recording([out], hand, node, None)


def _polled(file: Path, out: Path, node: int) -> None:
    from common.config.load import load_config
    from deploy.experiments.prove.poll import PollConfig
    from deploy.experiments.prove.poll import poll as poll_node

    config, console = load_config(file, PollConfig), Console(stderr=True)
    with console.status("polling; Ctrl-C ends it") as status:

        def show(answers: int) -> None:
            status.update(f"{answers} answers a second, of {config.rate_hz}; Ctrl-C ends it")

        run_until_stopped(lambda stop: poll_node(config, node, out, stop, show))
    console.print(f"recorded into {out}", highlight=False, soft_wrap=True)


def _planted(words: Sequence[str]) -> dict[str, int]:
    from deploy.sim.world.hand_node import PLACES

    found: dict[str, int] = {}
    for word in words:
        place, _, ms = word.partition("=")
        if place not in PLACES or not ms.isdigit() or int(ms) % STEP_MS:
            places = ", ".join(PLACES)
            raise TandemError(
                f"--plant {word}: expected one of {places} and ms in steps of {STEP_MS}: servo=20"
            )
        found[place] = int(ms)
    return found


def _of_recording(files: list[Path], hand: str, node: int, node_recording: Path | None) -> list[ProofRow]:
    from deploy.experiments.prove.recorded import NodeRates, RecordedRun

    with recorded_config(head_of(files[0]), files[0].name) as config:
        if hand not in config.nodes:
            raise TandemError(f"--hand {hand}: expected a segment with a node: {', '.join(config.nodes)}")
        protocol, skeleton = SuitProtocol.load(config.capture.dbc), config.skeleton
    worn = config.nodes[hand]
    if node_recording is None and node in {one.id for one in config.nodes.values()}:
        raise TandemError(f"--node {node}: a segment's own node has this number; expected one that none has")
    operator, taped = NodeRates(protocol, worn.id, worn.bus), NodeRates(protocol, node)
    run = RecordedRun(skeleton, hand)
    run.take(entries_of(files, 0), (operator, taped) if node_recording is None else (operator,))
    if node_recording is not None:
        RecordedRun(skeleton, hand).take(entries_of([node_recording], 0), (taped,))
    if not len(taped.speed().at_ns):
        raise TandemError(f"--node {node}: it is not in the recording. {_LEAD}")
    motions = run.motions(operator.speed(), taped.speed(), on_robots_clock=node_recording is not None)
    return prove(motions, run.claims())
