"""`tandem estop|reset|home`: stop robots, and what a person confirms before they may move again."""

from __future__ import annotations

from typing import Annotated

import typer

from common.errors import LinkError, TandemError
from common.wire.messages import Action
from deploy.client.certificate import Certificate
from deploy.client.destination import destination
from deploy.ops.control.carry_out import Connect, MasterFile, Operator, Robot, act, carry_out, named
from deploy.ops.control.printer import PrintLine


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

    carry_out(stop_all)


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
    act(Action.RESET, named(destination(connect, robot, operator, master, certificate)), key)


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
    where = named(destination(connect, robot, operator, master, certificate))
    if not yes:
        act(Action.STATUS, where)
        if not typer.confirm("Does the robot stand so?"):
            raise TandemError("nothing was confirmed: the robot does not move")
    act(Action.HOME, where, key)
