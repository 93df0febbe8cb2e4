"""`tandem status`."""

from __future__ import annotations

import json

import typer
from rich.console import Console

from common.errors import TandemError
from common.metrics.tree import to_tree
from deploy.client.certificate import Certificate
from deploy.client.destination import destination
from deploy.ops.control.carry_out import Connect, MasterFile, Robot, named, run
from deploy.report.options import AsJson


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

    where = named(destination(connect, robot, master=master, certificate=certificate))

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

    run(print_status)
