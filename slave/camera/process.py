"""The camera's process as the slave's thread sees it: started, asked, and killed when it does not answer."""

from __future__ import annotations

import os
import select
import subprocess
import sys
from collections.abc import Sequence

from common.clock import monotonic_ns, to_ns, to_s
from common.errors import CodecError, RobotError
from slave.camera.config import CameraConfig
from slave.camera.pipe import REPLY, PictureReply, PictureRequest, ReplyKind, pack_request, reply_of

START_S = 30.0
ANSWER_S = 3.0
GONE = "the camera's process has ended"


class NeverError(RobotError):
    """A camera that this machine cannot have."""


class CameraProcess:
    """One process. All methods but `kill` are for one thread."""

    def __init__(self, profile: str, config: CameraConfig, command: Sequence[str] | None = None) -> None:
        """Start it; `command` stands in for it in tests. Raises RobotError where it cannot be started."""
        setting = f"{profile} {config.model_dump_json(exclude={'others'})}"
        started = command or (sys.executable, "-m", "slave.camera", setting)
        try:
            self._process = subprocess.Popen(
                started, stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0
            )
        except OSError as error:
            raise RobotError(f"the camera's process cannot be started: {error}") from None
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._stdin, self._stdout = self._process.stdin.fileno(), self._process.stdout.fileno()

    def wait_ready(self) -> None:
        """Wait until it can be asked. Raises NeverError or RobotError."""
        reply = self._receive(START_S)
        if reply.answer is ReplyKind.NEVER:
            raise NeverError(reply.words)
        if reply.answer is not ReplyKind.READY:
            raise RobotError(reply.words or "the camera's process does not begin with READY")

    def ask(self, request: PictureRequest) -> PictureReply:
        """A picture. Raises RobotError where the process fails, ends or does not answer."""
        try:
            os.write(self._stdin, pack_request(request))
        except OSError:
            raise RobotError(GONE) from None
        reply = self._receive(ANSWER_S)
        if reply.answer not in (ReplyKind.PICTURE, ReplyKind.NEXT_PICTURE):
            raise RobotError(reply.words)
        return reply

    def kill(self) -> None:
        """End it now; safe to call twice, and from another thread."""
        self._process.kill()

    def close(self) -> None:
        """Kill it and wait for its end."""
        self.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                pipe.close()

    def _receive(self, timeout_s: float) -> PictureReply:
        deadline_ns = monotonic_ns() + to_ns(timeout_s)
        try:
            reply, length = reply_of(self._read(REPLY.size, deadline_ns))
        except CodecError as error:
            raise RobotError(str(error)) from None
        return PictureReply(
            reply.answer, reply.captured_ns, reply.width, reply.height, self._read(length, deadline_ns)
        )

    def _read(self, count: int, deadline_ns: int) -> bytes:
        parts = []
        while count:
            left_s = to_s(deadline_ns - monotonic_ns())
            if left_s <= 0 or not select.select((self._stdout,), (), (), left_s)[0]:
                raise RobotError("the camera's process does not answer")
            part = os.read(self._stdout, count)
            if not part:
                raise RobotError(GONE)
            parts.append(part)
            count -= len(part)
        return b"".join(parts)
