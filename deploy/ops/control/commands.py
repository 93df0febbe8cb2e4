"""`tandem engage|disengage|take|let-go|handover|rest|take-up`: what the operator of a robot asks of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Annotated

import typer

from common.errors import TandemError
from common.wire.messages import Action
from common.wire.together import TOGETHER
from deploy.client.certificate import Certificate
from deploy.ops.control.carry_out import Connect, MasterFile, Operator, Robot, act, holder
from deploy.ops.control.status import status
from deploy.ops.control.stop import estop, home, reset


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
    where = holder(connect, robot, operator, master, certificate)
    if len(where.robots) > 1 and not together:
        raise TandemError(
            f"{', '.join(where.robots)}: name one robot by --robot, or move them all at once by --together"
        )
    act(Action.ENGAGE, where, TOGETHER if together else "")


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
    act(Action.DISENGAGE, holder(connect, robot, operator, master, certificate))


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
    act(Action.REST, holder(connect, robot, operator, master, certificate), groups=groups)


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
    act(Action.TAKE_UP, holder(connect, robot, operator, master, certificate), groups=groups)


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
    act(Action.TAKE, holder(connect, robot, operator, master, certificate))


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
    act(Action.RELEASE, holder(connect, robot, operator, master, certificate))


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
    act(Action.HANDOVER, holder(connect, robot, operator, master, certificate), to)


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
