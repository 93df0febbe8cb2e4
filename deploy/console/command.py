"""`tandem console`."""

from __future__ import annotations

import asyncio
import sys
from pathlib import Path
from typing import Annotated

import typer

from common.process.runtime import run as run_until_stopped
from deploy.client.certificate import Certificate


def console(
    master: Annotated[
        Path | None,
        typer.Option(
            help="Take endpoints, robots, operator, tap and [console] from this master's TOML file.",
            dir_okay=False,
        ),
    ] = None,
    connect: Annotated[
        list[str] | None, typer.Option(help="Endpoint of a robot, such as tcp/192.168.7.2:7447.")
    ] = None,
    robot: Annotated[list[str] | None, typer.Option(help="Name of a robot; repeat for more robots.")] = None,
    operator: Annotated[str, typer.Option(help="Name of the operator, as in the master's file.")] = "",
    tap: Annotated[
        Path | None,
        typer.Option(help="Socket of the master's tap on this host, such as /run/tandem/master.sock."),
    ] = None,
    slave: Annotated[
        Path | None,
        typer.Option(
            help="This slave's TOML file: beside --master shows its zones; alone serves the robot's side.",
            dir_okay=False,
        ),
    ] = None,
    listen: Annotated[
        str | None, typer.Option(help="Address and port of the page; 127.0.0.1:8080 unless the file says.")
    ] = None,
    profile: Annotated[str | None, typer.Option(help="Profile of the robots.")] = None,
    certificate: Certificate = None,
    overrides: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Set one key of the file for this run."),
    ] = None,
) -> None:
    """Serve the web page: what the robot sees and does, how late it is, and a stop. Prints its addresses.

    A process of its own: no browser can delay a command. The address of a role has a token that logs in once.

    Example: `tandem console --master /etc/tandem/master.toml`
    """
    from deploy.console.options import ConsoleChoices, console_options
    from deploy.console.run import run_console

    def say(line: str) -> None:
        sys.stdout.write(f"{line}\n")
        sys.stdout.flush()

    chosen = ConsoleChoices(
        master, connect, robot, operator, tap, slave, listen, profile, certificate, overrides or ()
    )
    options = console_options(chosen, say)

    async def serve(stop: asyncio.Event) -> None:
        await run_console(options, stop)

    run_until_stopped(serve)
