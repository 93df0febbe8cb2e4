"""The faults that a soak brings about: rows of the fault table with real processes, each undone again."""

from __future__ import annotations

import random
from collections.abc import Awaitable, Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial

from common.errors import ConfigError, ConfigMistake, TandemError
from deploy.experiments.soak import clock_step
from deploy.experiments.soak import recorder as recording
from deploy.experiments.soak.files.happenings import FaultCourse
from deploy.experiments.soak.stage import Stage
from deploy.harness.faults.fault import Reaction
from deploy.harness.faults.table import FAULTS as ROWS
from deploy.harness.rig import ROUTER

STEPS_S = (60, 3_600, 86_400, 2_592_000)
"""By how much a clock may be stepped: a minute, an hour, a day, a month."""
FILLS_S = 8.0
"""A small disk is full by then."""


@dataclass(slots=True)
class FaultCase:
    """One fault as it happens: where, with which random draws, and what is recorded of it."""

    stage: Stage
    draw: random.Random
    step_s: int | None = None
    """By how much a clock is stepped."""
    node: str = ""
    """The suit's node that falls silent."""
    disk: str = ""
    """How the small disk was made."""
    ended_ns: int | None = None
    """When the process was killed."""
    recorder_life: int = 0
    """The recorder's life that met the full disk."""


Act = Callable[[FaultCase], Awaitable[None]]


async def _needs_nothing(_: Stage) -> str:
    return ""


@dataclass(frozen=True, slots=True)
class SoakFault:
    """One kind. After `begin` it lasts for a while, then `end` undoes it."""

    name: str
    words: str
    row: str
    """The row of the fault table that says what the robot must do; empty where the robot is not concerned."""
    begin: Act
    end: Act
    lasts_s: tuple[float, float] = (1.2, 2.5)
    """Long enough to see the robot stand."""
    ends_process: bool = False
    """A process ends; such a fault does not come in the calm part."""
    lives: bool = True
    """The robot is still heard, so that its reaction can be seen."""
    notices_s: float = 0.0
    """How long the master needs to see it and to tell the robot, whose own times count from then."""
    flow_s: float | None = None
    """Once it is undone, commands must flow again within this; None: they never stop."""
    needs: Callable[[Stage], Awaitable[str]] = _needs_nothing
    """Returns why this host or this rig cannot do it; empty where it can."""

    @property
    def holds(self) -> bool:
        """Whether the robot must hold, and not move until it is engaged anew."""
        return bool(self.row) and ROWS[self.row].reaction is Reaction.HOLDS

    def course(self, number: int, begun_s: float) -> FaultCourse:
        """Its course so far, with what it asks of the robot: it is judged by what stands there."""
        return FaultCourse(
            self.name, number, self.holds, self.lives, self.notices_s, self.flow_s, begun_s=begun_s
        )


async def _kill(name: str, case: FaultCase) -> None:
    case.ended_ns = await case.stage.kill(name)


async def _start(name: str, case: FaultCase) -> None:
    await case.stage.start(name)


async def _start_stepped(name: str, case: FaultCase) -> None:
    case.step_s = case.draw.choice(STEPS_S)
    await case.stage.start(name, clock_step.through(case.step_s))


async def _kill_recorder(case: FaultCase) -> None:
    await case.stage.recorder.until_it_writes()
    await _kill(recording.NAME, case)


async def _restart_recorder(case: FaultCase) -> None:
    case.stage.record(await case.stage.check_recording("kill", case.ended_ns))
    await case.stage.start(recording.NAME)


async def _lose_node(case: FaultCase) -> None:
    nodes = case.stage.rig.skeleton.segment_names
    case.node = case.draw.choice(nodes)
    await case.stage.inject_suit_faults(f'lose = [{{ node = "{case.node}" }}]')


async def _find_node(case: FaultCase) -> None:
    await case.stage.inject_suit_faults("")


async def _fill_disk(case: FaultCase) -> None:
    stage = case.stage
    await stage.recorder.until_it_writes()
    await stage.stop(recording.NAME)
    stage.record(await stage.check_recording("stop"))
    try:
        case.disk = await stage.recorder.start_on_small_disk()
        await stage.recorder.until_it_writes()
    except TandemError:  # the fault does not come about; the recorder goes on as before it
        await stage.stop(recording.NAME)
        await stage.recorder.disk.remove()
        await stage.start(recording.NAME)
        raise
    case.recorder_life = stage.recorder.child.lifetime
    stage.meant.add(recording.NAME)


