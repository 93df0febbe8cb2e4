"""The slave's side of its camera: a thread that asks for pictures and puts them on the link.

Never on the loop. Whatever happens to the camera is words in `fault`. The guard holds a robot whose operator
had pictures and gets none any more (`[guard] max_video_age_s`).
"""

from __future__ import annotations

import logging
import threading
from collections import deque
from collections.abc import Callable
from typing import Protocol

from common.clock import NS_PER_MS, Clock, monotonic_ns, to_ns, to_s
from common.clock_sync import Offset
from common.errors import CodecError, RobotError
from common.latency.durations import Durations
from common.metrics.slave import CameraMetrics
from common.quaternion import Array
from common.wire.messages import Command
from common.wire.topics import LOST
from common.wire.video import VideoFrame, encode_frame
from slave.camera.config import CameraConfig
from slave.camera.pipe import PictureReply, PictureRequest, ReplyKind
from slave.camera.process import CameraProcess, NeverError
from slave.camera.rate import RateControl, RateLimits
from slave.camera.sight import SeenPicture, Sight

_FIRST_BACK_OFF_S, _LONGEST_BACK_OFF_S = 0.5, 30.0
_WELL_AFTER = 20
"""Pictures after which a restarted process counts as well."""
_KEY_AGAIN_NS = 300 * NS_PER_MS
"""Requests so soon after a picture that stands alone get no other: they may have been made before it came."""
_IDLE_S = 0.25
_JOIN_S = 1.0
_BUSY_SHARE = 0.5
"""The share of one core that making pictures may take, all cameras together."""
_NUMBERS = 1 << 48
"""From the numbers of one camera to those of the next: 9000 years of milliseconds."""

log = logging.getLogger(__name__)


class CameraSource(Protocol):
    """What the feed asks of a camera's process."""

    def wait_ready(self) -> None:
        """Wait until it can be asked."""
        ...

    def ask(self, request: PictureRequest) -> PictureReply:
        """A picture. Raises RobotError."""
        ...

    def kill(self) -> None:
        """End it now, from any thread."""
        ...

    def close(self) -> None:
        """End it, and wait for that."""
        ...


