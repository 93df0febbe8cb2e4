"""The setpoints of one way through the air, again and again to robots that differ: contact detection alone.

Where the robot never stops, what is written to its drives does not depend on its masses, nor on its encoders'
steps; their torque limits depend on the setpoints and on what is declared. So the pipeline makes setpoints
once, and each robot then costs its physics, its torque limits and its observer only.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from common.clock import to_s
from common.quaternion import Array
from common.skeleton import load_skeleton
from deploy.sim.patient.operator import TICK_NS
from deploy.sim.patient.robot import LOADED, Imperfect, TouchingRobot
from slave.contact.config import ContactConfig
from slave.contact.torque_limit import TorqueLimit
from slave.contact.watch import ContactWatch
from slave.encoders.counts import Encoders
from slave.model.build import build_model
from slave.servos.payload import PayloadConfig


@dataclass(frozen=True, slots=True)
class Lap:
    """What the watch found on one way."""

    seconds: float
    findings: tuple[str, ...]
    """The words of each finding: each would have been a stop."""
    nearest: float
    """The largest torque from outside that was seen, as a share of its joint's threshold."""
    joint: str
    """Of that torque."""


def held(mass_kg: float) -> dict[str, PayloadConfig]:
    """`[servos.payload]` of what `Imperfect.payload_kg` adds: at the right hand's own centre."""
    centre_m = build_model(load_skeleton("nursing")).body(LOADED).ipos.tolist()
    return {LOADED: PayloadConfig(mass_kg=mass_kg, center_m=centre_m)}


def replay(
    setpoints_rad: Array,
    imperfect: Imperfect,
    config: ContactConfig,
    payload: Mapping[str, PayloadConfig] | None = None,
) -> Lap:
    """Write setpoints (T, J) to a robot, tick by tick, and watch it. `payload`: what is declared."""
    skeleton = load_skeleton("nursing")
    robot, encoders = TouchingRobot(skeleton, imperfect, steps=1), Encoders(skeleton)
    watch, limit = ContactWatch(skeleton, config, payload), TorqueLimit(config)
    largest, findings = np.zeros(len(skeleton.joints)), []
    for tick, setpoint_rad in enumerate(setpoints_rad):
        now_ns = tick * TICK_NS
        robot.advance(now_ns)
        reading, count = robot.read(), watch.count
        watch.look(now_ns, reading, encoders.position_rad(reading.counts))
        foretold = watch.wrote(to_s(TICK_NS), setpoint_rad, setpoint_rad)
        robot.limit_torque(limit.step(to_s(TICK_NS), *foretold, watch.limit_floor_nm))
        robot.write(setpoint_rad)
        if watch.count > count:
            assert watch.finding is not None
            findings.append(watch.finding)
        np.maximum(largest, watch.share, out=largest)
    worst = int(largest.argmax())
    seconds = len(setpoints_rad) * TICK_NS * 1e-9
    return Lap(seconds, tuple(findings), float(largest[worst]), skeleton.joint_names[worst])
