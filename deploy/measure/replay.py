"""How well each tracking strategy follows the same commands: they are replayed on the simulated robot.

Two runs with two strategies would differ in more than the strategy. So the commands that the slave accepted
pass tracker, limits and simulated robot once more, at their real arrival times, on a virtual clock. All
stamps must be of one clock: no offset is applied.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from common.clock import NS_PER_S, to_ns
from common.quaternion import Array
from common.wire.messages import Command, Mask, RobotState
from deploy.measure import FollowedMotion, MovedSeries, TruthSeries, motion
from slave.config import SlaveConfig
from slave.encoders.counts import Encoders
from slave.limit.damper import DistanceDamper
from slave.limit.limit import SetpointLimiter
from slave.servos.mujoco.simulated import SimulatedRobot
from slave.track.config import STRATEGIES, make_tracker

MOST_S = 30.0
"""Only the end of a longer run is replayed: 1.3 s of work a strategy, however long the run was."""


@dataclass(frozen=True, slots=True)
class Arrival:
    """A command that the slave accepted, and when it came."""

    received_ns: int
    """Slave's clock."""
    command: Command


def arrivals(commands: Iterable[Command], states: Iterable[RobotState]) -> list[Arrival]:
    """The accepted commands in the order of their arrival.

    States echo the newest accepted command, several states to each command: what none echoes was refused.
    """
    received_ns = {s.echo.sequence: s.echo.received_ns for s in states if s.echo is not None}
    accepted = [Arrival(received_ns[c.sequence], c) for c in commands if c.sequence in received_ns]
    return sorted(accepted, key=lambda arrival: arrival.received_ns)


@dataclass(frozen=True, slots=True)
class Comparison:
    """The run and its replays, judged over the same instants."""

    as_run: FollowedMotion
    replayed: dict[str, FollowedMotion]
    """By strategy, on the simulated robot; the run's own strategy shows how true the replay is."""

    @property
    def rmse_over_latest(self) -> float:
        """Same-instant RMSE of the real run divided by the RMSE of `latest`."""
        return self.as_run.rmse_deg / self.replayed["latest"].rmse_deg


def compare(
    truth: TruthSeries,
    moved: MovedSeries,
    accepted: Sequence[Arrival],
    config: SlaveConfig,
    strategies: Iterable[str] = STRATEGIES,
) -> Comparison | None:
    """Replay the end of the run with each strategy; None where there is too little to judge."""
    if not accepted or not moved.tracking.any():
        return None
    moved = _end_of(moved)
    names = config.skeleton.joint_names
    as_run = motion(truth, moved, names)
    if as_run is None:
        return None
    replayed: dict[str, FollowedMotion] = {}
    for strategy in strategies:
        judged = motion(truth, replay(accepted, moved, strategy, config), names)
        if judged is None:
            return None
        replayed[strategy] = judged
    return Comparison(as_run, replayed)


def replay(
    accepted: Sequence[Arrival], moved: MovedSeries, strategy: str, config: SlaveConfig
) -> MovedSeries:
    """The virtual robot's encoders, read when the real ones were; at least one row of `moved` must track.

    It begins at rest where the real robot stood when it began to track, with the limits of `config`. A
    joint that a command calls not valid is held; the guard's slow way back from that is not played.
    """
    period_ns = round(NS_PER_S / config.loop.rate_hz)
    moved = _rows(moved, slice(int(np.argmax(moved.tracking)), None))
    now_ns, taken = int(moved.encoder_ns[0]), 0
    slave = _VirtualSlave(strategy, config, now_ns, moved.position_rad[0])
    stamps_ns, positions = [], []
    for wanted_ns in moved.encoder_ns.tolist():
        while now_ns <= wanted_ns:
            while taken < len(accepted) and accepted[taken].received_ns <= now_ns:
                slave.accept(accepted[taken])
                taken += 1
            slave.tick(now_ns, period_ns)
            now_ns += period_ns
        stamp_ns, position_rad = slave.read()
        stamps_ns.append(stamp_ns)
        positions.append(position_rad)
    return MovedSeries(
        encoder_ns=np.array(stamps_ns, dtype=np.int64),
        position_rad=np.array(positions),
        valid=moved.valid,
        tracking=moved.tracking,
    )


def _end_of(moved: MovedSeries) -> MovedSeries:
    """The last MOST_S of it, up to its last tracking row."""
    last = int(np.flatnonzero(moved.tracking)[-1])
    first = int(np.searchsorted(moved.encoder_ns, moved.encoder_ns[last] - to_ns(MOST_S)))
    return _rows(moved, slice(first, last + 1))


def _rows(moved: MovedSeries, rows: slice) -> MovedSeries:
    return MovedSeries(
        moved.encoder_ns[rows], moved.position_rad[rows], moved.valid[rows], moved.tracking[rows]
    )


class _VirtualSlave:
    """From an accepted command to the encoders: tracker ▸ limiter ▸ robot."""

    def __init__(self, strategy: str, config: SlaveConfig, now_ns: int, position_rad: Array) -> None:
        skeleton = config.skeleton
        self._tracker = make_tracker(
            config.track.model_copy(update={"strategy": strategy}), config.servos.bus_lag_s
        )
        self._limits = config.guard.limits(skeleton)
        damper = DistanceDamper(skeleton, config.guard.self_margin_cm, config.guard.zones)
        self._limiter = SetpointLimiter(skeleton.joint_names, self._limits, damper)
        self._limiter.seat(position_rad)
        self._robot = SimulatedRobot(skeleton, config.encoders, now_ns, position_rad)
        self._encoders = Encoders(skeleton, config.encoders)
        self._held: Mask = np.ones(len(position_rad), np.bool_)

    def accept(self, arrival: Arrival) -> None:
        command = arrival.command
        self._held = ~command.valid
        self._tracker.accept(
            command.stamps.sampled_ns, arrival.received_ns, command.position_rad, command.velocity_rad_s
        )

    def tick(self, now_ns: int, period_ns: int) -> None:
        self._robot.advance(now_ns)
        target = self._tracker.target(now_ns)
        if target is None:
            return
        limits = self._limits
        self._limiter.step(
            now_ns, period_ns / NS_PER_S, target.position_rad, target.velocity_rad_s, self._held,
            limits.max_velocity_rad_s, limits.max_acceleration_rad_s2,
        )  # fmt: skip
        self._robot.write(self._limiter.position_rad)

    def read(self) -> tuple[int, Array]:
        """When the encoders were latched, and the joint angles (J,) they show."""
        reading = self._robot.read()
        return reading.read_ns, self._encoders.position_rad(reading.counts)
