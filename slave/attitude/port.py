"""An instrument at a serial port (pyserial): a thread that reads its frames, and one that sends them.

A port that fails, or is unplugged, is opened again once a second; until then nothing new is read, and the
age of the last attitude says so.
"""

from __future__ import annotations

import logging
import math
import threading
from collections.abc import Callable

import serial

from common.clock import Clock, monotonic_ns
from common.errors import RobotError
from common.log.throttle import LogThrottle
from common.wire.messages import BaseAttitude
from slave.attitude.attitude import turned
from slave.attitude.base import base_attitude, less
from slave.attitude.config import BaseConfig
from slave.attitude.frame import FrameAngles, FrameParser, encode, radians
from slave.attitude.vote import Vote

log = logging.getLogger(__name__)

_AGAIN_S = 1.0
_WAIT_S = 0.1
"""A read or write waits for so long: the longest that `stop` has to."""
_JOIN_S = 2.0


def open_port(port: str, baud: int) -> serial.Serial:
    """A port whose reads and writes wait at most 0.1 s. Raises RobotError."""
    try:
        opened = serial.serial_for_url(
            port, baudrate=baud, timeout=_WAIT_S, write_timeout=_WAIT_S, do_not_open=False
        )
    except (OSError, ValueError, serial.SerialException) as error:
        raise RobotError(
            f"the attitude instrument's port {port} does not open ({error}): check the cable, the name and "
            'your permission; `--simulate` and [base] source = "simulated" need no port'
        ) from None
    return opened


class FrameReader:
    """Hands every frame of a port to `on_frame`, with when it was complete, ns; in a thread of its own."""

    def __init__(
        self, port: str, baud: int, on_frame: Callable[[FrameAngles, int], None], clock: Clock = monotonic_ns
    ) -> None:
        self._where = (port, baud)
        self._on_frame = on_frame
        self._clock = clock
        self._parser = FrameParser()
        self._failures = 0
        self._throttle = LogThrottle()
        self._ending = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Open the port and read. Raises RobotError where it does not open now."""
        if self._thread is not None:
            raise RobotError(f"{self._where[0]} is already being read")
        port = open_port(*self._where)
        self._ending.clear()
        self._thread = threading.Thread(target=self._run, args=(port,), name="attitude", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End the thread and close the port. Safe to call twice."""
        self._ending.set()
        if self._thread is not None:
            self._thread.join(_JOIN_S)
            self._thread = None

    def counters(self) -> dict[str, int]:
        """Frames, refused frames, bytes outside of any, and how often the port failed."""
        parser = self._parser
        return {
            "frames": parser.frames,
            "refused": parser.refused,
            "garbage_bytes": parser.garbage,
            "port_failures": self._failures,
        }

    def _run(self, first: serial.Serial) -> None:
        port: serial.Serial | None = first
        while not self._ending.is_set():
            try:
                if port is None:
                    port = open_port(*self._where)
                    log.info("%s: attitude port open again", self._where[0])
                self._read(port)
            # TypeError: pyserial's own where the port is closed under a read
            except (OSError, TypeError, serial.SerialException, RobotError) as error:
                self._failures += 1
                if self._throttle.passes(self._clock()):
                    log.warning("%s: %s", self._where[0], error)
                if port is not None:
                    port.close()
                    port = None
                self._ending.wait(_AGAIN_S)
        if port is not None:
            port.close()

    def _read(self, port: serial.Serial) -> None:
        data = port.read(max(1, port.in_waiting))
        now_ns = self._clock()
        for angles in self._parser.feed(data):
            self._on_frame(angles, now_ns)


class SerialBase:
    """A `BaseSensor` that reads an instrument at a serial port."""

    def __init__(self, config: BaseConfig, clock: Clock = monotonic_ns) -> None:
        self._config = config
        self._attitude: BaseAttitude | None = None
        self._unclear = 0
        self._vote = Vote(math.radians(config.most_deg_s))
        self._reader = FrameReader(config.port, config.baud, self._on_frame, clock)

    def start(self) -> None:
        """Open the port. Raises RobotError."""
        self._reader.start()

    def read(self) -> BaseAttitude | None:
        """The attitude on which the newest frames agree: see `vote.py`."""
        return self._attitude

    def counters(self) -> dict[str, int]:
        """The reader's, frames without a tilt, and frames that contradict their neighbours."""
        return {**self._reader.counters(), "unclear": self._unclear, "outvoted": self._vote.outvoted}

    def stop(self) -> None:
        """Close the port."""
        self._reader.stop()

    def _on_frame(self, angles: FrameAngles, now_ns: int) -> None:
        trusted = self._vote.hear(angles, now_ns)
        if trusted is None:
            return
        attitude = of_frame(trusted.angles, trusted.came_ns, self._config)
        if attitude is None:
            self._unclear += 1
        else:
            self._attitude = attitude


def of_frame(angles: FrameAngles, now_ns: int, config: BaseConfig) -> BaseAttitude | None:
    """The base's attitude by one frame, from true north; None where the frame does not give the tilt."""
    azimuth = None if angles.azimuth is None else radians(angles.azimuth)
    tool_face = None if angles.tool_face is None else radians(angles.tool_face)
    return base_attitude(
        now_ns,
        radians(angles.inclination),
        None if azimuth is None else turned(azimuth, math.radians(config.declination_deg)),
        less(tool_face, math.radians(config.level_tool_face_deg)),
        config.axis,
    )


class FrameWriter:
    """Sends frames to a port, as an instrument does."""

    def __init__(self, port: str, baud: int) -> None:
        self._name = port
        self._port = open_port(port, baud)

    def write(self, angles: FrameAngles) -> None:
        """Send one frame; waits at most 0.1 s. Raises RobotError where the port does not take it."""
        try:
            self._port.write(encode(angles))
        except (OSError, serial.SerialException) as error:
            raise RobotError(f"{self._name} accepts no frame ({error}): does a program read it?") from None

    def close(self) -> None:
        """Let go of the port."""
        self._port.close()
