"""`tandem ros`."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from common.process.runtime import run as run_until_stopped
from deploy.ops.ros.publishers import KeyFormat
from deploy.report.options import Cameras, ConnectTo, LinkFile, StopAfter


def ros(
    robot: Annotated[str, typer.Option(help="Name of the robot.")],
    connect: ConnectTo = None,
    link: LinkFile = None,
    to: Annotated[
        list[str] | None, typer.Option(help="Endpoint of the Zenoh router on the ROS side.")
    ] = None,
    domain: Annotated[int, typer.Option(help="ROS_DOMAIN_ID of the listeners.", min=0, max=232)] = 0,
    keys: Annotated[
        KeyFormat,
        typer.Option(help="rmw_zenoh: ROS 2 nodes with that middleware; ros2dds: a zenoh-bridge-ros2dds."),
    ] = KeyFormat.RMW_ZENOH,
    video: Cameras = None,
    profile: Annotated[str, typer.Option(help="Profile of the robot.")] = "nursing",
    seconds: StopAfter = None,
) -> None:
    """Publish a robot's joint states, targets, tf, diagnostics and video for ROS 2. Commands never come in.

    Needs no ROS installation, but a router: `ros2 run rmw_zenoh_cpp rmw_zenohd`. See docs/ros.md.

    Example: `tandem ros --connect tcp/192.168.7.2:7447 --robot robot-1 --to tcp/localhost:7447`
    """
    from common.config.load import check_config, load_config
    from common.link.config import LinkConfig
    from common.skeleton import load_skeleton
    from deploy.client.destination import destination
    from deploy.ops.ros.bridge import BridgeOptions, bridge
    from deploy.ops.ros.config import BridgeConfig
    from deploy.ros.cdr import types

    types()  # says at once where the extra is missing
    to_robot = destination(connect, None).link if link is None else load_config(link, BridgeConfig).link
    to_ros = check_config(
        Path("command line"), {"connect": to or ["tcp/localhost:7447"], "mode": "client"}, LinkConfig
    )
    options = BridgeOptions(
        to_robot, robot, load_skeleton(profile), to_ros, domain, keys, tuple(video or ()), seconds
    )
    console = Console(stderr=True)

    async def work(stop: asyncio.Event) -> None:
        with console.status("waiting for the robot") as status:
            sent = await bridge(options, stop, status.update)
        words = ", ".join(f"{topic} {count}" for topic, count in sent.items()) or "nothing"
        console.print(f"published: {words}", highlight=False)

    run_until_stopped(work)
