"""A camera of metal through Video4Linux. For the camera's process.

Its JPEGs (MJPG) are passed on as they are for as long as they are small enough.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from common.clock import of_driver_ns, to_ns
from common.errors import RobotError

WAIT_S = 1.0


class V4l2Camera:
    """Keeps the newest picture of a device. `open_capture` stands in for linuxpy in tests."""

    def __init__(
        self,
        device: str,
        width: int,
        height: int,
        open_capture: Callable[[str], Any] | None = None,
        of_driver: Callable[[int], int] = of_driver_ns,
    ) -> None:
        """Raises RobotError where there is no such camera, or it gives no MJPG.

        `of_driver`: from the driver's clock to the slave's, ns.
        """
        self._of_driver = of_driver
        try:
            self._capture = (open_capture or _open_capture)(device)
            self._capture.set_format(width, height, "MJPG")
            self._capture.open()
        except ImportError:
            raise RobotError("a V4L2 camera needs linuxpy: pip install 'tandem[v4l2]'") from None
        except Exception as error:  # OSError and what linuxpy makes of it
            raise RobotError(f"{device} gives no MJPG pictures: {error}") from None
        self._fresh = threading.Condition()
        self._newest: tuple[int, bytes] | None = None
        self._ended: str | None = None
        threading.Thread(target=self._read, name="v4l2", daemon=True).start()

    def newest(self) -> tuple[int, bytes]:
        """When it was taken, ns of the slave's clock, and the JPEG; each once.

        Raises RobotError where none comes.
        """
        with self._fresh:
            if not self._fresh.wait_for(lambda: self._newest or self._ended, WAIT_S):
                raise RobotError(f"the camera gave no picture for {WAIT_S:g} s")
            newest, self._newest = self._newest, None
        if newest is None:
            raise RobotError(f"the camera has failed: {self._ended}")
        return newest

    def _read(self) -> None:
        why = "it ended"
        try:
            for frame in self._capture:
                # drivers stamp by CLOCK_MONOTONIC, and the guard holds a robot whose pictures are old
                taken = self._of_driver(to_ns(frame.timestamp)), bytes(frame.data)
                with self._fresh:
                    self._newest = taken
                    self._fresh.notify()
        except Exception as error:
            why = str(error)
        with self._fresh:
            self._ended = why
            self._fresh.notify()


def _open_capture(path: str) -> Any:
    from linuxpy.video.device import Device, VideoCapture

    device = Device(path)
    device.open()
    return VideoCapture(device)
