"""H.264 as JPEG: the newest alone, never one whose predecessor is missing, only while a page looks."""

from __future__ import annotations

import asyncio
import json
import threading
from collections.abc import Awaitable, Callable, Sequence
from typing import Any

import aiohttp
import numpy as np
import pytest
import simplejpeg

from common.wire.video import H264, JPEG, VideoFrame
from deploy.console.transcode import MOST_WAITING, DecodedJpeg, JpegStream, JpegStreams
from slave.camera.h264 import H264Fitter
from tests.deploy.console.robots import ROBOT
from tests.deploy.console.served import NURSE, OpenedPage, Served, served

BODY = b"\0\0\0\1"


def picture(number: int, after: int, body: bytes = BODY) -> VideoFrame:
    return VideoFrame(number, number, number, 64, 48, body, H264, after)


class HeldDecoder:
    """Decodes once a test lets it."""

    def __init__(self) -> None:
        self.goes_on = threading.Event()
        self.heard: list[list[int]] = []
        self.fails = False

    def jpeg(self, frames: Sequence[VideoFrame]) -> bytes | None:
        self.heard.append([frame.number for frame in frames])
        assert self.goes_on.wait(30.0)
        return None if self.fails else b"\xff\xd8jpeg\xff\xd9"


class Heard:
    def __init__(self) -> None:
        self.shown: list[VideoFrame] = []
        self.asked = 0
        self.decoder = HeldDecoder()
        self.stream = JpegStream(self.decoder, self.shown.append, self.ask)

    def ask(self) -> None:
        self.asked += 1

    async def rest(self) -> None:
        assert self.stream._working is not None
        await asyncio.wait_for(self.stream._working, 30.0)


def run(story: Callable[[Heard], Awaitable[None]]) -> None:
    async def told() -> None:
        await story(Heard())

    asyncio.run(told())


def test_all_are_decoded_in_order_and_the_newest_alone_is_shown() -> None:
    async def story(heard: Heard) -> None:
        heard.stream.offer(picture(1, 0))
        await asyncio.sleep(0)
        for number in range(2, 6):
            heard.stream.offer(picture(number, number - 1))
        heard.decoder.goes_on.set()
        await heard.rest()
        assert heard.decoder.heard == [[1], [2, 3, 4, 5]]
        assert [frame.number for frame in heard.shown] == [1, 5]
        assert {(frame.codec, frame.after) for frame in heard.shown} == {(JPEG, 0)}
        assert heard.asked == 0

    run(story)


def test_after_a_loss_nothing_is_decoded_until_a_picture_that_stands_alone() -> None:
    async def story(heard: Heard) -> None:
        heard.decoder.goes_on.set()
        for number, after in ((1, 0), (3, 2), (4, 3)):
            heard.stream.offer(picture(number, after))
        await heard.rest()
        assert heard.asked == 2
        heard.stream.offer(picture(5, 0))
        await heard.rest()
        assert [frame.number for frame in heard.shown] == [1, 5]

    run(story)


def test_a_thread_that_falls_behind_begins_anew_and_one_that_fails_asks_for_a_whole_picture() -> None:
    async def story(heard: Heard) -> None:
        heard.stream.offer(picture(1, 0))
        await asyncio.sleep(0)
        for number in range(2, MOST_WAITING + 3):
            heard.stream.offer(picture(number, number - 1))
        assert heard.asked == 1
        heard.decoder.fails = True
        heard.decoder.goes_on.set()
        await heard.rest()
        assert heard.decoder.heard == [[1]]
        assert heard.asked == 2
        assert heard.shown == []

    run(story)


def test_without_pyav_the_page_is_told() -> None:
    def none() -> Any:
        from common.errors import TandemError

        raise TandemError("pip install 'tandem[h264]'")

    async def story(console: Served) -> None:
        console.hub.jpeg = JpegStreams(none)
        page = await console.page()
        await page.say(kind="jpeg")
        said = await page.hear("answer")
        assert (said["to"], said["done"]) == ("jpeg", False)
        assert "tandem[h264]" in said["text"]
        assert not console.hub.pages[0].wants_jpeg

    async def told() -> None:
        async with served() as console:
            await story(console)

    asyncio.run(told())


def encoded(count: int) -> list[VideoFrame]:
    """A bar that moves, as the slave encodes it."""
    fitter = H264Fitter(12.0)
    frames = []
    for number in range(1, count + 1):
        pixels = np.full((96, 128, 3), 60, np.uint8)
        pixels[:, 10 * number : 10 * number + 20] = (230, 40, 40)
        made = fitter.fit(pixels, 20_000, number == 1)
        after = 0 if made.alone else number - 1
        frames.append(VideoFrame(number, number, number, made.width, made.height, made.body, H264, after))
    return frames


def test_the_picture_is_the_one_that_went_in() -> None:
    pytest.importorskip("av", reason="the extra `h264` is not installed")
    frames = encoded(5)
    body = DecodedJpeg().jpeg(frames)
    assert body is not None
    shown = simplejpeg.decode_jpeg(body)
    assert shown.shape == (96, 128, 3)
    np.testing.assert_allclose(shown[48, 60], (230, 40, 40), atol=25)
    np.testing.assert_allclose(shown[48, 20], (60, 60, 60), atol=12)


async def codec(page: OpenedPage) -> str:
    """Of the next picture."""
    while True:
        said = await page.socket.receive(timeout=20.0)
        if said.type is aiohttp.WSMsgType.BINARY:
            length = int.from_bytes(said.data[:4], "little")
            return str(json.loads(said.data[4 : 4 + length])["codec"])
        assert said.type is aiohttp.WSMsgType.TEXT


def test_a_page_that_asks_gets_jpeg_the_others_h264_and_without_it_nothing_is_decoded() -> None:
    pytest.importorskip("av", reason="the extra `h264` is not installed")
    frames = encoded(8)

    async def story(console: Served) -> None:
        await console.log_in(NURSE)
        hub, model = console.hub, console.models[ROBOT]

        def arrive(frame: VideoFrame) -> None:
            assert model.on_picture("head", frame, frame.captured_ns)
            hub.on_picture(model, "head")

        plain, asks = await console.page(), await console.page()
        await asks.hear("hello")
        arrive(frames[0])
        assert (await codec(asks)) == H264
        assert len(hub.jpeg) == 0
        await asks.say(kind="jpeg")
        while not any(page.wants_jpeg for page in hub.pages):  # noqa: ASYNC110 - the server's own loop
            await asyncio.sleep(0)
        arrive(frames[1])  # builds on one that the new stream has not seen
        arrive(VideoFrame(3, 3, 3, 128, 96, frames[0].body, H264, 0))
        assert (await codec(asks)) == JPEG
        assert (await codec(plain)) == H264
        assert len(hub.jpeg) == 1
        await asks.socket.close()
        while len(hub.pages) > 1:  # noqa: ASYNC110
            await asyncio.sleep(0)
        arrive(VideoFrame(4, 4, 4, 128, 96, frames[0].body, H264, 0))
        assert len(hub.jpeg) == 0

    async def told() -> None:
        async with served() as console:
            await story(console)

    asyncio.run(told())
