"""`tandem lsl`."""

from __future__ import annotations

import asyncio
from typing import Annotated

import typer
from rich.console import Console

from common.process.runtime import run as run_until_stopped
from deploy.report.options import ConnectTo, LinkFile


def lsl(
    robot: Annotated[str, typer.Option(help="Name of the robot.")],
    connect: ConnectTo = None,
    link: LinkFile = None,
    profile: Annotated[str, typer.Option(help="Profile of the robot.")] = "nursing",
) -> None:
    """Publish joints, targets, latency and events to Lab Streaming Layer, beside EMG, EEG, optical capture.

    LSL has no passwords: whoever is on the laboratory's network hears it. No name of an operator is sent.

    Example: `tandem lsl --connect tcp/192.168.7.2:7447 --robot robot-1`
    """
    from common.skeleton import load_skeleton
    from deploy.client.observer import link_of
    from deploy.ops.lsl.run import publish_lsl

    where, skeleton = link_of(connect or (), link), load_skeleton(profile)
    console = Console(stderr=True)

    async def work(stop: asyncio.Event) -> None:
        with console.status("waiting for the robot") as status:
            sent = await publish_lsl(where, robot, skeleton, stop, status.update)
        words = ", ".join(f"{name} {count}" for name, count in sent.items())
        console.print(f"published: {words}", highlight=False)

    run_until_stopped(work)
