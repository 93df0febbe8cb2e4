"""How soon servos on a serial bus answer: a ping, which changes nothing in them."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

from common.errors import RobotError
from deploy.ops.doctor.read.tree import Tree
from slave.servos.dynamixel.bus import Bus, ServoError
from slave.servos.dynamixel.config import DynamixelConfig
from slave.servos.dynamixel.latency import timer_ms
from slave.servos.dynamixel.port import Port

PINGS = 10
_PATIENCE_S = 0.05
_LONGEST_S = 2.0
"""Servos that are silent cost their wait; after this no further one is asked."""


@dataclass(frozen=True, slots=True)
class Pinged:
    """What was measured at one port."""

    port: str
    timer_ms: int | None
    """The adapter's latency timer; None where it has none, or its driver does not tell."""
    quickest_s: float | None = None
    """None where nobody was asked, or nobody answered."""
    answers: int = 0
    why_not: str = ""


def ping_servos(
    config: DynamixelConfig, tree: Tree, open_port: Callable[[str, int, float], Port] | None = Port
) -> Pinged:
    """Ping servos until one answers, and that one some times more. `open_port` None: only read the timer."""
    timer = timer_ms(config.port, tree.root)
    if open_port is None:
        return Pinged(config.port, timer, why_not="not asked to reach others")
    try:
        bus = Bus(open_port(config.port, config.baud, config.reply_timeout_s))
    except RobotError as error:
        return Pinged(config.port, timer, why_not=str(error))
    try:
        with bus.patient(_PATIENCE_S):
            answers = _ping(bus, list(config.ids.values()))
    except RobotError as error:
        return Pinged(config.port, timer, why_not=str(error))
    finally:
        bus.close()
    if not answers:
        return Pinged(
            config.port, timer, why_not="no servo answers a ping: check power, cable, ids, baud rate"
        )
    return Pinged(config.port, timer, bus.quickest_s, answers)


def _ping(bus: Bus, ids: list[int]) -> int:
    until_s = time.monotonic() + _LONGEST_S
    for servo in ids:
        answers = 0
        try:
            for _ in range(PINGS):
                bus.ping(servo)
                answers += 1
        except ServoError:
            pass
        if answers or time.monotonic() > until_s:
            return answers
    return 0
