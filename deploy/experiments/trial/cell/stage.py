"""One cell: two hosts and their link, a fresh master and slave on them, the motion, the outage."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from common.clock import monotonic_ns, to_s
from common.config.load import load_config
from common.errors import TandemError
from deploy.examples.profiles import example
from deploy.experiments.trial.cell.choice import why_impossible
from deploy.experiments.trial.cell.conclude import conclude, open_tape
from deploy.experiments.trial.cell.plan import CellKey, TrialPlan
from deploy.experiments.trial.cell.recorder import MessageKeeper
from deploy.experiments.trial.cell.recording import CellCourse, CellMessages, ScriptedOutage
from deploy.experiments.trial.cell.remarks import hold_remarks
from deploy.experiments.trial.cell.result import Cell, CellStatus
from deploy.experiments.trial.cell.tape import AFTER, JUDGED, CellTape
from deploy.harness.engage import EngageDriver, RigRobot, keep_engaged, until_tracking
from deploy.harness.link_settings import needed_age_s, open_timeout_s
from deploy.harness.operator import Operator
from deploy.harness.rig import ROBOT, Rig, open_rig
from deploy.harness.start import start_all
from deploy.sim.network import Network, load_profile, open_network
from deploy.study.blinding import BlindKey, hide_transports
from slave.config import SlaveConfig

START_S = 30.0
"""Processes up, filters settled, clock trusted, lease held."""
ALIGN_S = 25.0
STATISTICS_S = 1.6
"""Statistics come once a second: after this each process has published them once more."""
RETURN_S = 15.0
"""How soon after an outage the robot may be engaged."""
WATCH_S = 0.6
"""How long the robot is watched before it is engaged: it must not move by itself."""
LOOK_S = 0.1


async def run_cell(
    plan: TrialPlan,
    key: CellKey,
    stop: asyncio.Event,
    show: Callable[[str], None],
    folder: Path | None = None,
    hidden: BlindKey | None = None,
) -> Cell:
    """Run it and judge it. What goes wrong in it is its result; only an interruption raises TandemError.

    `folder`: of the trial, where the cell's recording is kept. `hidden`: which transports the codes of a
    blinded trial stand for; no text of the cell names one.
    """
    transport = key.setup.transport if hidden is None else hidden.condition(key.setup.transport).transport
    told = (lambda text: text) if hidden is None else hide_transports
    reason = why_impossible(transport)
    if reason is not None:
        return Cell(key, CellStatus.IMPOSSIBLE, told(reason))
    profile = load_profile(key.setup.profile)
    age_s = plan.max_age_s or needed_age_s(profile)
    opening = f"link.open_timeout_s={open_timeout_s(profile)}"
    overrides = _overrides(plan, key, age_s, opening)
    config = load_config(example("slave", plan.robot), SlaveConfig, overrides["slave"])
    settings = {"guard.max_age_s": f"{age_s:g}"}
    tape = open_tape(folder, key, config, settings)
    try:
        async with (
            open_network(profile, seed=plan.seed_of(key)) as network,
            open_rig(transport, overrides, plan.robot, routed=plan.router, network=network) as rig,
        ):
            course = await _Story(plan, rig, network, stop, show, tape).play(age_s)
            show("stopping")
            statuses = await rig.stop()
    except TandemError as error:
        if tape is not None:
            tape.close(None)
        if stop.is_set():  # a Ctrl-C reaches the processes too: that they end is then no failure
            raise TandemError("interrupted") from None
        return Cell(key, CellStatus.FAILED, told(str(error)), settings=settings)
    ended = tuple(f"the {name} ended with status {status}" for name, status in statuses.items() if status)
    course = replace(course, remarks=tuple(map(told, course.remarks)))
    show("judging")
    return await asyncio.to_thread(conclude, key, course, config, settings, ended, tape)


def _overrides(plan: TrialPlan, key: CellKey, age_s: float, opening: str) -> dict[str, list[str]]:
    return {
        "suit": [f"seed={plan.seed_of(key)}", f'motion="{plan.motion}"'],
        # the simulated operator begins in the zero pose: zeroed there, as the paper's reference was
        "master": ["estimation.zero_pose_s=1.0", opening],
        "slave": [f'track.strategy="{key.setup.strategy}"', f"guard.max_age_s={age_s}", opening],
    }


class _Story:
    """The steps of one cell, on a rig over a network."""

    def __init__(
        self,
        plan: TrialPlan,
        rig: Rig,
        network: Network,
        stop: asyncio.Event,
        show: Callable[[str], None],
        tape: CellTape | None,
    ) -> None:
        self._plan = plan
        self._rig = rig
        self._network = network
        self._stop = stop
        self._show = show
        self._recorder = MessageKeeper(tape)
        self._remarks: list[str] = []
        rig.observer.listeners.append(self._recorder.hear)
        if tape is not None:
            rig.observer.tapes.append(tape.hear)

    async def play(self, max_age_s: float) -> CellCourse:
        """All of it. Raises TandemError."""
        await self._to_track()
        judged, cpu_percent, up, down = await self._judged_time()
        after, outage = None, None
        if self._plan.outage_s:
            after, outage = await self._outage()
        return CellCourse(
            judged=judged,
            max_age_s=max_age_s,
            shared_clock=True,
            after=after,
            outage=outage,
            cpu_percent=cpu_percent,
            up_bytes_s=up,
            down_bytes_s=down,
            remarks=tuple(self._remarks),
        )

    async def _to_track(self) -> None:
        self._show("starting")
        await start_all(self._rig, START_S, self._look)
        self._show("aligning")
        await until_tracking(self._rig, timeout_s=ALIGN_S, check=self._look)

    async def _judged_time(self) -> tuple[CellMessages, dict[str, float], float, float]:
        self._show(f"following for {self._plan.seconds:g} s")
        children = self._rig.children
        self._recorder.take(JUDGED)
        for child in children.values():
            child.measure(first=True)
        before, began_ns = self._network.counters(), monotonic_ns()
        operator = Operator(ROBOT, guard="track")
        driver = EngageDriver(operator, RigRobot(self._rig, waits_until_ready=True))
        await keep_engaged([driver], self._plan.seconds, self._look, LOOK_S)
        self._remarks += hold_remarks(operator.holds, began_ns)
        after, seconds = self._network.counters(), to_s(monotonic_ns() - began_ns)
        for child in children.values():
            child.measure()
        used = {name: child.cpu_percent for name, child in children.items() if name != "suit"}
        up = (after.to_robot.bytes - before.to_robot.bytes) / seconds
        down = (after.to_operator.bytes - before.to_operator.bytes) / seconds
        return self._recorder.take(AFTER), used, up, down

    async def _outage(self) -> tuple[CellMessages, ScriptedOutage]:
        rig, observer = self._rig, self._rig.observer
        self._show(f"outage of {self._plan.outage_s:g} s")
        cut_ns = monotonic_ns()
        await self._network.outage(self._plan.outage_s)
        back_ns = monotonic_ns()
        self._show("waiting for commands to flow again")
        ready_ns = act_ns = None
        try:
            await rig.until(lambda: observer.ready, RETURN_S, "readiness after the outage", self._look)
            ready_ns = monotonic_ns()
            await asyncio.sleep(WATCH_S)
            act_ns = monotonic_ns()
            await until_tracking(rig, timeout_s=ALIGN_S, check=self._look)
        except TandemError as error:
            self._look()
            self._remarks.append(str(error))
        await asyncio.sleep(STATISTICS_S)
        return self._recorder.take(), ScriptedOutage(cut_ns, back_ns, ready_ns, act_ns)

    def _look(self) -> None:
        """Fail early. Raises TandemError."""
        if self._stop.is_set():
            raise TandemError("interrupted")
        self._rig.check()
