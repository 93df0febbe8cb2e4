"""The console beside real processes: its stop stops the robot, with the master and without it."""

from __future__ import annotations

import asyncio
import json
import signal
import tempfile
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

import aiohttp
import numpy as np
import pytest

from common.clock import monotonic_ns, to_ns, to_s
from deploy.harness.console import ConsoleChild
from deploy.harness.engage import until_tracking
from deploy.harness.host import HostWatch
from deploy.harness.rig import ROBOT, Rig, open_rig
from deploy.harness.start import start_all
from tests.deploy.console.served import OpenedPage

if TYPE_CHECKING:
    from tests.conftest import OnThisHost

pytestmark = [pytest.mark.live, pytest.mark.timeout(400)]
STANDS_S = 0.5
STILL_RAD = 0.0031
"""Two counts of an encoder."""


class Browser:
    """A page's requests, as a browser sends them."""

    def __init__(self, http: aiohttp.ClientSession, address: str) -> None:
        self.http = http
        parts = urlsplit(address)
        self.url = f"{parts.scheme}://{parts.netloc}"
        self._origin = {"Origin": self.url}

    async def post(self, path: str, body: object) -> Any:
        async with self.http.post(self.url + path, json=body, headers=self._origin) as response:
            return {"status": response.status, **json.loads(await response.text())}

    async def log_in(self, address: str) -> None:
        said = await self.post("/api/login", {"token": address.partition("#token=")[2]})
        assert said["status"] == 200, said

    async def page(self) -> OpenedPage:
        return OpenedPage(await self.http.ws_connect(f"{self.url}/ws", headers=self._origin, max_msg_size=0))


class Hold:
    """A page that holds the deadman: beats as a browser sends them, with what it saw last."""

    def __init__(self, page: OpenedPage) -> None:
        self.page = page
        self.down = False
        self.beat_ns = 0
        """When the newest beat left that said it is held."""
        self._seen = 0
        self._tasks = [asyncio.create_task(self._see()), asyncio.create_task(self._beat())]

    async def _see(self) -> None:
        while True:
            self._seen = (await self.page.hear("view"))["n"]

    async def _beat(self) -> None:
        while True:
            if self.down:
                self.beat_ns = monotonic_ns()
                await self.page.say(kind="held", n=self._seen, down=True)
            await asyncio.sleep(0.05)

    async def end(self) -> None:
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        await self.page.socket.close()


@asynccontextmanager
async def with_console(
    folder: Path, **overrides: list[str]
) -> AsyncIterator[tuple[Rig, ConsoleChild, Browser]]:
    """A rig that is ready, its console, and a browser that has logged in as the operator."""
    socket = folder / "master.sock"
    given = {"master": [f'tap.socket="{socket}"', *overrides.pop("master", [])], **overrides}
    async with open_rig(overrides=given) as rig:
        await start_all(rig)
        console = ConsoleChild(rig)
        await console.start()
        async with aiohttp.ClientSession(cookie_jar=aiohttp.CookieJar(unsafe=True)) as http:
            browser = Browser(http, console.address)
            await browser.log_in(console.operator_address)
            yield rig, console, browser


async def engaged_by_the_page(rig: Rig, browser: Browser) -> None:
    """The page engages; where the robot refuses as things are not settled yet, again."""
    for _ in range(20):
        said = await browser.post("/api/act", {"act": "engage", "robot": ROBOT})
        if said["status"] == 200 and said["done"]:
            break
        await asyncio.sleep(0.5)
    else:
        raise AssertionError(said)
    await rig.until(lambda: rig.observer.guard == "track", 30.0, "track")


def stood_after_s(rig: Rig, asked_ns: int) -> tuple[float, float]:
    """From the asking to the last motion at the encoders, and how far the robot went meanwhile, °."""
    rows = [s for s in rig.observer.states if s.encoder_ns > asked_ns]
    angles = np.array([s.position_rad for s in rows])
    moving = np.abs(angles - angles[-1]).max(axis=1) > STILL_RAD
    at_s = np.array([to_s(s.encoder_ns - asked_ns) for s in rows])
    return float(at_s[moving].max(initial=0.0)), float(np.degrees(np.abs(angles[-1] - angles[0]).max()))


def in_motion(rig: Rig) -> bool:
    """Whether some joint moves at 40°/s or more: it goes some 0.6° while the stop travels."""
    first, last = rig.observer.states[-5], rig.observer.states[-1]
    seconds = to_s(last.encoder_ns - first.encoder_ns)
    return bool(np.abs(last.position_rad - first.position_rad).max() > np.radians(40.0) * seconds)


