"""H.264 as JPEG, for pages whose browser has no decoder: newest picture only, and only while one looks.

Every picture is decoded, as each builds on the one before; the newest alone is encoded. A thread does both.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib.util import find_spec
from typing import Protocol

from common.errors import TandemError
from common.wire.video import JPEG, FrameChain, VideoFrame
from deploy.recorded.pictures import PictureDecoder, as_jpeg

MOST_WAITING = 25
"""Pictures of one camera that may wait for the thread: a second of them. Beyond it, all are dropped."""
QUALITY = 75
NO_PYAV = "this console cannot make JPEG of H.264: pip install 'tandem[h264]' on its host"

log = logging.getLogger(__name__)


class JpegMaker(Protocol):
    """One stream of H.264. Used by one thread at a time."""

    def jpeg(self, frames: Sequence[VideoFrame]) -> bytes | None:
        """The last of these pictures as JPEG; None where it cannot be decoded."""


class DecodedJpeg:
    """By PyAV."""

    def __init__(self) -> None:
        """Raises TandemError without PyAV."""
        if find_spec("av") is None:
            raise TandemError(NO_PYAV)
        self._pictures = PictureDecoder()

    def jpeg(self, frames: Sequence[VideoFrame]) -> bytes | None:
        """The last of these pictures as JPEG; None where it cannot be decoded."""
        newest = None
        for frame in frames:
            newest = self._pictures.decode(frame)
        return None if newest is None else as_jpeg(frames[-1], newest, QUALITY)


class JpegStream:
    """One camera."""

    def __init__(
        self, decoder: JpegMaker, show: Callable[[VideoFrame], None], ask_for_key: Callable[[], None]
    ) -> None:
        """`show` takes each JPEG; `ask_for_key` is called where only a picture that stands alone helps."""
        self._decoder = decoder
        self._show = show
        self._ask_for_key = ask_for_key
        self._chain = FrameChain()
        self._waiting: list[VideoFrame] = []
        self._working: asyncio.Task[None] | None = None
        self.encoded = 0

    def offer(self, frame: VideoFrame) -> None:
        """A picture came."""
        if frame.after == 0:
            self._waiting.clear()
        elif len(self._waiting) >= MOST_WAITING:
            self._waiting.clear()
            self._chain.lose()
        if not self._chain.take(frame):
            self._ask_for_key()
            return
        self._waiting.append(frame)
        if self._working is None or self._working.done():
            self._working = asyncio.create_task(self._work())

    async def _work(self) -> None:
        while self._waiting:
            frames, self._waiting = self._waiting, []
            body = await asyncio.to_thread(self._decoder.jpeg, frames)
            if body is None:
                self._waiting.clear()
                self._chain.lose()
                self._ask_for_key()
            else:
                self.encoded += 1
                self._show(replace(frames[-1], body=body, codec=JPEG, after=0))


class JpegStreams:
    """Streams by robot and camera; each lives as long as a page wants it."""

    def __init__(self, open_decoder: Callable[[], JpegMaker] = DecodedJpeg) -> None:
        self._open_decoder = open_decoder
        self._streams: dict[tuple[str, str], JpegStream] = {}
        self._why_not: str | None = None

    def why_not(self) -> str:
        """Why this console cannot; empty where it can."""
        if self._why_not is None:
            try:
                self._open_decoder()
                self._why_not = ""
            except TandemError as error:
                self._why_not = str(error)
                log.warning("%s", error)
        return self._why_not

    def offer(
        self,
        key: tuple[str, str],
        frame: VideoFrame,
        show: Callable[[VideoFrame], None],
        ask_for_key: Callable[[], None],
    ) -> None:
        """A picture that some page wants as JPEG. Raises TandemError where `why_not` says why."""
        if key not in self._streams:
            self._streams[key] = JpegStream(self._open_decoder(), show, ask_for_key)
        self._streams[key].offer(frame)

    def drop(self, key: tuple[str, str]) -> None:
        """No page wants it any more."""
        self._streams.pop(key, None)

    def __len__(self) -> int:
        return len(self._streams)
