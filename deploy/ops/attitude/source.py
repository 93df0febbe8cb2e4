"""Where readings come from: an instrument at a port, or one that is simulated."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Protocol

import numpy as np

from common.clock import to_s
from deploy.ops.attitude.reading import Reading
from slave.attitude.angles import orientation
from slave.attitude.attitude import Attitude, turned
from slave.attitude.frame import FrameAngles, of_angles, radians
from slave.attitude.instrument import Instrument
from slave.attitude.port import FrameReader, FrameWriter
from slave.attitude.simulated import readings

_SENT_EVERY = 5
"""Steps between two frames: 10 a second of 50."""
Take = Callable[[Reading], None]


class Source(Protocol):
    """Hands over readings between `start` and `stop`."""

    name: str

    def start(self) -> None:
        """Begin. Raises RobotError where a port does not open."""
        ...

    def step(self, tick: int, now_ns: int) -> None:
        """One of 50 steps a second."""
        ...

    def counters(self) -> dict[str, int]:
        """What came, and what could not be used."""
        ...

    def stop(self) -> None:
        """End."""
        ...


class PortSource:
    """Frames of an instrument at a serial port."""

    def __init__(self, port: str, baud: int, declination_rad: float, began_ns: int, take: Take) -> None:
        self.name = port
        self._declination_rad = declination_rad
        self._began_ns = began_ns
        self._take = take
        self._loop = asyncio.get_running_loop()
        self._reader = FrameReader(port, baud, self._on_frame)

    def start(self) -> None:
        """Open the port."""
        self._reader.start()

    def step(self, tick: int, now_ns: int) -> None:
        """Nothing: frames come when they come."""

    def counters(self) -> dict[str, int]:
        """The reader's."""
        return self._reader.counters()

    def stop(self) -> None:
        """Close the port."""
        self._reader.stop()

    def _on_frame(self, frame: FrameAngles, now_ns: int) -> None:
        reading = of_frame(frame, to_s(now_ns - self._began_ns), self._declination_rad)
        self._loop.call_soon_threadsafe(self._take, reading)


class SimulatedSource:
    """Two chips at rest in an attitude, solved here, and sent on as frames where a port is named."""

    name = "simulated ADXL330 and HMC5843"

    def __init__(
        self,
        at_rad: tuple[float, float, float],
        declination_rad: float,
        writer: FrameWriter | None,
        began_ns: int,
        take: Take,
        seed: int,
    ) -> None:
        inclination, azimuth, tool_face = (np.asarray(angle) for angle in at_rad)
        self._q_world_from_instrument = orientation(inclination, azimuth, tool_face)
        self._instrument = Instrument(declination_rad=declination_rad)
        self._writer = writer
        self._began_ns = began_ns
        self._take = take
        self._rng = np.random.default_rng(seed)
        self._sent = 0

    def start(self) -> None:
        """Nothing is to be opened."""

    def step(self, tick: int, now_ns: int) -> None:
        """Measure; every fifth time send a frame. Raises RobotError where the port takes none."""
        acc, mag = readings(self._q_world_from_instrument, self._rng)
        found = self._instrument.update(acc, mag, now_ns)
        if found is None:
            return
        self._take(Reading(to_s(now_ns - self._began_ns), _named(found)))
        if self._writer is not None and tick % _SENT_EVERY == 0:
            angles = of_angles(found.inclination_rad, found.magnetic_azimuth_rad, found.tool_face_rad)
            self._writer.write(angles)
            self._sent += 1

    def counters(self) -> dict[str, int]:
        """Frames sent, where there is a port for them."""
        return {} if self._writer is None else {"frames_sent": self._sent}

    def stop(self) -> None:
        """Let go of the port."""
        if self._writer is not None:
            self._writer.close()


def of_frame(frame: FrameAngles, at_s: float, declination_rad: float) -> Reading:
    """The angles in a frame: three of `ANGLES`, and the true azimuth."""
    azimuth = None if frame.azimuth is None else radians(frame.azimuth)
    return Reading(
        at_s,
        {
            "inclination": radians(frame.inclination),
            "magnetic_azimuth": azimuth,
            "azimuth": None if azimuth is None else turned(azimuth, declination_rad),
            "tool_face": None if frame.tool_face is None else radians(frame.tool_face),
        },
    )


def _named(found: Attitude) -> dict[str, float | None]:
    return {
        "inclination": found.inclination_rad,
        "magnetic_azimuth": found.magnetic_azimuth_rad,
        "azimuth": found.azimuth_rad,
        "gravity_tool_face": found.gravity_tool_face_rad,
        "magnetic_tool_face": found.magnetic_tool_face_rad,
        "tool_face": found.tool_face_rad,
    }
