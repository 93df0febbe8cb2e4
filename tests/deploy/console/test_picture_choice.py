"""A page is sent all pictures of the camera that it shows large, and fewer of those beside it."""

from __future__ import annotations

import asyncio
import json
from dataclasses import replace

import aiohttp
import pytest

from common.clock import monotonic_ns, to_ns
from common.wire.video import H264
from deploy.console.picture_choice import BESIDE_S, MOST, PictureChoice
from tests.deploy.console.robots import ROBOT, frame
from tests.deploy.console.served import NURSE, OpenedPage, served

RATE_HZ = 25


def sent(choice: PictureChoice, camera: str, codec: str = "jpeg", seconds: float = 2.0) -> int:
    """Of the pictures of a camera that makes 25 a second."""
    one = replace(frame(1, 0.0), codec=codec)
    times_ns = (to_ns(10.0 + k / RATE_HZ) for k in range(round(seconds * RATE_HZ)))
    return sum(choice.wants(camera, one, at_ns) for at_ns in times_ns)


def test_a_page_that_never_said_what_it_looks_at_gets_all() -> None:
    assert sent(PictureChoice(), "hand") == 50


def test_the_large_one_comes_in_full_and_those_beside_it_young_enough() -> None:
    choice = PictureChoice()
    choice.at("head")
    assert sent(choice, "head") == 50
    assert sent(choice, "hand") == sent(choice, "room") == 17
    assert BESIDE_S + 1 / RATE_HZ < 0.25, "with the way's delay it must not look old (0.5 s)"
    choice.at("hand")
    assert sent(choice, "hand") == 50


def test_pictures_that_build_on_each_other_come_in_full() -> None:
    choice = PictureChoice()
    choice.at("head")
    assert sent(choice, "hand", H264) == 50


@pytest.mark.parametrize("codec", ["jpeg", H264])
def test_a_page_without_a_picture_gets_none(codec: str) -> None:
    choice = PictureChoice()
    choice.at(None)
    assert sent(choice, "head", codec) == 0


def test_names_without_end_cost_no_memory() -> None:
    choice = PictureChoice()
    choice.at("head")
    one = frame(1, 0.0)
    assert sum(choice.wants(f"camera-{k}", one, to_ns(10.0)) for k in range(1000)) == MOST
    assert sent(choice, "head") == 50


def test_a_page_says_over_its_socket_what_it_looks_at() -> None:
    async def pictures(page: OpenedPage, end: str) -> list[str]:
        """The cameras of those that come, until an answer says what was asked at last."""
        found: list[str] = []
        while True:
            said = await page.socket.receive(timeout=20.0)
            if said.type is aiohttp.WSMsgType.BINARY:
                length = int.from_bytes(said.data[:4], "little")
                header = json.loads(said.data[4 : 4 + length])
                await page.say(kind="ack", n=header["n"])
                found.append(header["camera"])
            else:
                message = json.loads(said.data)
                if message["kind"] == "answer" and message["to"] == end:
                    return found

    async def story() -> None:
        async with served() as console:
            await console.log_in(NURSE)
            hub, model = console.hub, console.models[ROBOT]
            page = await console.page()
            await page.hear("hello")
            number = 0

            async def arrive(*cameras: str) -> list[str]:
                nonlocal number
                for camera in cameras:
                    number += 1
                    assert model.on_picture(camera, frame(number, 0.0), monotonic_ns())
                    hub.on_picture(model, camera)
                await page.say(kind=f"end{number}")
                return await pictures(page, f"end{number}")

            await page.say(kind="look", camera=None)
            assert await arrive() == []
            assert await arrive("head", "hand") == []
            await page.say(kind="look", camera="hand")
            assert await arrive() == []
            assert set(await arrive("hand", "head")) == {"hand", "head"}
            await page.say(kind="look", camera=["hand"])
            assert await arrive() == [], "no camera: nothing changes"

    asyncio.run(asyncio.wait_for(story(), 60.0))
