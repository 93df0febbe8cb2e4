"""What the camera's process does: take a request, make a picture, answer."""

from __future__ import annotations

import os
import queue
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from common.errors import RobotError
from slave.camera.config import CameraConfig
from slave.camera.h264 import NO_PYAV, H264Fitter, open_x264
from slave.camera.jpeg import Fitter, Pixels, decode, size_of
from slave.camera.pipe import REQUEST, PictureReply, PictureRequest, ReplyKind, pack_reply, request_of

if TYPE_CHECKING:
    from slave.camera.drawn import DrawnCamera
    from slave.camera.v4l2 import V4l2Camera

Make = Callable[[PictureRequest], PictureReply]


def main(setting: str) -> None:
    """Serve requests from standard input until it ends. `setting`: profile, then the `[camera]` as JSON."""
    profile, _, config = setting.partition(" ")
    # whatever a driver prints must not get between the pictures
    answers = os.dup(1)
    os.dup2(2, 1)
    requests: queue.SimpleQueue[PictureRequest] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(requests,), name="requests", daemon=True).start()
    checked = CameraConfig.model_validate_json(config)
    try:
        make = open_camera(profile, checked)
    except RobotError as error:
        # a camera may be plugged in again; a machine that cannot draw will not learn to
        never = checked.source == "robot" or str(error).startswith(NO_PYAV)
        answer = ReplyKind.NEVER if never else ReplyKind.TROUBLE
        _write(answers, PictureReply(answer, body=str(error).encode()))
        os._exit(0)  # a half-built OpenGL context makes trouble when it is taken down
    _write(answers, PictureReply(ReplyKind.READY))
    while True:
        request = requests.get()
        try:
            reply = make(request)
        except (RobotError, ValueError) as error:
            reply = PictureReply(ReplyKind.TROUBLE, body=str(error).encode())
        _write(answers, reply)


def open_camera(profile: str, config: CameraConfig) -> Make:
    """What makes pictures. Raises RobotError where this machine cannot."""
    if config.codec == "h264":
        return _open_h264(profile, config)
    fitter = Fitter()
    if config.source == "v4l2":
        real = _open_v4l2(config)
        return lambda request: passed_on(*real.newest(), request.most_bytes, fitter)

    drawn = _open_drawn(profile, config)

    def make(request: PictureRequest) -> PictureReply:
        card_ns = request.read_ns if config.time_card else None
        jpeg, width, height = fitter.fit(drawn.draw(request.position_rad, card_ns), request.most_bytes)
        return PictureReply(ReplyKind.PICTURE, request.read_ns, width, height, jpeg)

    return make


def _open_h264(profile: str, config: CameraConfig) -> Make:
    fitter = H264Fitter(config.most_rate_hz)
    open_x264(config.width, config.height, config.most_rate_hz, 10_000)  # says at once where there is none
    if config.source == "v4l2":
        real = _open_v4l2(config)

        def see(request: PictureRequest) -> tuple[int, Pixels]:
            taken_ns, jpeg = real.newest()
            return taken_ns, decode(jpeg)

    else:
        drawn = _open_drawn(profile, config)

        def see(request: PictureRequest) -> tuple[int, Pixels]:
            card_ns = request.read_ns if config.time_card else None
            return request.read_ns, drawn.draw(request.position_rad, card_ns)

    def make(request: PictureRequest) -> PictureReply:
        taken_ns, pixels = see(request)
        made = fitter.fit(pixels, request.most_bytes, request.alone)
        kind = ReplyKind.PICTURE if made.alone else ReplyKind.NEXT_PICTURE
        return PictureReply(kind, taken_ns, made.width, made.height, made.body)

    return make


def _open_v4l2(config: CameraConfig) -> V4l2Camera:
    if not Path(config.device).exists():
        raise RobotError(f"there is no camera {config.device}")
    from slave.camera.v4l2 import V4l2Camera

    return V4l2Camera(config.device, config.width, config.height)


def _open_drawn(profile: str, config: CameraConfig) -> DrawnCamera:
    from slave.camera.drawn import DrawnCamera

    drawn = DrawnCamera(profile, config.name, config.width, config.height)
    drawn.draw(np.zeros(drawn.joints))  # the first one takes the longest
    return drawn


def passed_on(taken_ns: int, jpeg: bytes, most_bytes: int, fitter: Fitter) -> PictureReply:
    """The camera's own JPEG where it is small enough, else one that is. Raises ValueError on garbage."""
    if len(jpeg) > most_bytes:
        smaller, width, height = fitter.fit(decode(jpeg), most_bytes)
        return PictureReply(ReplyKind.PICTURE, taken_ns, width, height, smaller)
    return PictureReply(ReplyKind.PICTURE, taken_ns, *size_of(jpeg), jpeg)


def _listen(requests: queue.SimpleQueue[PictureRequest]) -> None:
    stdin = sys.stdin.buffer
    while True:
        head = stdin.read(REQUEST.size)
        if len(head) < REQUEST.size:
            os._exit(0)  # the slave has gone, whatever the driver is busy with
        read_ns, most_bytes, length, alone = request_of(head)
        requests.put(PictureRequest(read_ns, most_bytes, np.frombuffer(stdin.read(length), "<f8"), alone))


def _write(answers: int, reply: PictureReply) -> None:
    data = memoryview(pack_reply(reply))
    try:
        while data:
            data = data[os.write(answers, data) :]
    except BrokenPipeError:
        os._exit(0)
