"""Rows that need processes to kill: the whole way with the drives in a process of their own.

Encoders are read from the drives' CAN buses, so that they are seen whatever becomes of the slave. Real time:
figures vary by a few hundredths of a second from run to run, and more on a machine that is busy.
"""

from __future__ import annotations

import asyncio
import signal
import threading
from collections.abc import Awaitable, Callable
from dataclasses import dataclass

import can
import numpy as np

from common.can.interface import open_bus
from common.clock import monotonic_ns, to_ns, to_s
from common.config.load import load_config
from common.errors import TandemError
from common.quaternion import Array
from common.skeleton import Skeleton
from deploy.examples.profiles import NURSING, example
from deploy.experiments.faults.fault import Fault, Reaction
from deploy.experiments.faults.limits import moved_beyond
from deploy.experiments.faults.scene import Scene
from deploy.experiments.faults.trial import Outcome
from deploy.harness.excuse import Lost
from deploy.harness.host import HostWatch, watch_host
from deploy.harness.rig import DRIVES, Rig, drive_buses, open_rig
from deploy.harness.start import start_tracking
from deploy.measure.stillness import StoppingMotion, stillness
from slave.config import SlaveConfig
from slave.encoders.counts import Encoders
from slave.servos.canopen.config import CanopenConfig
from slave.servos.canopen.pdo import COUNT_BITS, SYNC, TPDO1

START_S = 40.0
TRIES = 4
WATCH_S = 2.0
FAST_RAD_S = 0.8
"""The operator moves some joint at least so fast when the fault comes."""
SYNC_S = 0.02


@dataclass(frozen=True, slots=True)
class ProcessFault:
    """A row, and what is done to the processes. `alive`: whether the slave lives on and can be asked."""

    row: Fault
    act: Callable[[Rig], Awaitable[object]]
    alive: bool


def _in_processes(_: Scene) -> None:
    raise TandemError("this fault needs processes: it is not tried on the virtual clock")


async def _pause_master(rig: Rig) -> None:
    rig.children["master"].send(signal.SIGSTOP)
    await asyncio.sleep(1.0)
    rig.children["master"].send(signal.SIGCONT)


_ENGAGE = "Start it again, then engage; the robot goes slowly to the operator's posture."
PROCESS_FAULTS = (
    ProcessFault(
        Fault(
            "master killed", "The master's process is killed without a warning.",
            Reaction.HOLDS, "Brakes and stands.", _ENGAGE, _in_processes, stands_s=0.21 + 0.3,
        ),
        lambda rig: rig.children["master"].kill(),
        alive=True,
    ),
    ProcessFault(
        Fault(
            "master stopped", "The master's process is stopped for 1 s (SIGSTOP), then goes on.",
            Reaction.HOLDS, "Brakes and stands. When the master goes on it still stands.",
            "Engage.", _in_processes, stands_s=0.21 + 0.3,
        ),
        _pause_master,
        alive=True,
    ),
    ProcessFault(
        Fault(
            "robot's program told to stop", "The slave is sent SIGTERM, as the host does when it shuts down.",
            Reaction.HOLDS, "The drives miss the program's heartbeat, brake by themselves and stand.",
            _ENGAGE, _in_processes, stands_s=0.2 + 0.04 + 0.3,
        ),
        lambda rig: rig.children["slave"].stop(),
        alive=False,
    ),
    ProcessFault(
        Fault(
            "robot's program killed", "The slave is killed without a warning (kill -9).",
            Reaction.HOLDS, "The drives miss the program's heartbeat, brake by themselves and stand.",
            _ENGAGE, _in_processes, stands_s=0.2 + 0.04 + 0.3,
        ),
        lambda rig: rig.children["slave"].kill(),
        alive=False,
    ),
)  # fmt: skip


async def run_process_trial(fault: ProcessFault, host: HostWatch) -> Outcome:
    """Try it. Raises TandemError where the robot does not follow the operator when the fault is to come."""
    overrides = {
        "slave": ['servos.backend="canopen"', 'camera.source="off"'],
        "master": ["estimation.zero_pose_s=1.0"],
        DRIVES: [],
    }
    async with open_rig(overrides=overrides) as rig:
        await start_tracking(rig)
        with EncoderWatch(rig.can_port, rig.skeleton) as watch:
            observer = rig.observer
            await rig.until(lambda: _fast(rig), START_S, "fast motion")
            await _heard(watch)
            if observer.guard != "track":
                raise TandemError(f"the robot left track before the fault: {observer.waiting_for()}")
            begun_ns = monotonic_ns()
            acting = asyncio.ensure_future(_done(fault.act(rig)))
            # until the slave's own SYNC must have stopped, another would disturb its cycle
            await asyncio.sleep(0.05)
            watch.sync = not fault.alive
            await asyncio.sleep(WATCH_S)
            await acting
            course = watch.course(begun_ns)
            await host.known(monotonic_ns())
            bound_ns = begun_ns + to_ns(fault.row.stands_s or 0.0)
            lost = host.lost(begun_ns, bound_ns)
            state = observer.guard if fault.alive else "gone"
            reason = observer.state.reason if fault.alive and observer.state else "the program does not run"
    return _judge(fault, course, rig.skeleton, state, reason, lost)


async def tried(fault: ProcessFault) -> Outcome:
    """Try it. Try again if it failed while the host itself is shown to have stalled.

    Raises TandemError where the robot does not follow the operator when the fault is to come.
    """
    for left in reversed(range(TRIES)):
        async with watch_host() as host:
            began_ns = monotonic_ns()
            try:
                outcome = await run_process_trial(fault, host)
            except TandemError:
                if not left or not await host.excuse(began_ns):
                    raise
                continue
            if not outcome.wrong or not left or not await host.excuse(began_ns):
                break
    return outcome