@pytest.mark.parametrize("master", ["alive", "dead"])
def test_a_stop_from_the_page_stops_the_robot_by_its_encoders(
    master: str, on_this_host: OnThisHost, tmp_path: Path
) -> None:
    async def story(_: HostWatch) -> None:
        folder = tmp_path / str(monotonic_ns())
        folder.mkdir()
        async with with_console(folder) as (rig, console, browser):
            page = await browser.page()
            assert (await page.hear("hello"))["role"] == "operator"
            await engaged_by_the_page(rig, browser)
            view = await page.hear("view")
            while view["situation"] != "follows":
                view = await page.hear("view")
            assert (view["heard"], view["lease"], view["master"]) == ("tap", "ours", True)
            rig.observer.recording = True
            await rig.until(lambda: len(rig.observer.states) > 20 and in_motion(rig), 30.0, "motion")
            if master == "dead":
                await rig.children["master"].kill()
            asked_ns = monotonic_ns()
            await page.say(kind="stop", robot=ROBOT)
            await rig.until(lambda: rig.observer.guard == "estop", 5.0, "e-stop")
            told_s = to_s(monotonic_ns() - asked_ns)
            until_ns = asked_ns + to_ns(1.5)
            await rig.until(lambda: rig.observer.sent_ns > until_ns, 5.0, "a second and a half of states")
            stood_s, way_deg = stood_after_s(rig, asked_ns)
            print(f"\nmaster {master}: stop asked → e-stop {1e3 * told_s:.0f} ms, "  # noqa: T201
                  f"last motion {1e3 * stood_s:.0f} ms, way {way_deg:.1f}°")  # fmt: skip
            assert way_deg > 0.3, "the robot was not in motion: nothing is shown"
            assert stood_s <= STANDS_S
            stop = (await page.hear("view"))["stop"]
            while stop is None or stop["stands_s"] is None:
                view = await page.hear("view")
                stop = view["stop"]
            print(f"on the page: robot {stop['robot_s']} s, stands {stop['stands_s']} s")  # noqa: T201
            assert 0 < stop["robot_s"] <= stop["stands_s"] < 3.0
            if master == "dead":
                assert (view["heard"], view["situation"], view["master"]) == ("link", "stopped", False)
            console.child.check()

    on_this_host(story)


@pytest.mark.parametrize("how", ["lets go", "console stands still"])
def test_a_page_that_holds_the_deadman_ends_it_by_letting_go_and_by_silence(
    how: str, on_this_host: OnThisHost
) -> None:
    async def story(_: HostWatch) -> None:
        # a short path: a socket's has at most 107 bytes
        folder = Path(tempfile.mkdtemp(prefix="tandem-"))
        held = f'operator.deadman={{source="console",socket="{folder / "deadman.sock"}"}}'
        given = {"master": [f'tap.socket="{folder / "master.sock"}"', held]}
        async with (
            open_rig(overrides=given) as rig,
            aiohttp.ClientSession(cookie_jar=aiohttp.CookieJar(unsafe=True)) as http,
        ):
            console, holds = ConsoleChild(rig), list[Hold]()

            async def start(name: str) -> None:
                await rig.start(name)
                if name != "master":
                    return
                await console.start()
                browser = Browser(http, console.address)
                await browser.log_in(console.operator_address)
                holds.append(Hold(await browser.page()))
                await rig.until(lambda: rig.observer.command is not None, 30.0, "command")
                assert rig.observer.command is not None
                assert not rig.observer.command.deadman_held
                holds[0].down = True

            await start_all(rig, start=start)
            (hold,) = holds
            await engaged_by_the_page(rig, Browser(http, console.address))
            before = len(rig.observer.guard_changes)
            rig.observer.recording = True
            if how == "lets go":
                hold.down = False
                released_ns = monotonic_ns()
                await hold.page.say(kind="held", down=False)
            else:
                console.child.send(signal.SIGSTOP)
                released_ns = hold.beat_ns
            await rig.until(lambda: rig.observer.guard == "hold", 5.0, "hold")
            change = rig.observer.guard_changes[before]
            told_s = to_s(change.at_ns - released_ns)
            print(f"\n{how}: released → hold in the robot's state {1e3 * told_s:.0f} ms")  # noqa: T201
            console.child.send(signal.SIGCONT)
            await hold.end()
            assert "deadman" in change.reason
            # the newest beats may have waited in the console that was stopped
            assert 0.0 < told_s <= (0.1 if how == "lets go" else 0.45)

    on_this_host(story)


def test_a_console_beside_the_robot_shows_and_stops_it(on_this_host: OnThisHost) -> None:
    async def story(_: HostWatch) -> None:
        folder = Path(tempfile.mkdtemp(prefix="tandem-"))
        async with (
            open_rig(overrides={"slave": [f'tap.socket="{folder / "slave.sock"}"']}) as rig,
            aiohttp.ClientSession(cookie_jar=aiohttp.CookieJar(unsafe=True)) as http,
        ):
            await start_all(rig)
            console = ConsoleChild(rig, side="slave")
            await console.start()
            page = await Browser(http, console.address).page()
            await until_tracking(rig, ROBOT)
            view = await page.hear("view")
            while view["situation"] != "follows" or view["latency"]["ms"] is None:
                view = await page.hear("view")
            assert (view["heard"], view["operator"], view["master"]) == ("tap", "nurse-1", True)
            await page.say(kind="stop")
            await rig.until(lambda: rig.observer.guard == "estop", 5.0, "e-stop")
            while view["situation"] != "stopped":
                view = await page.hear("view")
            await page.socket.close()

    on_this_host(story)
