"""Shows or prints what an instrument says, real or simulated, until stopped."""

from __future__ import annotations

import asyncio
import json
import math
from contextlib import nullcontext
from dataclasses import dataclass

from rich.console import Console
from rich.live import Live

from common.clock import NS_PER_S, monotonic_ns, to_s
from common.errors import TandemError
from common.process.pacing import TickGrid
from common.process.runtime import until_stopped
from common.process.ticker import ticks
from deploy.ops.attitude.reading import AttitudeLog, Reading
from deploy.ops.attitude.source import PortSource, SimulatedSource, Source, Take
from deploy.ops.attitude.view import screen
from slave.attitude.port import FrameWriter

RATE_HZ = 50
_SHOWN_EVERY = 5


@dataclass(frozen=True, slots=True)
class AttitudeOptions:
    """What was asked for; degrees as typed."""

    port: str | None = None
    """None: simulate."""
    baud: int = 9600
    to: str | None = None
    """The port that a simulated instrument sends its frames to."""
    declination_deg: float = 0.0
    inclination_deg: float = 10.0
    """The simulated axis' inclination, as its azimuth and tool-face: the paper's own test."""
    azimuth_deg: float = 235.0
    tool_face_deg: float = 56.0
    seconds: float | None = None
    as_json: bool = False
    seed: int = 1


async def show_attitude(options: AttitudeOptions, stop: asyncio.Event, console: Console) -> AttitudeLog:
    """Show until stopped, or for as long as asked. Raises TandemError where nothing at all could be read."""
    session = AttitudeLog()
    began_ns = monotonic_ns()

    def take(reading: Reading) -> None:
        session.add(reading)
        if options.as_json:
            console.out(json.dumps(reading.as_json()), highlight=False)

    source = _open(options, began_ns, take)
    source.start()
    try:
        await until_stopped(stop, _follow(options, session, source, began_ns, console))
    finally:
        source.stop()
    if not session.readings:
        raise TandemError(
            f"nothing that {source.name} sent is a frame: "
            + ", ".join(f"{name.replace('_', ' ')} {count}" for name, count in source.counters().items())
            + "; is it on, and --baud its own?"
        )
    return session


def _open(options: AttitudeOptions, began_ns: int, take: Take) -> Source:
    declination_rad = math.radians(options.declination_deg)
    if options.port is not None:
        return PortSource(options.port, options.baud, declination_rad, began_ns, take)
    at_rad = (
        math.radians(options.inclination_deg),
        math.radians(options.azimuth_deg),
        math.radians(options.tool_face_deg),
    )
    writer = None if options.to is None else FrameWriter(options.to, options.baud)
    return SimulatedSource(at_rad, declination_rad, writer, began_ns, take, options.seed)


async def _follow(
    options: AttitudeOptions, session: AttitudeLog, source: Source, began_ns: int, console: Console
) -> None:
    with nullcontext() if options.as_json else Live(console=console, auto_refresh=False) as live:
        async for due in ticks(TickGrid(began_ns, NS_PER_S // RATE_HZ)):
            source.step(due.tick, due.scheduled_ns)
            if live is not None and due.tick % _SHOWN_EVERY == 0:
                now_s = to_s(monotonic_ns() - began_ns)
                live.update(screen(session, now_s, source.name, source.counters()), refresh=True)
            if options.seconds is not None and due.tick >= options.seconds * RATE_HZ:
                return
