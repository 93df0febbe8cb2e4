"""Faults that are tried with real processes: programs are killed or stopped while the drives run on.

Encoders are read from the drives' CAN buses, so that they are seen whatever becomes of the slave. Real time:
figures vary by a few hundredths of a second from run to run, and more on a machine that is busy.
"""

from __future__ import annotations

import asyncio
import signal
from collections.abc import Awaitable, Callable
from dataclasses import dataclass

import numpy as np

from common.clock import monotonic_ns, to_ns
from common.errors import TandemError
from deploy.harness.faults.drive_encoders import SYNC_S, DriveEncoders
from deploy.harness.faults.fault import BRAKED_S, NOTICED_S, FaultRow, Reaction
from deploy.harness.faults.judge import FaultOutcome, moved_beyond, standing_amiss
from deploy.harness.host import HostWatch, watch_host
from deploy.harness.rig import DRIVES, Rig, open_rig
from deploy.harness.start import start_tracking
from deploy.measure.stillness import StoppingMotion, stillness

START_S = 40.0
TRIES = 4
WATCH_S = 2.0
FAST_RAD_S = 0.8
"""The operator moves some joint at least so fast when the fault comes."""
START_AGAIN = "Start it again, then engage; the robot goes slowly to the operator's posture."
DRIVES_STOP = "The drives miss the program's heartbeat, brake by themselves and stand."
DRIVES_STAND_S = 0.2 + 0.04 + BRAKED_S
"""The drives' heartbeat time, and two of its periods."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ProcessFault(FaultRow):
    """A row that needs real processes."""

    act: Callable[[Rig], Awaitable[object]]
    alive: bool = True
    """Whether the slave lives on, so that its guard's state can be asked."""


async def _pause_master(rig: Rig) -> None:
    rig.children["master"].send(signal.SIGSTOP)
    await asyncio.sleep(1.0)
    rig.children["master"].send(signal.SIGCONT)


PROCESSES = (
    ProcessFault(
        name="master killed",
        done="The master's process is killed without a warning.",
        reaction=Reaction.HOLDS,
        robot="Brakes and stands.",
        person=START_AGAIN,
        act=lambda rig: rig.children["master"].kill(),
        stands_s=NOTICED_S + BRAKED_S,
    ),
    ProcessFault(
        name="master stopped",
        done="The master's process is stopped for 1 s (SIGSTOP), then goes on.",
        reaction=Reaction.HOLDS,
        robot="Brakes and stands. When the master goes on it still stands.",
        person="Engage.",
        act=_pause_master,
        stands_s=NOTICED_S + BRAKED_S,
    ),
    ProcessFault(
        name="robot's program told to stop",
        done="The slave is sent SIGTERM, as the host does when it shuts down.",
        reaction=Reaction.HOLDS,
        robot=DRIVES_STOP,
        person=START_AGAIN,
        act=lambda rig: rig.children["slave"].stop(),
        stands_s=DRIVES_STAND_S,
        alive=False,
    ),
    ProcessFault(
        name="robot's program killed",
        done="The slave is killed without a warning (kill -9).",
        reaction=Reaction.HOLDS,
        robot=DRIVES_STOP,
        person=START_AGAIN,
        act=lambda rig: rig.children["slave"].kill(),
        stands_s=DRIVES_STAND_S,
        alive=False,
    ),
)


async def try_with_processes(fault: ProcessFault) -> FaultOutcome:
    """Try it. Try again if it failed while the host itself is shown to have stalled.

    Raises TandemError where the robot does not follow the operator when the fault is to come.
    """
    for left in reversed(range(TRIES)):
        async with watch_host() as host:
            began_ns = monotonic_ns()
            try:
                outcome = await _try_once(fault, host)
            except TandemError:
                if not left or not await host.excuse(began_ns):
                    raise
                continue
            if not outcome.wrong or not left or not await host.excuse(began_ns):
                break
    return outcome


async def _try_once(fault: ProcessFault, host: HostWatch) -> FaultOutcome:
    overrides = {
        "slave": ['servos.backend="canopen"', 'camera.source="off"'],
        "master": ["estimation.zero_pose_s=1.0"],
        DRIVES: [],
    }
    async with open_rig(overrides=overrides) as rig:
        await start_tracking(rig)
        with DriveEncoders(rig.can_port, rig.skeleton) as encoders:
            observer = rig.observer
            await rig.until(lambda: _fast(rig), START_S, "fast motion")
            await _heard(encoders)
            if observer.guard != "track":
                raise TandemError(f"the robot left track before the fault: {observer.waiting_for()}")
            begun_ns = monotonic_ns()
            acting = asyncio.ensure_future(_done(fault.act(rig)))
            # until the slave's own SYNC must have stopped, another would disturb its cycle
            await asyncio.sleep(0.05)
            encoders.sync = not fault.alive
            await asyncio.sleep(WATCH_S)
            await acting
            course = encoders.course(begun_ns)
            await host.known(monotonic_ns())
            lost = host.lost(begun_ns, begun_ns + to_ns(fault.stands_s or 0.0))
            state = observer.guard if fault.alive else "gone"
            reason = observer.state.reason if fault.alive and observer.state else "the program does not run"
    seen = stillness(course, rig.skeleton, np.ones(len(rig.skeleton.joints), np.bool_))
    wrong = [*moved_beyond(course, rig.skeleton), *_amiss(fault, course, state)]
    wrong += [f"{late}; meanwhile {lost}" for late in standing_amiss(fault, seen, lost.excused_s)]
    return FaultOutcome(fault, state, reason, seen, tuple(wrong))


def _amiss(fault: ProcessFault, course: StoppingMotion, state: str) -> list[str]:
    heard_s = float(course.at_s[-1])
    return [
        *["the encoders were not heard until the end"] * (heard_s < WATCH_S - 0.3),
        *[f"the guard is in {state}, not in hold"] * (fault.alive and state != "hold"),
    ]


def _fast(rig: Rig) -> bool:
    command = rig.observer.command
    return command is not None and float(np.abs(command.velocity_rad_s).max()) > FAST_RAD_S


async def _heard(encoders: DriveEncoders) -> None:
    """Until a second of readings is there. Raises TandemError naming the joints that are not heard."""
    deadline_ns = monotonic_ns() + to_ns(10.0)
    while encoders.rows < 1.0 / SYNC_S:
        if monotonic_ns() > deadline_ns:
            silent = encoders.silent() or "nobody now"
            raise TandemError(f"{encoders.rows} readings in 10 s; not heard: {silent}")
        await asyncio.sleep(0.05)


async def _done(act: Awaitable[object]) -> None:
    await act
