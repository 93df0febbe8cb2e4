"""Servos of several backends as one robot's: each joint is driven by one of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import or_

import numpy as np
from numpy.typing import NDArray

from common.errors import RobotError
from common.metrics.slave import ServoMetrics
from common.quaternion import Array
from slave.servos.servos import EncoderReading, LimitsTorque, Servos, check_setpoint, check_torque_limit
from slave.servos.signs import DriveSigns, TellingServos


@dataclass(frozen=True, slots=True)
class ServoPart:
    """The servos of one backend."""

    name: str
    servos: Servos
    joints: NDArray[np.intp]
    """Which of the robot's joints they drive."""


class MixedServos:
    """Servos (see `slave.servos.Servos`) of several backends. A fault of one is a fault of the robot."""

    def __init__(self, joint_names: Sequence[str], parts: Sequence[ServoPart]) -> None:
        """`parts` in the order of their start; together they drive each joint once."""
        self._names = tuple(joint_names)
        self._parts = tuple(parts)

    def start(self) -> None:
        """Open one backend after the other; where one fails, those before it are let go again.

        Raises RobotError that names the backend.
        """
        started: list[ServoPart] = []
        try:
            for part in self._parts:
                started.append(part)
                part.servos.start()
        except RobotError as error:
            # what runs already is not this call's to stop
            for part in started if len(started) > 1 else []:
                part.servos.stop()
            raise RobotError(f"{started[-1].name}: {error}") from error

    def write(self, position_rad: Array) -> None:
        """Hand each backend its joints' setpoints of (J,). Raises ValueError if not finite or not J."""
        check_setpoint(position_rad, len(self._names))
        for part in self._parts:
            part.servos.write(position_rad[part.joints])

    def limit_torque(self, torque_nm: Array | None) -> None:
        """Hand each backend that can limit torque the ranges of its joints, of (2, J). See `LimitsTorque`."""
        check_torque_limit(torque_nm, len(self._names))
        for part in self._parts:
            if isinstance(part.servos, LimitsTorque):
                part.servos.limit_torque(None if torque_nm is None else torque_nm[:, part.joints])

    @property
    def no_torque_limit(self) -> Mapping[str, str]:
        """See `LimitsTorque`: of backends that cannot, every joint."""
        out: dict[str, str] = {}
        for part in self._parts:
            if isinstance(part.servos, LimitsTorque):
                out |= part.servos.no_torque_limit
            else:
                words = f"tandem cannot limit the torque of {part.name} servos"
                out |= {self._names[joint]: words for joint in part.joints}
        return {name: out[name] for name in self._names if name in out}

    def read(self) -> EncoderReading:
        """The newest reading of each backend; its time is that of the oldest among them."""
        joints = len(self._names)
        counts, valid = np.zeros(joints, np.int64), np.zeros(joints, np.bool_)
        drive_rad, effort_nm = np.full((2, joints), np.nan)
        readings = [part.servos.read() for part in self._parts]
        for part, reading in zip(self._parts, readings, strict=True):
            counts[part.joints], valid[part.joints] = reading.counts, reading.valid
            if reading.drive_rad is not None:
                drive_rad[part.joints] = reading.drive_rad
            if reading.effort_nm is not None:
                effort_nm[part.joints] = reading.effort_nm
        told = [reading.drive_rad is not None for reading in readings]
        efforts = [reading.effort_nm is not None for reading in readings]
        read_ns = min(reading.read_ns for reading in readings)
        return EncoderReading(
            read_ns,
            counts,
            valid,
            drive_rad if any(told) else None,
            effort_nm if any(efforts) else None,
            # one stamp stands for all: that of another backend may be later by what lies between them
            max(reading.read_ns - read_ns + reading.stamp_error_ns for reading in readings),
        )

    def faults(self) -> Mapping[str, str]:
        """Of all backends, by joint."""
        empty: dict[str, str] = {}
        return reduce(or_, (dict(part.servos.faults()) for part in self._parts), empty)

    def quick_stop(self, stop: bool) -> None:
        """Every backend brakes; or every one follows again."""
        for part in self._parts:
            part.servos.quick_stop(stop)

    def signs(self, joint: str) -> DriveSigns:
        """What the drive of a joint tells of its torque and inputs, if it is one that tells any."""
        index = self._names.index(joint)
        (part,) = (part for part in self._parts if index in part.joints)
        assert isinstance(part.servos, TellingServos), "the file was checked"
        return part.servos.signs(joint)

    def metrics(self) -> ServoMetrics:
        """Of all backends; counters and times under `backend.name`."""
        out = ServoMetrics()
        for part in self._parts:
            one = part.servos.metrics()
            out.counters.update({f"{part.name}.{key}": value for key, value in one.counters.items()})
            out.times_ms.update({f"{part.name}.{key}": value for key, value in one.times_ms.items()})
            out.buses.update(one.buses)
            out.no_effort.update(one.no_effort)
            out.left_out.update(one.left_out)
            out.not_driven.update(one.not_driven)
        return out

    def stop(self) -> None:
        """Let go of the drives of every backend, whatever another does. Safe to call twice."""
        failed: list[Exception] = []
        for part in reversed(self._parts):
            try:
                part.servos.stop()
            except Exception as error:
                failed.append(error)
        if failed:
            raise failed[0]
