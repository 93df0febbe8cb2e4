"""The newest picture of each of a robot's cameras, and how old it is. Pure."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from common.clock import NS_PER_S, to_s
from common.clock_sync import Offset
from common.wire.video import VideoFrame
from deploy.console.model.values import ms

STALE_S = 0.5
_SILENT_NS = 2 * NS_PER_S
"""After so long any number is believed again: the robot may have started anew."""


@dataclass(frozen=True, slots=True)
class CameraPicture:
    """A picture as it came."""

    frame: VideoFrame
    arrived_ns: int


class CameraFeeds:
    """What came from each camera. Ages are by the clock offset of the robot's newest state."""

    def __init__(self) -> None:
        self.newest: dict[str, CameraPicture] = {}
        self._arrivals: dict[str, deque[int]] = {}
        self._captured: dict[str, deque[tuple[int, int]]] = {}
        """Number and capture of the last pictures."""

    def add(self, camera: str, frame: VideoFrame, arrived_ns: int) -> bool:
        """Take a picture; False where one that is as new or newer is here already."""
        last = self.newest.get(camera)
        if last and frame.number <= last.frame.number and arrived_ns - last.arrived_ns <= _SILENT_NS:
            return False
        self.newest[camera] = CameraPicture(frame, arrived_ns)
        self._arrivals.setdefault(camera, deque(maxlen=128)).append(arrived_ns)
        self._captured.setdefault(camera, deque(maxlen=128)).append((frame.number, frame.captured_ns))
        return True

    def captured_ns(self, camera: str, number: int) -> int | None:
        """When a picture was taken, as its stamp says, robot's clock; None where it is not known any more."""
        return dict(self._captured.get(camera, ())).get(number)

    def shown(self, offset: Offset | None, now_ns: int) -> dict[str, dict[str, object]]:
        """Age and rate of each camera, by name. A picture whose age is not known is judged by its arrival."""
        out: dict[str, dict[str, object]] = {}
        for camera, picture in self.newest.items():
            age_ns = _age_ns(picture.frame, offset, now_ns)
            since_ns = now_ns - picture.arrived_ns
            recent = [at for at in self._arrivals[camera] if now_ns - at <= 2 * NS_PER_S]
            out[camera] = {
                "age_ms": ms(age_ns, 1),
                "bound_ms": ms(None if age_ns is None or offset is None else offset.bound_ns, 1),
                "fps": round(len(recent) / 2.0, 1),
                "stale": to_s(since_ns if age_ns is None else age_ns) > STALE_S,
            }
        return out


def picture_header(camera: str, frame: VideoFrame, offset: Offset | None, now_ns: int) -> dict[str, object]:
    """What the page is told with a picture. `offset`: this host's clock minus the robot's."""
    age_ns = _age_ns(frame, offset, now_ns)
    return {
        "camera": camera,
        "number": frame.number,
        "codec": frame.codec,
        "after": frame.after,
        "age_ms": ms(age_ns, 1),
        "bound_ms": ms(None if age_ns is None or offset is None else offset.bound_ns, 1),
        "width": frame.width,
        "height": frame.height,
    }


def _age_ns(frame: VideoFrame, offset: Offset | None, now_ns: int) -> int | None:
    if offset is None or not offset.trusted:
        return None
    return now_ns - offset.remote_ns(frame.captured_ns)
