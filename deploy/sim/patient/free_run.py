"""The robot follows an operator through the air for long: a protective stop there is a false one."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from common.link.config import LinkConfig
from common.quaternion import Array
from common.recording.npz import read_arrays
from common.skeleton import Skeleton, load_skeleton
from deploy.sim.patient.operator import TICK_NS, Moves, OperatedRobot
from deploy.sim.patient.robot import Imperfect, TouchingRobot
from deploy.sim.suit.motion import OperatorMotion, load_motion
from slave.config import SlaveConfig
from slave.contact.config import ContactConfig
from slave.guard.states import MOVING, State

MOST_STOPS = 5
"""A robot that is stopped more often does not follow: the flight ends."""
STARTS_S = 0.5
"""The observer settles before the robot is engaged."""


@dataclass(frozen=True, slots=True)
class FreeRun:
    """What came of it."""

    followed_s: float
    """For how long the robot followed."""
    false_stops: tuple[str, ...]
    """The words of each."""
    other_stops: tuple[str, ...]
    """The words of holds and emergency stops for other reasons."""
    nearest: float
    """The largest torque from outside that was seen, as a share of its joint's threshold."""
    joint: str
    """Of that torque."""


class PatientOperator:
    """Moves on only while the robot tracks, and stands still while it aligns, as operators are told to."""

    def __init__(self, moves: Moves) -> None:
        self._moves = moves
        self.moved_s = 0.0
        self.waits = True

    def __call__(self, t_s: float) -> tuple[Array, Array]:
        """Angles and rates (J,) now, whatever the time is."""
        position, velocity = self._moves(self.moved_s)
        return position, np.zeros_like(velocity) if self.waits else velocity


def of_motion(name: str, skeleton: Skeleton) -> Moves:
    """A motion of the simulated operator, again and again."""
    motion: OperatorMotion = load_motion(name, skeleton)

    def moves(t_s: float) -> tuple[Array, Array]:
        position, velocity, _ = motion.state(t_s)
        return position, velocity

    return moves


class RecordedPeople:
    """Recorded joint angles of people, clip after clip, again and again: `Moves`."""

    def __init__(self, file: Path, skeleton: Skeleton) -> None:
        """`file`: `joints`, `rate_hz` and a `*_position_rad` a clip. Raises RecordingError if unreadable."""
        arrays = read_arrays(file)
        self._rate_hz = float(arrays["rate_hz"])
        clips = [
            np.asarray(arrays[key], np.float64) for key in sorted(arrays) if key.endswith("_position_rad")
        ]
        angles = np.concatenate(clips)
        columns = [skeleton.joint_names.index(str(name)) for name in arrays["joints"]]
        positions = np.zeros((len(angles), len(skeleton.joints)))
        positions[:, columns] = angles
        self._positions: Array = np.clip(positions, skeleton.lower_rad, skeleton.upper_rad)
        # the difference of two samples, so that a clip's end is no infinite rate
        rates = np.asarray(np.gradient(self._positions, axis=0)) * self._rate_hz
        self._rates: Array = np.clip(rates, -skeleton.max_velocity_rad_s, skeleton.max_velocity_rad_s)

    @property
    def seconds(self) -> float:
        """Length of all clips."""
        return len(self._positions) / self._rate_hz

    def __call__(self, t_s: float) -> tuple[Array, Array]:
        """Angles and rates (J,)."""
        at = int(t_s * self._rate_hz) % len(self._positions)
        return self._positions[at], self._rates[at]


class FreeFlight:
    """One way through the air, by the slave's whole pipeline; the setpoints are kept for `replay`."""

    def __init__(self, moves: Moves, imperfect: Imperfect, config: ContactConfig) -> None:
        skeleton = load_skeleton("nursing")
        self._joint_names = skeleton.joint_names
        self._operator = PatientOperator(moves)
        slave = SlaveConfig(robot="robot-1", link=LinkConfig(), contact=config)
        self._run = OperatedRobot(slave, TouchingRobot(skeleton, imperfect, steps=1), self._operator)
        self._setpoints: list[Array] = []
        self._followed = 0
        self._largest = np.zeros(len(skeleton.joints))
        self._false: list[str] = []
        self._other: list[str] = []
        self._go_on(STARTS_S)
        self._engage()

    def follow(self, seconds: float) -> None:
        """Follow until the operator has moved for so long; engage again after each stop, five at most."""
        guard = self._run.pipeline.guard
        until_s = self._operator.moved_s + seconds
        while self._operator.moved_s < until_s and len(self._false) + len(self._other) < MOST_STOPS:
            if guard.state not in MOVING:
                contact = guard.counters.losses["contact"] > len(self._false)
                (self._false if contact else self._other).append(guard.reason)
                self._go_on(2.0)
                guard.reset(self._run.now_ns, "for the trial")
                self._go_on(0.2)
                self._engage()
            self._tick()

    def _engage(self) -> None:
        if (why := self._run.pipeline.guard.engage("operator", self._run.now_ns)) is not None:
            raise RuntimeError(f"the robot does not engage: {why}")

    def _go_on(self, seconds: float) -> None:
        for _ in range(round(seconds * 1e9) // TICK_NS):
            self._tick()

    def _tick(self) -> None:
        run = self._run
        self._operator.waits = run.state is not State.TRACK
        run.tick()
        assert run.setpoint is not None
        self._setpoints.append(run.setpoint.position_rad)
        self._followed += run.state in MOVING
        if run.state is State.TRACK:
            self._operator.moved_s += TICK_NS * 1e-9
        np.maximum(self._largest, run.pipeline.contact.share, out=self._largest)

    @property
    def found(self) -> FreeRun:
        """What came of it so far."""
        worst = int(self._largest.argmax())
        return FreeRun(
            self._followed * TICK_NS * 1e-9,
            tuple(self._false),
            tuple(self._other),
            float(self._largest[worst]),
            self._joint_names[worst],
        )

    @property
    def setpoints_rad(self) -> Array:
        """(T, J) what was written to the drives, tick by tick."""
        return np.array(self._setpoints)


def free_run(moves: Moves, seconds: float, imperfect: Imperfect, config: ContactConfig) -> FreeRun:
    """Follow for so long through the air."""
    flight = FreeFlight(moves, imperfect, config)
    flight.follow(seconds)
    return flight.found
