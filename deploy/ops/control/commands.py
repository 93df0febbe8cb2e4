"""`tandem engage|disengage|rest|take-up|estop|reset|home|status`: a person's commands, and their results."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable, Coroutine, Sequence
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from common.errors import LinkError, TandemError
from common.metrics.tree import to_tree
from common.process.runtime import run as run_until_stopped
from common.wire.messages import Action
from common.wire.together import TOGETHER
from deploy.client.certificate import Certificate
from deploy.client.destination import Destination, destination
from deploy.ops.control.printer import PrintLine, line_printer
from deploy.report.options import AsJson

Connect = Annotated[
    list[str] | None,
    typer.Option(help="Endpoint of a robot, such as tcp/192.168.7.2:7447; repeat for more robots."),
]
Robot = Annotated[list[str] | None, typer.Option(help="Name of a robot; repeat for more robots.")]
Operator = Annotated[str, typer.Option(help="Your name as an operator, the same as in the master's file.")]
MasterFile = Annotated[
    Path | None,
    typer.Option(
        "--master", help="Take endpoints, robots and operator from this master's TOML file.", dir_okay=False
    ),
]


def engage(
    connect: Connect = None,
    robot: Robot = None,
    operator: Operator = "",
    master: MasterFile = None,
    certificate: Certificate = None,
    together: Annotated[
        bool,
        typer.Option("--together", help="Move several robots at once, on purpose."),
    ] = False,
) -> None:
    """Let a robot follow the operator: it moves slowly to the operator's posture, then tracks it.

    Several robots at once only with --together: each makes every motion of the operator.

    Example: `tandem engage --connect tcp/192.168.7.2:7447 --robot robot-1 --operator nurse-1`
    """
    where = _holder(connect, robot, operator, master, certificate)
    if len(where.robots) > 1 and not together:
        raise TandemError(
            f"{', '.join(where.robots)}: name one robot by --robot, or move them all at once by --together"
        )
    _act(Action.ENGAGE, where, TOGETHER if together else "")


def disengage(
    connect: Connect = None,
    robot: Robot = None,
    operator: Operator = "",
    master: MasterFile = None,
    certificate: Certificate = None,
) -> None:
    """Make robots hold their position and stop following the operator.

    Example: `tandem disengage --connect tcp/192.168.7.2:7447 --robot robot-1 --operator nurse-1`
    """
    _act(Action.DISENGAGE, _holder(connect, robot, operator, master, certificate))


Groups = Annotated[
    list[str],
    typer.Argument(help="Joint groups, such as left_arm, right_hand, head or trunk; each has all beyond it."),
]


def rest(
    groups: Groups,
    connect: Connect = None,
    robot: Robot = None,
    operator: Operator = "",
    master: MasterFile = None,
    certificate: Certificate = None,
) -> None:
    """Let an arm rest: its joints hold on the robot, all others follow. `tandem take-up` ends it.

    Example: `tandem rest left_arm --master /etc/tandem/master.toml`
    """
    _act(Action.REST, _holder(connect, robot, operator, master, certificate), groups=groups)


def take_up(
    groups: Groups,
    connect: Connect = None,
    robot: Robot = None,
    operator: Operator = "",
    master: MasterFile = None,
    certificate: Certificate = None,
) -> None:
    """End the rest of an arm: its joints move slowly to the operator's posture, then follow.

    Example: `tandem take-up left_arm --master /etc/tandem/master.toml`
    """
    _act(Action.TAKE_UP, _holder(connect, robot, operator, master, certificate), groups=groups)


def take(
    connect: Connect = None,
    robot: Robot = None,
    operator: Operator = "",
    master: MasterFile = None,
    certificate: Certificate = None,
) -> None:
    """Take robots that your master watches: it claims them. Nothing moves before you engage.

    This answers a robot's call. A robot that another operator commands is handed over by `tandem handover`.

    Example: `tandem take --robot robot-17 --master /etc/tandem/operator.toml`
    """
    _act(Action.TAKE, _holder(connect, robot, operator, master, certificate))


def let_go(
    connect: Connect = None,
    robot: Robot = None,
    operator: Operator = "",
    master: MasterFile = None,
    certificate: Certificate = None,
) -> None:
    """Give back robots that you took: each holds, and your master only watches it from then on.

    A robot that the master's file names, rather than a pattern, is claimed again at once.

    Example: `tandem let-go --robot robot-17 --master /etc/tandem/operator.toml`
    """
    _act(Action.RELEASE, _holder(connect, robot, operator, master, certificate))


def handover(
    to: Annotated[str, typer.Option(help="Name of the operator who shall command the robot from now on.")],
    connect: Connect = None,
    robot: Robot = None,
    operator: Operator = "",
    master: MasterFile = None,
    certificate: Certificate = None,
) -> None:
    """Offer a robot that you command to another operator. It holds; the other's master takes over by itself.

    The other operator then engages. Engage yourself to withdraw the offer; it also lapses by itself.

    Example: `tandem handover --to nurse-2 --master master.toml`
    """
    _act(Action.HANDOVER, _holder(connect, robot, operator, master, certificate), to)


def estop(
    connect: Connect = None,
    robot: Robot = None,
    all_: Annotated[
        bool, typer.Option("--all", help="Stop every robot that answers at the endpoints.")
    ] = False,
    operator: Operator = "",
    master: MasterFile = None,
    certificate: Certificate = None,
) -> None:
    """Stop robots now; anyone may. Repeats until each robot has acknowledged. `tandem reset` ends the stop.

    Example: `tandem estop --connect tcp/192.168.7.2:7447 --connect tcp/192.168.7.3:7447 --all`
    """
    from deploy.client.stop import stop_robots

    where = destination(connect, robot, operator, master, certificate)
    if not (all_ or where.robots):
        raise TandemError("which robot? Name it by --robot, or stop every one by --all")

    async def stop_all(print_line: PrintLine) -> None:
        try:
            answers = await stop_robots(where, all_, lambda answer: print_line(answer.line))
        except LinkError as error:
            raise TandemError(f"NO ROBOT IS STOPPED BY THIS: {error}. Stop it at the robot itself") from None
        failed = [answer for answer in answers if not answer.done]
        if failed:
            raise TandemError("NOT EVERY ROBOT IS STOPPED: " + "; ".join(answer.line for answer in failed))

    _carry_out(stop_all)


def reset(
    key: Annotated[
        str,
        typer.Option(
            envvar="TANDEM_RESET_KEY", help="The reset key, `guard.reset_key` in the slave's TOML file."
        ),
    ],
    connect: Connect = None,
    robot: Robot = None,
    operator: Operator = "",
    master: MasterFile = None,
    certificate: Certificate = None,
) -> None:
    """End an emergency stop: the robot then holds its position until it is engaged.

    Example: `tandem reset --connect tcp/192.168.7.2:7447 --robot robot-1 --key KEY`
    """
    _act(Action.RESET, _named(destination(connect, robot, operator, master, certificate)), key)


def home(
    key: Annotated[
        str,
        typer.Option(
            envvar="TANDEM_RESET_KEY", help="The reset key, `guard.reset_key` in the slave's TOML file."
        ),
    ],
    connect: Connect = None,
    robot: Robot = None,
    operator: Operator = "",
    master: MasterFile = None,
    certificate: Certificate = None,
    yes: Annotated[
        bool, typer.Option("--yes", help="Do not ask for confirmation: you have already looked at the robot.")
    ] = False,
) -> None:
    """Confirm the joint angles of a robot that cannot check them by a second encoder.

    Look at the robot first. The command prints each such joint and the angle that the robot reports.

    Example: `tandem home --connect tcp/192.168.7.2:7447 --robot robot-1 --key KEY`
    """
    where = _named(destination(connect, robot, operator, master, certificate))
    if not yes:
        _act(Action.STATUS, where)
        if not typer.confirm("Does the robot stand so?"):
            raise TandemError("nothing was confirmed: the robot does not move")
    _act(Action.HOME, where, key)


def status(
    connect: Connect = None,
    robot: Robot = None,
    master: MasterFile = None,
    certificate: Certificate = None,
    as_json: AsJson = False,
) -> None:
    """Show what robots are doing: guard state and reason, operator, faults, base tilt, latency.

    Example: `tandem status --connect tcp/192.168.7.2:7447 --robot robot-1 --json`
    """
    from deploy.client.status import ask_status
    from deploy.client.status_table import status_table

    where = _named(destination(connect, robot, master=master, certificate=certificate))

    async def print_status() -> None:
        robots = await ask_status(where)
        if as_json:
            typer.echo(
                json.dumps({name: to_tree(one) for name, one in robots.items()}, indent=2, ensure_ascii=False)
            )
        else:
            Console().print(status_table(robots))
        silent = [f"{name} {one.reason}" for name, one in robots.items() if not one.answers]
        silent += [
            f"{name}: another robot has the same name; this one is at {one.place}"
            for name, one in robots.items()
            if one.namesakes
        ]
        if silent:
            raise TandemError("; ".join(silent))

    _run(print_status)


COMMANDS: Sequence[Callable[..., None]] = (
    engage,
    disengage,
    take,
    let_go,
    handover,
    rest,
    take_up,
    estop,
    reset,
    home,
    status,
)
"""In the order of the help."""


def _act(action: Action, where: Destination, key: str = "", groups: Sequence[str] = ()) -> None:
    from deploy.client.ask import ask_robots

    async def ask(print_line: PrintLine) -> None:
        answers = await ask_robots(where, action, key, groups)
        for answer in answers:
            if answer.guard:
                print_line(answer.line)
        silent = [f"{a.robot} {a.text}" for a in answers if not a.guard]
        refused = [f"{a.robot}: {action} was refused: {a.text}" for a in answers if a.guard and not a.done]
        if silent or refused:
            raise TandemError("\n".join([*silent, *refused]))

    _carry_out(ask)


def _named(where: Destination) -> Destination:
    if not where.robots:
        raise TandemError("which robot? Name it by --robot, or the master's file by --master")
    if where.claimed not in ("", where.operator):
        raise TandemError(
            f"your certificate is that of operator {where.operator}, not of {where.claimed}: correct "
            "--operator, [operator] name or --certificate"
        )
    return where


def _holder(
    connect: Sequence[str] | None,
    robot: Sequence[str] | None,
    operator: str,
    master: Path | None,
    certificate: Path | None,
) -> Destination:
    where = _named(destination(connect, robot, operator, master, certificate))
    if not where.operator:
        raise TandemError("which operator? Give your name by --operator, or the master's file by --master")
    return where


def _carry_out(act: Callable[[PrintLine], Coroutine[object, object, None]]) -> None:
    """Run a command to its end, even if the terminal is closed, full or paused."""
    with line_printer() as print_line:
        _run(lambda: act(print_line), hangup_stops=False)


def _run(work: Callable[[], Coroutine[object, object, None]], hangup_stops: bool = True) -> None:
    """Run the work. Ctrl-C ends it with the error that the robot's reaction is not known."""

    async def main(stop: asyncio.Event) -> None:
        working = asyncio.create_task(work())
        stopping = asyncio.create_task(stop.wait())
        await asyncio.wait({working, stopping}, return_when=asyncio.FIRST_COMPLETED)
        stopping.cancel()
        if working.done():
            return working.result()
        working.cancel()
        raise TandemError("interrupted: whether the robot heard it is not known")

    run_until_stopped(main, hangup_stops=hangup_stops)
