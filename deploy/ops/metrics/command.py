"""`tandem metrics`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from common.process.runtime import run as run_until_stopped
from deploy.report.options import ConnectTo, LinkFile


def metrics(
    robot: Annotated[list[str], typer.Option(help="Name of a robot; repeat for more.")],
    connect: ConnectTo = None,
    link: LinkFile = None,
    listen: Annotated[str, typer.Option(help="Where Prometheus scrapes: HOST:PORT.")] = "127.0.0.1:9464",
    recordings: Annotated[
        Path | None,
        typer.Option(
            help="Also watch this folder of recordings: age of the newest, room on the disk.", file_okay=False
        ),
    ] = None,
) -> None:
    """Serve what both sides publish each second to Prometheus, in a process of its own. It changes nothing.

    Dashboard and alert rules lie in deploy/ops/metrics: grafana.json, alerts.yaml.

    Example: `tandem metrics --connect tcp/192.168.7.2:7447 --robot robot-1`
    """
    import asyncio

    from deploy.client.observer import link_of
    from deploy.ops.metrics.run import MetricsOptions, address, checked_robots, serve_metrics

    host, port = address(listen)
    options = MetricsOptions(link_of(connect or (), link), checked_robots(robot), host, port, recordings)
    console = Console(stderr=True)

    async def work(stop: asyncio.Event) -> None:
        await serve_metrics(
            options, stop, lambda at: console.print(f"http://{host}:{at}/metrics", highlight=False)
        )

    run_until_stopped(work)
