"""A console that is served on this host without a link, for tests."""

from __future__ import annotations

import json
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import aiohttp
from aiohttp import web
from aiohttp.test_utils import unused_port

from common.clock import monotonic_ns
from common.link.config import LinkConfig
from deploy.client.destination import Destination
from deploy.console.app import ConsoleApp
from deploy.console.deadman import DeadmanRelay
from deploy.console.hub import Hub
from deploy.console.model.robot import RobotModel
from deploy.console.model.scene import scene
from deploy.console.model.stopped import StopShown
from deploy.console.session import Access, PageRole, Person
from tests.deploy.console.robots import OPERATOR, ROBOT, SKELETON, model

NURSE = Person(PageRole.OPERATOR, OPERATOR)


class HeardStops:
    """Stands for the stops of a robot."""

    def __init__(self, of: RobotModel) -> None:
        self.model = of
        self.by: list[str] = []
        self.kept = True
        """Whether a stop outlives the console."""

    def stop(self, by: str) -> StopShown:
        self.by.append(by)
        shown = self.model.asked_to_stop(len(self.by), by, monotonic_ns())
        shown.kept = self.kept
        return shown


def cookie_jar() -> aiohttp.CookieJar:
    """Of a browser; a cookie of an address is taken only by a jar that is told so."""
    return aiohttp.CookieJar(unsafe=True)


class Served:
    """The console, and a client of it."""

    def __init__(self, port: int, stranger: PageRole) -> None:
        self.host = f"127.0.0.1:{port}"
        self.url = f"http://{self.host}"
        self.models = {ROBOT: model(), "robot-2": model(robot="robot-2")}
        self.stops = {robot: HeardStops(each) for robot, each in self.models.items()}
        self.access = Access([self.host], secure=False, stranger=stranger)
        stoppers: Any = self.stops
        self.hub = Hub(self.models, self.access, stoppers)
        where = Destination(LinkConfig(connect=["tcp/127.0.0.1:1"]), tuple(self.models), OPERATOR)
        self.app = ConsoleApp(self.hub, where, None, lambda _: scene(SKELETON), port=port)
        self.http: aiohttp.ClientSession

    def relay(self, relay: DeadmanRelay) -> None:
        self.hub.deadman = relay

    @property
    def origin(self) -> dict[str, str]:
        return {"Origin": self.url}

    async def post(self, path: str, body: object, **headers: str) -> tuple[int, Any]:
        """Status and JSON."""
        sent = {**self.origin, "Content-Type": "application/json", **headers}
        async with self.http.post(self.url + path, data=json.dumps(body), headers=sent) as response:
            return response.status, json.loads(await response.text())

    async def log_in(self, person: Person = NURSE) -> None:
        token = self.access.issue(person, monotonic_ns())
        status, said = await self.post("/api/login", {"token": token})
        assert status == 200, said

    async def page(self, robot: str = ROBOT, **headers: str) -> OpenedPage:
        socket = await self.http.ws_connect(
            f"{self.url}/ws?robot={robot}", headers={**self.origin, **headers}, max_msg_size=0
        )
        return OpenedPage(socket)


class OpenedPage:
    """A browser's end."""

    def __init__(self, socket: aiohttp.ClientWebSocketResponse) -> None:
        self.socket = socket
        self.acknowledges = True

    async def say(self, **message: object) -> None:
        await self.socket.send_str(json.dumps(message))

    async def hear(self, kind: str) -> dict[str, Any]:
        """The next message of a kind; others are passed over."""
        while True:
            said = await self.socket.receive(timeout=5.0)
            if said.type is aiohttp.WSMsgType.TEXT:
                message: dict[str, Any] = json.loads(said.data)
                if self.acknowledges and "n" in message:
                    await self.say(kind="ack", n=message["n"])
                if message["kind"] == kind:
                    return message
            elif said.type is not aiohttp.WSMsgType.BINARY:
                raise AssertionError(f"{said.type} in place of {kind}")

    async def closed(self) -> int | None:
        """Why it was closed."""
        while not self.socket.closed:
            await self.socket.receive(timeout=5.0)
        return self.socket.close_code


@asynccontextmanager
async def served(
    stranger: PageRole = PageRole.VIEWER, jar: aiohttp.CookieJar | None = None
) -> AsyncIterator[Served]:
    port = unused_port()
    console = Served(port, stranger)
    runner = web.AppRunner(console.app.make(), shutdown_timeout=0.5)
    await runner.setup()
    await web.TCPSite(runner, "127.0.0.1", port).start()
    async with aiohttp.ClientSession(cookie_jar=cookie_jar() if jar is None else jar) as http:
        console.http = http
        try:
            yield console
        finally:
            await runner.cleanup()
