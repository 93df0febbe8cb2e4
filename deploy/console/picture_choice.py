"""Which pictures a page needs: all of the camera that it shows large, fewer of those beside it. Pure."""

from __future__ import annotations

from common.clock import to_ns
from common.wire.video import JPEG, VideoFrame

BESIDE_S = 0.12
"""Between two pictures of a camera that is shown small: 6 to 8 a second, too young to be marked as old."""
MOST = 8
"""Cameras whose pictures are thinned out; of any further one nothing is sent but while it is shown large."""


class PictureChoice:
    """What one page looks at. One that never said gets all."""

    def __init__(self) -> None:
        self._said = False
        self._large: str | None = None
        self._sent_ns: dict[str, int] = {}

    def at(self, camera: str | None) -> None:
        """The page shows this camera large; None: it shows no picture."""
        self._said, self._large = True, camera
        self._sent_ns.clear()

    def wants(self, camera: str, frame: VideoFrame, now_ns: int) -> bool:
        """Whether to send a picture that came now. One that others build on is sent wherever any is."""
        if not self._said or camera == self._large:
            return True
        if self._large is None:
            return False
        if frame.codec != JPEG:
            return True
        last_ns = self._sent_ns.get(camera)
        if last_ns is None and len(self._sent_ns) >= MOST:
            return False
        if last_ns is not None and now_ns - last_ns < to_ns(BESIDE_S):
            return False
        self._sent_ns[camera] = now_ns
        return True