async def _heard(watch: EncoderWatch) -> None:
    """Until a second of readings is there. Raises TandemError naming the joints that are not heard."""
    deadline_ns = monotonic_ns() + to_ns(10.0)
    while watch.rows < 1.0 / SYNC_S:
        if monotonic_ns() > deadline_ns:
            raise TandemError(f"{watch.rows} readings in 10 s; not heard: {watch.silent() or 'nobody now'}")
        await asyncio.sleep(0.05)


async def _done(act: Awaitable[object]) -> None:
    await act


def _fast(rig: Rig) -> bool:
    command = rig.observer.command
    return command is not None and float(np.abs(command.velocity_rad_s).max()) > FAST_RAD_S


def _judge(
    fault: ProcessFault, course: StoppingMotion, skeleton: Skeleton, state: str, reason: str, lost: Lost
) -> Outcome:
    """`lost`: what the host lost from the fault to the row's bound."""
    measured = stillness(course, skeleton, np.ones(len(skeleton.joints), np.bool_))
    wrong = moved_beyond(course, skeleton)
    if course.at_s[-1] < WATCH_S - 0.3:
        wrong.append("the encoders were not heard until the end")
    if fault.alive and state != "hold":
        wrong.append(f"the guard is in {state}, not in hold")
    if measured.standstill_s is None:
        wrong.append("still moves at the end of the trial")
    elif fault.row.stands_s is not None and measured.standstill_s > fault.row.stands_s + lost.excused_s:
        late = f"stands after {measured.standstill_s:.3f} s, at most {fault.row.stands_s:g} s"
        wrong.append(f"{late}; meanwhile {lost}")
    return Outcome(fault.row, state, reason, None, measured, None, {}, tuple(wrong))


class EncoderWatch:
    """Listens on the drives' buses in a thread of its own, and sends SYNC where nobody else does any more."""

    def __init__(self, can_port: int, skeleton: Skeleton) -> None:
        self._skeleton = skeleton
        overrides = ['servos.backend="canopen"', *drive_buses(can_port)]
        config = load_config(example("slave", NURSING), SlaveConfig, overrides)
        canopen = config.servos.section(CanopenConfig)
        drives = canopen.drives_of(skeleton)
        self._buses = [open_bus(bus) for bus in canopen.buses]
        self._joints = {
            (bus.name, TPDO1 + drive.id): joint
            for bus in canopen.buses
            for joint, drive in enumerate(drives.values())
            if drive.bus == bus.name
        }
        self._names = [bus.name for bus in canopen.buses]
        self._encoders = Encoders(skeleton, config.encoders)
        self._counts = np.zeros(len(skeleton.joints), np.int64)
        self._heard_ns = np.zeros(len(skeleton.joints), np.int64)
        self._noted_ns = 0
        self._seen: list[tuple[int, Array]] = []
        self._stop = threading.Event()
        self.sync = False
        self._thread = threading.Thread(target=self._listen, name="encoders", daemon=True)

    def __enter__(self) -> EncoderWatch:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()
        for bus in self._buses:
            bus.shutdown()

    @property
    def rows(self) -> int:
        """Readings of the whole robot so far."""
        return len(self._seen)

    def silent(self) -> list[str]:
        """Joints whose encoders were not heard lately."""
        late = monotonic_ns() - self._heard_ns > to_ns(5.0 * SYNC_S)
        return [name for name, silent in zip(self._skeleton.joint_names, late, strict=True) if silent]

    def course(self, fault_ns: int) -> StoppingMotion:
        """What the encoders showed; where they came to rest stands for the last setpoint."""
        rows = [row for row in list(self._seen) if row[0] >= fault_ns - to_ns(0.2)]
        encoder = np.array([position for _, position in rows])
        at_s = np.array([to_s(at_ns - fault_ns) for at_ns, _ in rows])
        return StoppingMotion(at_s, np.broadcast_to(encoder[-1], encoder.shape), encoder)

    def _listen(self) -> None:
        due_ns = 0
        while not self._stop.is_set():
            if self.sync and monotonic_ns() >= due_ns:
                due_ns = monotonic_ns() + to_ns(SYNC_S)
                for bus in self._buses:
                    bus.send(can.Message(arbitration_id=SYNC, is_extended_id=False))
            for name, bus in zip(self._names, self._buses, strict=True):
                # a few at a time: a bus that is never silent must not keep the other waiting
                for _ in range(len(self._counts)):
                    message = bus.recv(0.001)
                    if message is None:
                        break
                    self._take(name, message)
            self._note()

    def _take(self, bus: str, message: can.Message) -> None:
        joint = self._joints.get((bus, message.arbitration_id))
        if joint is not None and len(message.data) >= 4:
            self._counts[joint] = int.from_bytes(message.data[2:4], "little") & COUNT_BITS
            self._heard_ns[joint] = monotonic_ns()

    def _note(self) -> None:
        """A row a period, unless a drive was not heard lately: what is not known must not look still."""
        now_ns = monotonic_ns()
        if now_ns - self._noted_ns >= to_ns(SYNC_S) and now_ns - self._heard_ns.min() <= to_ns(5.0 * SYNC_S):
            self._noted_ns = now_ns
            self._seen.append((now_ns, self._encoders.position_rad(self._counts)))
