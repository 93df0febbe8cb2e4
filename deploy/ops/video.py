"""`tandem video`: hear what a robot's camera sends, count it, and keep the pictures. It commands nothing."""

from __future__ import annotations

import asyncio
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.live import Live
from rich.text import Text

from common.clock import monotonic_ns, to_s
from common.errors import LinkTimeoutError, TandemError
from common.link import open_link
from common.process.runtime import run as run_until_stopped
from common.wire.topics import IN_ORDER, JOINED, keyframe
from common.wire.topics import video as video_topic
from common.wire.video import VideoFrame
from deploy.client.certificate import Certificate
from deploy.client.destination import destination
from deploy.recorded.pictures import PictureDecoder, as_jpeg
from master.picture import VideoWatch

NOTHING_S = 5.0


def video(
    connect: Annotated[list[str], typer.Option(help="Endpoint of the robot, such as tcp/192.168.7.2:7447.")],
    robot: Annotated[str, typer.Option(help="Name of the robot.")],
    certificate: Certificate = None,
    camera: Annotated[str, typer.Option(help="Name of the camera, as in the slave's file.")] = "head",
    save: Annotated[
        Path | None, typer.Option(help="Save every picture to this folder as NUMBER.jpg.", file_okay=False)
    ] = None,
    seconds: Annotated[
        float, typer.Option(help="Stop after this many seconds; 0: stop with Ctrl-C.", min=0.0)
    ] = 0.0,
) -> None:
    """Receive a robot's video: show its rate and size, and save the pictures on request.

    While no operator commands the robot, it sends one or two small pictures a second.

    Example: `tandem video --connect tcp/192.168.7.2:7447 --robot robot-1 --save pictures`
    """
    if save is not None:
        save.mkdir(parents=True, exist_ok=True)

    async def watch_video(stop: asyncio.Event) -> None:
        seen = _ReceivedVideo(save)
        async with open_link(destination(connect, [robot], certificate=certificate).link, robot) as link:
            try:
                await link.connected()
            except LinkTimeoutError:
                raise TandemError(
                    f"no robot answers at {', '.join(connect)}: is the slave running?"
                ) from None
            link.subscribe(video_topic(camera), seen.on_payload, in_order=IN_ORDER)
            ask = link.publish(keyframe(camera))
            ask(JOINED)
            with Live(console=Console(), refresh_per_second=4) as live:
                while not stop.is_set() and not (seconds and seen.elapsed_s > seconds):
                    live.update(Text(seen.words()))
                    if seen.watch.asks_for_key(monotonic_ns()):
                        ask(JOINED)
                    with suppress(TimeoutError):
                        await asyncio.wait_for(stop.wait(), 0.25)
                live.update(Text(seen.words()))
        if not seen.watch.received:
            raise TandemError(f"{robot} sent no picture of {camera!r}: `[camera]` in its file, or its log")

    run_until_stopped(watch_video)


class _ReceivedVideo:
    def __init__(self, save: Path | None) -> None:
        self.watch = VideoWatch()
        self._save = save
        self._decoder = PictureDecoder()
        self._bytes = 0
        self._began_ns = monotonic_ns()
        self._kept: VideoFrame | None = None

    @property
    def elapsed_s(self) -> float:
        return to_s(monotonic_ns() - self._began_ns)

    def on_payload(self, payload: bytes, arrived_ns: int) -> None:
        self._bytes += len(payload)
        self.watch.on_payload(payload, arrived_ns)
        frame = self.watch.frame
        if self._save is not None and frame is not None and frame is not self._kept:
            pixels = self._decoder.decode(frame)
            if pixels is not None:
                (self._save / f"{frame.number}.jpg").write_bytes(as_jpeg(frame, pixels))
        self._kept = frame

    def words(self) -> str:
        frame, counted = self.watch.frame, self.watch.metrics()
        if frame is None:
            return "no picture yet"
        rate_hz, kb_s = counted.received / self.elapsed_s, self._bytes / self.elapsed_s / 1000
        size = f"{frame.width}×{frame.height}, {len(frame.body)} bytes of {frame.codec}"
        newest = f"picture {frame.number}: {size}"
        wrong = f"{counted.late} late, {counted.undecodable} broken, {counted.not_shown} not decodable"
        return f"{newest}; {rate_hz:.1f} Hz, {kb_s:.1f} kB/s; {wrong}"
