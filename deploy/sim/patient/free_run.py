"""The robot follows an operator through the air for long: a protective stop there is a false one."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from common.link.config import LinkConfig
from common.quaternion import Array
from common.recording.npz import read_arrays
from common.skeleton import Skeleton, load_skeleton
from deploy.sim.patient.operator import Moves, OperatedRobot
from deploy.sim.patient.robot import Imperfect, TouchingRobot
from deploy.sim.suit.motion import OperatorMotion, load_motion
from slave.config import SlaveConfig
from slave.contact.config import ContactConfig
from slave.guard.states import MOVING


@dataclass(frozen=True, slots=True)
class FreeRun:
    """What came of it."""

    followed_s: float
    """For how long the robot followed."""
    false_stops: tuple[str, ...]
    """The words of each."""
    other_holds: int
    """Holds and emergency stops for other reasons."""
    nearest: float
    """The largest torque from outside that was seen, as a share of its joint's threshold."""
    joint: str
    """Of that torque."""


def of_motion(name: str, skeleton: Skeleton) -> Moves:
    """A motion of the simulated operator, again and again."""
    motion: OperatorMotion = load_motion(name, skeleton)

    def moves(t_s: float) -> tuple[Array, Array]:
        position, velocity, _ = motion.state(t_s)
        return position, velocity

    return moves


def of_person(file: Path, skeleton: Skeleton) -> Moves:
    """Recorded joint angles of people, clip after clip: `joints`, `rate_hz` and a `*_position_rad` a clip.

    Raises RecordingError where the file cannot be read.
    """
    arrays = read_arrays(file)
    rate_hz = float(arrays["rate_hz"])
    clips = [np.asarray(arrays[key], np.float64) for key in sorted(arrays) if key.endswith("_position_rad")]
    angles = np.concatenate(clips)
    columns = [skeleton.joint_names.index(str(name)) for name in arrays["joints"]]
    positions = np.zeros((len(angles), len(skeleton.joints)))
    positions[:, columns] = angles
    positions = np.clip(positions, skeleton.lower_rad, skeleton.upper_rad)
    # the difference of two samples, so that a clip's end is no infinite rate
    rates: Array = np.asarray(np.gradient(positions, axis=0)) * rate_hz
    rates = np.clip(rates, -skeleton.max_velocity_rad_s, skeleton.max_velocity_rad_s)

    def moves(t_s: float) -> tuple[Array, Array]:
        at = int(t_s * rate_hz) % len(positions)
        return positions[at], rates[at]

    return moves


def free_run(moves: Moves, seconds: float, imperfect: Imperfect, config: ContactConfig) -> FreeRun:
    """Follow for so long; engage again after each stop, and reset what stops for good."""
    skeleton = load_skeleton("nursing")
    slave = SlaveConfig(robot="robot-1", link=LinkConfig(), contact=config)
    run = OperatedRobot(slave, TouchingRobot(skeleton, imperfect, steps=1), moves)
    run.run(0.5)
    watch, guard = run.pipeline.contact, run.pipeline.guard
    followed = 0
    largest = np.zeros(len(skeleton.joints))
    false_stops: list[str] = []
    holds = -1
    end_ns = round(seconds * 1e9)
    while run.now_ns < end_ns:
        if guard.state not in MOVING:
            if guard.counters.losses["contact"] > len(false_stops):
                false_stops.append(guard.reason)
            else:
                holds += 1
            run.run(2.0)
            guard.reset(run.now_ns, "for the trial")
            run.run(0.2)
            guard.engage("operator", run.now_ns)
        run.tick()
        followed += guard.state in MOVING
        if watch.observer.ready:
            np.maximum(largest, np.abs(watch.observer.external_nm) / watch.threshold_nm, out=largest)
    worst = int(largest.argmax())
    return FreeRun(
        followed * 0.005, tuple(false_stops), holds, float(largest[worst]), skeleton.joint_names[worst]
    )
