"""The processes of a fleet's bench: a router, robots, and one or more nurses. Each is a worker's function."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Coroutine
from contextlib import AsyncExitStack
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import psutil
import uvloop

from common.clock import monotonic_ns, to_ns
from common.link import open_session
from common.link.config import LinkConfig
from common.metrics.master import MasterMetrics
from common.metrics.parts import Summary, Ticks
from common.process.heap import freeze_heap, heap_in_use
from common.process.pacing import DueTick, TickGrid
from common.process.ticker import ticks
from common.skeleton import load_skeleton
from common.wire.topics import COMMAND, STATISTICS
from common.wire.version import software
from deploy.experiments.bench.fleet.light_robot import LightRobot
from master.config import MasterConfig
from master.deadman.grip import Grip
from master.fleet import Fleet
from master.joint_angles.sample import JointAngleSample

Result = TypeVar("Result")
PROFILE = "nursing"
TURN_HZ = 50
PARTS = 10
"""The robots of a process take turns in so many parts."""
APPEAR_S = 60.0
"""For all robots of a cell to be listed and claimed."""
SETTLE_S = 2.0
OPERATOR = "nurse"


def router(endpoint: str) -> None:
    """Route until this process is ended."""

    async def route() -> None:
        async with open_session(LinkConfig(listen=[endpoint]), mode="router"):
            await asyncio.Event().wait()

    _run(route())


def robots(endpoint: str, first: int, count: int, sessions: int) -> None:
    """So many light robots, spread evenly over so many sessions, until this process is ended."""

    async def live() -> None:
        skeleton = load_skeleton(PROFILE)
        async with AsyncExitStack() as stack:
            opened = [
                await stack.enter_async_context(open_session(LinkConfig(mode="client", connect=[endpoint])))
                for _ in range(sessions)
            ]
            fleet = [LightRobot(opened[i % sessions], robot_name(first + i), skeleton) for i in range(count)]
            freeze_heap()
            # a part of them each millisecond, as robots in homes do not tick together
            parts = [fleet[i::PARTS] for i in range(PARTS)]
            async for due in ticks(TickGrid(monotonic_ns(), to_ns(1.0 / (PARTS * TURN_HZ)))):
                for part in turns_due(due):
                    for robot in parts[part]:
                        robot.turn()

    _run(live())


def turns_due(due: DueTick) -> list[int]:
    """The parts whose turn it is, those that a late loop missed first: their states are to be sent too."""
    missed = min(due.missed, PARTS - 1)
    return [tick % PARTS for tick in range(due.tick - missed, due.tick + 1)]


def robot_name(number: int) -> str:
    """The name of the bench's robot of that number."""
    return f"light-{number}"


@dataclass(frozen=True, slots=True)
class NurseTask:
    """What one nurse of a cell does."""

    endpoint: str
    number: int
    commanded: tuple[str, ...]
    listed: int
    """Robots that it lists, in all; 0: it watches none."""


def nurse(seconds: float, task: NurseTask) -> dict[str, float]:
    """A master without a suit: its CPU time, and what came and went, over so many seconds."""
    return _run(_Nurse(task).measure(seconds))


class _Nurse:
    def __init__(self, task: NurseTask) -> None:
        self._task = task
        self._sent = self._late = 0
        patterns = ["*"] if task.listed else []
        self._config = MasterConfig.model_validate({
            "robots": [*task.commanded, *patterns],
            "operator": {"name": f"{OPERATOR}-{task.number}", "deadman": {"source": "always_held"}},
            "capture": {"buses": [{"name": "none", "interface": "virtual", "channel": "none"}]},
            "nodes": {},
            "link": {"mode": "client", "connect": [task.endpoint]},
        })  # fmt: skip

    async def measure(self, seconds: float) -> dict[str, float]:
        skeleton = self._config.skeleton
        async with open_session(self._config.link) as session:
            fleet = Fleet(self._config, session, skeleton)
            session.declare_operator(self._config.operator.name, [])
            freeze_heap()
            async with asyncio.TaskGroup() as tasks:
                fleet.start(tasks)
                running = [tasks.create_task(self._send(fleet)), tasks.create_task(self._publish(fleet))]
                ready_s = await self._ready(fleet)
                await asyncio.sleep(SETTLE_S)
                figures = await self._window(fleet, seconds)
                for each in [*running, *fleet.tasks]:
                    each.cancel()
        return {**figures, "ready_s": ready_s}

    async def _window(self, fleet: Fleet, seconds: float) -> dict[str, float]:
        before, spent_before_s, began_ns = self._counts(fleet), time.process_time(), monotonic_ns()
        await asyncio.sleep(seconds)
        elapsed_s, spent_s = (monotonic_ns() - began_ns) * 1e-9, time.process_time() - spent_before_s
        after = self._counts(fleet)
        return {
            "core_percent": 100.0 * spent_s / elapsed_s,
            "rss_mb": psutil.Process().memory_info().rss / 1e6,
            **{f"{name}_hz": (after[name] - before[name]) / elapsed_s for name in after},
            "held": sum(robot.taken.held for robot in fleet),
            "listed": len(fleet.watched.roster),
        }

    def _counts(self, fleet: Fleet) -> dict[str, float]:
        states = sum(robot.states for robot in fleet)
        return {"commands": self._sent, "states": states, "summaries": fleet.watched.roster.received}

    async def _ready(self, fleet: Fleet) -> float:
        began_ns = monotonic_ns()
        async with asyncio.timeout(APPEAR_S):
            while not self._all_there(fleet):  # noqa: ASYNC110
                await asyncio.sleep(0.05)
        return (monotonic_ns() - began_ns) * 1e-9

    def _all_there(self, fleet: Fleet) -> bool:
        held = sum(robot.taken.held for robot in fleet)
        return held >= len(self._task.commanded) and len(fleet.watched.roster) >= self._task.listed

    async def _send(self, fleet: Fleet) -> None:
        joints = len(self._config.skeleton.joints)
        grip = Grip(True, False)
        async for due in ticks(TickGrid(monotonic_ns(), to_ns(1.0 / COMMAND.rate_hz))):
            now_ns = due.scheduled_ns
            angles = JointAngleSample(
                16 * due.tick, now_ns, now_ns, np.zeros(joints), np.zeros(joints), np.ones(joints, np.bool_)
            )
            for _ in fleet.send(angles, grip, monotonic_ns()):
                self._sent += 1

    async def _publish(self, fleet: Fleet) -> None:
        async for due in ticks(TickGrid(monotonic_ns(), to_ns(1.0 / STATISTICS.rate_hz))):
            shared = _nothing()
            for robot in fleet:
                robot.publish_metrics(due.scheduled_ns, shared)


def _nothing() -> MasterMetrics:
    return MasterMetrics(
        software=software(), heap=heap_in_use(), ticks=Ticks(0, 0), stages_ms={},
        frames_in_to_put_ms=Summary(0), nodes={}, doubts={}, beyond_reach={}, switches={}, buses={},
        robots={},
    )  # fmt: skip


def _run(work: Coroutine[object, object, Result]) -> Result:
    with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
        return runner.run(work)
