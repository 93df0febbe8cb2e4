"""How a person's command is carried out: who asks which robot, and each robot's answer in words."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine, Sequence
from pathlib import Path
from typing import Annotated

import typer

from common.errors import TandemError
from common.process.runtime import run as run_until_stopped
from common.wire.messages import Action
from deploy.client.destination import Destination, destination
from deploy.ops.control.printer import PrintLine, line_printer

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


def act(action: Action, where: Destination, key: str = "", groups: Sequence[str] = ()) -> None:
    """Ask robots, and print each answer. Raises TandemError where one is silent or refuses."""
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

    carry_out(ask)


def named(where: Destination) -> Destination:
    """The same, where it names a robot, and no operator but the certificate's. Raises TandemError."""
    if not where.robots:
        raise TandemError("which robot? Name it by --robot, or the master's file by --master")
    if where.claimed not in ("", where.operator):
        raise TandemError(
            f"your certificate is that of operator {where.operator}, not of {where.claimed}: correct "
            "--operator, [operator] name or --certificate"
        )
    return where


def holder(
    connect: Sequence[str] | None,
    robot: Sequence[str] | None,
    operator: str,
    master: Path | None,
    certificate: Path | None,
) -> Destination:
    """Where a request of the operator goes that holds the lease. Raises TandemError where it is not said."""
    where = named(destination(connect, robot, operator, master, certificate))
    if not where.operator:
        raise TandemError("which operator? Give your name by --operator, or the master's file by --master")
    return where


def carry_out(act: Callable[[PrintLine], Coroutine[object, object, None]]) -> None:
    """Run a command to its end, even if the terminal is closed, full or paused."""
    with line_printer() as print_line:
        run(lambda: act(print_line), hangup_stops=False)


def run(work: Callable[[], Coroutine[object, object, None]], hangup_stops: bool = True) -> None:
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
