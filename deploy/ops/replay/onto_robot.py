"""Plays a recorded motion to a simulated robot: a slave's process of its own, which is engaged and followed.

Real drives are refused: a recording has no operator who could let go.
"""

from __future__ import annotations

import asyncio
import signal
import socket
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryFile

from common.clock import monotonic_ns, to_ns, to_s
from common.config.load import load_config
from common.errors import CodecError, TandemError
from common.link import Link, open_session
from common.link.config import LinkConfig
from common.process.pacing import TickGrid
from common.process.ticker import ticks
from common.wire.codec import decode
from common.wire.messages import Action, RobotState
from common.wire.topics import COMMAND, STATE
from deploy.client.ask import ask
from deploy.client.destination import Destination
from deploy.harness.spawn import Spawned
from deploy.ops.replay.played import FOLLOWS, FollowedWatch, PlayedFindings, PlayedMotion
from master.deadman.grip import Grip
from master.joint_angles.sample import JointAngleSample
from master.robot import CommandedRobot
from slave.config import SlaveConfig

OPERATOR = "replay"
SIMULATED = {"mujoco", "absent"}
"""Backends that move nothing."""
ENGAGED_S = 60.0
ASK_S = 1.0
END_S = 5.0


def simulated(file: Path) -> SlaveConfig:
    """A slave's file whose robot is a simulated one. Raises TandemError for real drives."""
    config = load_config(file, SlaveConfig)
    real = sorted(set(config.servos.names) - SIMULATED)
    if real:
        raise TandemError(
            f"{file}: [servos] backend is {', '.join(real)}: a recording is played to a simulated robot only "
            "(mujoco), since it has no operator who could let go"
        )
    return config


async def play(
    motion: PlayedMotion, file: Path, speed: float, stop: asyncio.Event, report: Callable[[str], None]
) -> PlayedFindings:
    """Start the slave of a file at a port of its own, engage it and play. Raises TandemError."""
    config = simulated(file)
    endpoint = _free_endpoint()
    report(f"starting {config.robot} at {endpoint}")
    with TemporaryFile() as output:
        overrides = ["--set", f'link={{listen=["{endpoint}"]}}']
        slave = Spawned([sys.executable, "-m", "deploy", "slave", str(file), *overrides], output)
        try:
            playing = _Playing(motion, config, speed, stop, report, slave)
            return await playing.run(LinkConfig(connect=[endpoint]))
        except TandemError as error:
            output.seek(0)
            lines = output.read().decode(errors="replace").strip().splitlines()
            raise TandemError(f"{error}{'; the slave said: ' + lines[-1] if lines else ''}") from None
        finally:
            await _end(slave)


async def _end(slave: Spawned) -> None:
    slave.send_signal(signal.SIGTERM)
    try:
        await asyncio.wait_for(slave.wait(), END_S)
    except TimeoutError:
        slave.kill()


def _free_endpoint() -> str:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        return f"tcp/127.0.0.1:{taken.getsockname()[1]}"


class _Playing:
    """One motion under way."""

    def __init__(
        self,
        motion: PlayedMotion,
        config: SlaveConfig,
        speed: float,
        stop: asyncio.Event,
        report: Callable[[str], None],
        slave: Spawned,
    ) -> None:
        self._motion, self._config, self._speed = motion, config, speed
        self._stop, self._report, self._slave = stop, report, slave
        self._watch = FollowedWatch(motion, config.skeleton.joint_names, speed)
        self._guard = ""
        self._reason = "it was never heard"
        self._began_ns: int | None = None

    async def run(self, link: LinkConfig) -> PlayedFindings:
        """Engage, play, disengage."""
        async with open_session(link) as session, open_session(link) as observing:
            observing.link(self._config.robot).subscribe(STATE, self._on_state)
            commanding = session.link(self._config.robot)
            robot = CommandedRobot(
                self._config.robot, OPERATOR, len(self._config.skeleton.joints), link=commanding
            )
            keeping = asyncio.create_task(robot.run())
            where = Destination(link, (self._config.robot,), OPERATOR)
            engaging = asyncio.create_task(self._engage(commanding, where))
            try:
                await self._send(robot)
            finally:
                for task in (keeping, engaging):
                    task.cancel()
                    with suppress(asyncio.CancelledError, Exception):
                        await task
            await ask(commanding, where, Action.DISENGAGE)
        return self._watch.findings()

    def _recorded_s(self, now_ns: int) -> float:
        """Which instant of the recording it is now; 0 until the robot follows."""
        return 0.0 if self._began_ns is None else self._speed * to_s(now_ns - self._began_ns)

    async def _send(self, robot: CommandedRobot) -> None:
        give_up_ns = monotonic_ns() + to_ns(ENGAGED_S)
        async for due in ticks(TickGrid(monotonic_ns(), round(1e9 / COMMAND.rate_hz))):
            now_ns = monotonic_ns()
            recorded_s = self._recorded_s(now_ns)
            if self._stop.is_set() or recorded_s > self._motion.seconds:
                return
            if self._slave.returncode is not None:
                raise TandemError(
                    f"{self._config.robot}: its process ended with status {self._slave.returncode}"
                )
            if self._began_ns is None and now_ns > give_up_ns:
                raise TandemError(
                    f"{self._config.robot}: it did not follow within {ENGAGED_S:.0f} s: {self._reason}"
                )
            position, rate, valid = self._motion.at(recorded_s, self._speed)
            rate = rate if self._began_ns is not None else 0.0 * rate
            sample = JointAngleSample(due.tick, now_ns, now_ns, position, rate, valid)
            robot.send(sample, Grip(deadman_held=True), now_ns)
            self._report(f"{self._guard or 'waiting'}, {recorded_s:.1f} of {self._motion.seconds:.1f} s")

    async def _engage(self, link: Link, where: Destination) -> None:
        """Ask until it follows; once more after each hold, as an operator would."""
        while True:
            if self._guard == "hold":
                for answer in await ask(link, where, Action.ENGAGE):
                    self._reason = answer.text
            await asyncio.sleep(ASK_S)

    def _on_state(self, payload: bytes, arrived_ns: int) -> None:
        try:
            state = decode(payload, RobotState, len(self._config.skeleton.joints))
        except CodecError:
            return
        self._guard = state.guard
        if self._began_ns is None:
            if state.guard != FOLLOWS:
                return
            self._began_ns = arrived_ns
        self._watch.take(state, self._recorded_s(arrived_ns))
