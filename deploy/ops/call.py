"""`tandem call`: somebody at the robot asks for an operator."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from common.config.load import load_config
from common.errors import LinkError, TandemError
from common.link import open_session
from common.link.roster import Roster
from common.process.runtime import run as run_until_stopped
from common.wire.call import CallRequest, pack_call, read_call_reply
from common.wire.topics import CALL
from deploy.client.destination import ROUTER_S, Destination
from deploy.client.own_door import own_doors
from deploy.report.options import Overrides


def call(
    slave: Annotated[Path, typer.Argument(help="The TOML file of the slave on this host.", dir_okay=False)],
    words: Annotated[str, typer.Option(help="What for; operators read it in their list.")] = "",
    withdraw: Annotated[bool, typer.Option("--withdraw", help="Nobody is needed any more.")] = False,
    overrides: Overrides = None,
) -> None:
    """Ask for an operator, at the robot. It is shown to all operators until one takes the robot.

    Nothing moves by it. A button can do the same: `[call]` in the slave's file.

    Example: `tandem call /etc/tandem/robot.toml --words "help with dressing"`
    """
    where = at_the_robot(slave, overrides or ())

    async def ask(_: object) -> None:
        async with open_session(where.link, router_within_s=ROUTER_S) as session:
            link, roster = session.link(where.robots[0]), Roster()
            session.watch_roster(roster)
            try:
                await link.connected(CALL)
                reply = read_call_reply(await link.ask(CALL, pack_call(CallRequest(not withdraw, words))))
            except LinkError as error:
                raise TandemError(f"NOBODY IS CALLED: the slave does not answer: {error}") from None
            if not reply.done:
                raise TandemError(f"NOBODY IS CALLED: {reply.text}")
            typer.echo(f"{where.robots[0]}: {reply.text}")
            there = ", ".join(sorted(roster.operators))
            if not withdraw and there:
                typer.echo(f"operators here now: {there}")

    run_until_stopped(ask)


def at_the_robot(slave: Path, overrides: list[str] | tuple[()] = ()) -> Destination:
    """The slave of this host, by its own keys. Raises ConfigError."""
    from slave.config import SlaveConfig  # loads MuJoCo

    file = load_config(slave, SlaveConfig, overrides)
    return own_doors(slave, file.link, file.robot)