async def _free_disk(case: FaultCase) -> None:
    stage = case.stage
    child, said = stage.recorder.child, stage.recorder.complaints()
    # one that ended is started again by whoever looks after the processes: that one met no full disk
    lived = child.running and child.lifetime == case.recorder_life
    status = await stage.stop(recording.NAME)
    found = await stage.check_recording("disk full")
    stage.record(replace(found, lived=lived, said=said, status=status))
    await stage.recorder.disk.remove()
    await stage.start(recording.NAME)


async def _cut(case: FaultCase) -> None:
    if case.stage.rig.network is not None:
        case.stage.rig.network.cut()


async def _restore(case: FaultCase) -> None:
    if case.stage.rig.network is not None:
        case.stage.rig.network.restore()


async def _has_network(stage: Stage) -> str:
    return "" if stage.rig.network is not None else "needs a network between two hosts: --profile"


async def _has_router(stage: Stage) -> str:
    return "" if ROUTER in stage.children else "there is no router in between: --router"


async def _can_step(_: Stage) -> str:
    return await clock_step.why_not()


RESTART_S = 15.0
"""By then a killed process is back: it has started, its clock offset, lease and filters have settled."""
SUIT_LOST_S = 0.1
"""`capture.lost_after` at `capture.rate_hz`: until then the master takes a node for one that is late."""
LINK_S = 1.5
"""The target of an outage: commands flow again within this after the link is back."""


def _killed(
    name: str, row: str, *, lives: bool = True, flow_s: float | None = None, notices_s: float = 0.0
) -> SoakFault:
    return SoakFault(
        f"{name}-kill", f"the {name} is killed (kill -9) and started again", row,
        partial(_kill, name), partial(_start, name),
        ends_process=True, lives=lives, flow_s=flow_s, notices_s=notices_s,
    )  # fmt: skip


def _stepped(name: str, row: str, lives: bool) -> SoakFault:
    return SoakFault(
        f"{name}-clock", f"the {name} is killed and comes back with its clock stepped, as after a reboot",
        row,
        partial(_kill, name), partial(_start_stepped, name),
        ends_process=True, lives=lives, flow_s=RESTART_S, needs=_can_step,
    )  # fmt: skip


FAULTS: Mapping[str, SoakFault] = {
    fault.name: fault
    for fault in (
        _killed("master", "master killed", flow_s=RESTART_S),
        _killed("slave", "robot's program killed", lives=False, flow_s=RESTART_S),
        # commands go on, but no joint in them is valid
        _killed("suit", "CAN bus of the suit off", notices_s=SUIT_LOST_S),
        SoakFault(
            "recorder-kill", "the recorder is killed (kill -9) and started again", "",
            _kill_recorder, _restart_recorder, ends_process=True,
        ),
        _stepped("master", "master killed", lives=True),
        _stepped("slave", "robot's program killed", lives=False),
        SoakFault(
            "outage", "nothing passes between the two hosts for some seconds", "link cut",
            _cut, _restore, (3.0, 7.0), flow_s=LINK_S, needs=_has_network,
        ),
        SoakFault(
            "router-restart", "the router is killed (kill -9) and started again", "link cut",
            partial(_kill, ROUTER), partial(_start, ROUTER),
            ends_process=True, lives=False, flow_s=RESTART_S, needs=_has_router,
        ),
        SoakFault(
            "node-loss", "one of the suit's nodes falls silent", "sensor node lost",
            _lose_node, _find_node, (2.0, 6.0),
        ),
        SoakFault(
            "disk-full", "the recorder's disk fills up", "",
            _fill_disk, _free_disk, (FILLS_S, FILLS_S), ends_process=True,
        ),
    )
}  # fmt: skip
"""By name, as `--faults` has them."""


def chosen(text: str) -> list[str]:
    """The names that `all`, `none` or a list with commas means. Raises ConfigError for one that is none."""
    if text == "none":
        return []
    names = list(FAULTS) if text == "all" else [name.strip() for name in text.split(",")]
    mistakes = [
        ConfigMistake("--faults", name, f"all, none or some of {', '.join(FAULTS)}")
        for name in names
        if name not in FAULTS
    ]
    if mistakes:
        raise ConfigError("soak", mistakes)
    return list(dict.fromkeys(names))


async def possible(names: Iterable[str], stage: Stage) -> tuple[list[str], dict[str, str]]:
    """The faults that can be done here, and why the others cannot."""
    why = {name: await FAULTS[name].needs(stage) for name in names}
    return [name for name in why if not why[name]], {name: words for name, words in why.items() if words}