class CameraFeed:
    """One camera. `look`, `seen_by` and `metrics` are for the loop, and cost it microseconds."""

    def __init__(
        self,
        config: CameraConfig,
        put: Callable[[bytes], None],
        open_camera: Callable[[], CameraSource],
        clock: Clock = monotonic_ns,
        make_rate: Callable[[RateLimits], RateControl] = RateControl,
        wanted: Callable[[], bool] = lambda: True,
        place: tuple[int, int] = (0, 1),
    ) -> None:
        """`put` must be safe in another thread than the loop's, and must not block.

        `wanted`: whether somebody receives the pictures; while nobody does, none is made. `place`: which
        camera it is, from 0, of how many: they share the link and a core.
        """
        index, cameras = place
        self.name = config.name
        self.relied_on = config.relied_on
        self._wanted = wanted
        self.sight = Sight()
        self.fault = ""
        """The camera's fault as text; empty if there is none."""
        self._put = put
        self._open = open_camera
        self._clock = clock
        self._rate = make_rate(
            RateLimits(
                config.most_rate_hz,
                config.least_rate_hz,
                to_ns(config.most_delay_s) // cameras,
                round(1000 * config.most_kb),
                cameras,
            )
        )
        self._angles: tuple[Array, int] | None = None
        self._seen: deque[SeenPicture] = deque(maxlen=64)
        self._wake = threading.Event()
        self._stopping = False
        self._camera: CameraSource | None = None
        # above any number of an earlier run since this host started, which the master may still acknowledge
        # each camera has numbers of its own: a command acknowledges one picture, by its number alone
        self._number = clock() // NS_PER_MS + index * _NUMBERS
        self._busy_share = _BUSY_SHARE / cameras
        self._count = _Count(clock())
        self._codec = config.codec
        self._keyframe_ns = to_ns(config.keyframe_s)
        self._sent_number = 0
        """Of the newest picture."""
        self._alone_ns: int | None = None
        """When the newest picture that stands alone was sent."""
        self._wants_alone = False
        self._lost_before = 0
        self._asked: deque[bytes] = deque(maxlen=16)
        self._make = Durations()
        self._thread = threading.Thread(target=self._run, name="camera", daemon=True)

    def __enter__(self) -> CameraFeed:
        """Let pictures come."""
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """End the thread and the camera's process."""
        self._stopping = True
        camera = self._camera
        if camera is not None:
            camera.kill()
        self._wake.set()
        self._thread.join(_JOIN_S)

    def look(self, position_rad: Array, read_ns: int) -> None:
        """The newest joint angles (J,), and when they were read."""
        self._angles = position_rad, read_ns

    def on_keyframe(self, why: bytes) -> None:
        """Somebody who receives the pictures asks for one that stands alone."""
        if self._codec != "jpeg":
            self._asked.append(why)
            self._wake.set()

    def on_command(self, command: Command, now_ns: int, offset: Offset) -> None:
        """Take an accepted command's acknowledgement of a picture."""
        seen = self.sight.on_command(command, now_ns, offset)
        if seen is not None:
            self._seen.append(seen)
            self._wake.set()

    def metrics(self) -> CameraMetrics:
        """Rates of the last seconds, counters, and percentiles in ms."""
        sizes, over_s = self._count.lately(self._clock())
        return CameraMetrics(
            pictures=self._count.pictures,
            fps=len(sizes) / over_s,
            kb_s=sum(sizes) / over_s / 1000,
            mean_kb=sum(sizes) / len(sizes) / 1000 if sizes else 0.0,
            width=self._count.width,
            sent_kb=self._count.bytes / 1000,
            budget_bytes=self._rate.budget_bytes,
            bitrate_reduced=self._rate.lowered,
            not_acknowledged=self._rate.lost,
            make_ms=self._make.summary(),
            transit_ms=self.sight.transit.summary(),
            action_to_observation_ms=self.sight.observation_age.summary(),
            fault=self.fault,
        )

    def _run(self) -> None:
        back_off_s = _FIRST_BACK_OFF_S
        while not self._stopping:
            taken = self._count.pictures
            try:
                self._camera = self._open()
                if not self._stopping:
                    self._camera.wait_ready()
                    self._serve(self._camera)
            except NeverError as error:
                self._report(str(error))
                return
            except RobotError as error:
                self._report(str(error))
            except Exception as error:  # a thread that dies would say nothing
                log.exception("camera thread failed; restarting it")
                self._report(f"{type(error).__name__}: {error}")
            finally:
                if self._camera is not None:
                    self._camera.close()
            if self._count.pictures - taken > _WELL_AFTER:
                back_off_s = _FIRST_BACK_OFF_S
            self._pause(back_off_s)
            back_off_s = min(2 * back_off_s, _LONGEST_BACK_OFF_S)

    def _serve(self, camera: CameraSource) -> None:
        rest_until_ns = 0
        while not self._stopping:
            self._wake.clear()
            while self._seen:
                seen = self._seen.popleft()
                self._rate.seen(seen.number, seen.known_ns, seen.delay_ns)
            now_ns = self._clock()
            alone = self._must_stand_alone(now_ns)
            due_ns, angles = self._rate.due_ns(now_ns), self._angles
            if due_ns is None or angles is None or not self._wanted():
                self._wake.wait(_IDLE_S)
                continue
            wait_ns = max(due_ns, rest_until_ns) - now_ns
            if wait_ns > 0:
                self._wake.wait(to_s(wait_ns))
                continue
            reply = camera.ask(PictureRequest(angles[1], self._rate.budget_bytes, angles[0], alone))
            made_ns = self._clock()
            rest_until_ns = now_ns + round((made_ns - now_ns) / self._busy_share)
            self._make.record(made_ns - now_ns)
            self._send(reply)
            self.fault = ""

    def _must_stand_alone(self, now_ns: int) -> bool:
        """Whether the next one must: at first, when asked, when one was not acknowledged, now and then."""
        if self._codec == "jpeg":
            return False
        lost = self._rate.lost
        fresh = self._alone_ns is not None and now_ns - self._alone_ns < _KEY_AGAIN_NS
        while self._asked:
            why = self._asked.popleft()
            if fresh:
                continue
            if why == LOST:
                self._rate.lost_on_way(now_ns)
            self._wants_alone = True
        if lost > self._lost_before or self._rate.lost != lost:
            self._wants_alone = True
        self._lost_before = self._rate.lost
        old = self._alone_ns is None or now_ns - self._alone_ns >= self._keyframe_ns
        return self._wants_alone or old

    def _send(self, reply: PictureReply) -> None:
        self._number += 1
        now_ns = self._clock()
        alone = reply.answer is ReplyKind.PICTURE
        after = 0 if alone else self._sent_number
        size = reply.width, reply.height
        frame = VideoFrame(self._number, reply.captured_ns, now_ns, *size, reply.body, self._codec, after)
        try:
            payload = encode_frame(frame)
        except CodecError as error:
            raise RobotError(f"the camera made no picture: {error}") from None
        self._sent_number = self._number
        if alone:
            self._alone_ns, self._wants_alone = now_ns, False
        # before it is put: its acknowledgement may be quicker than this thread
        self.sight.sent(self._number, reply.captured_ns, now_ns)
        self._rate.sent(self._number, len(payload), now_ns)
        self._put(payload)
        self._count.add(len(payload), reply.width, now_ns)

    def _report(self, words: str) -> None:
        if not self._stopping and words != self.fault:
            log.warning("no video of camera %s: %s", self.name, words)
            self.fault = words

    def _pause(self, seconds: float) -> None:
        until_ns = self._clock() + to_ns(seconds)
        while not self._stopping and (left_ns := until_ns - self._clock()) > 0:
            self._wake.clear()
            self._wake.wait(to_s(left_ns))


def open_feed(
    config: CameraConfig,
    profile: str,
    put: Callable[[bytes], None],
    wanted: Callable[[], bool],
    place: tuple[int, int] = (0, 1),
) -> CameraFeed:
    """The feed of one configured camera, not yet started; `place` as of `CameraFeed`."""
    return CameraFeed(config, put, lambda: CameraProcess(profile, config), wanted=wanted, place=place)


class _Count:
    """Pictures and bytes, in all and over the last seconds. Written by one thread, read by another."""

    _OVER_NS = 5_000_000_000

    def __init__(self, now_ns: int) -> None:
        self.pictures = 0
        self.bytes = 0
        self.width = 0
        self._since_ns = now_ns
        self._lately: deque[tuple[int, int]] = deque(maxlen=512)

    def add(self, size: int, width: int, now_ns: int) -> None:
        self.pictures += 1
        self.bytes += size
        self.width = width
        self._lately.append((now_ns, size))

    def lately(self, now_ns: int) -> tuple[list[int], float]:
        """Sizes in bytes of the last seconds' pictures, and over how many seconds."""
        since_ns = max(now_ns - self._OVER_NS, self._since_ns)
        # copied at once: the other thread may add to it meanwhile
        sizes = [size for at_ns, size in self._lately.copy() if at_ns > since_ns]
        return sizes, max(to_s(now_ns - since_ns), 1e-3)
