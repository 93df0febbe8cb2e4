"""A page's WebSocket: what it is sent, and what it says."""

from __future__ import annotations

import asyncio
import logging
from contextlib import suppress

from aiohttp import WSCloseCode, WSMsgType, web

from common.clock import monotonic_ns
from deploy.console.hub import Hub
from deploy.console.posts import NOT_KEPT
from deploy.console.replies import Visitors, parsed
from deploy.console.viewers import REQUESTS_PER_S, OpenPage, pack

LONGEST = 4096
"""Bytes of a message or a body."""
STILL_S = 10.0
"""A socket is asked for a sign of life so often; a process that stands still is closed after half as long."""

log = logging.getLogger(__name__)


class PageSockets:
    """The handler of `/ws`."""

    def __init__(self, hub: Hub, visitors: Visitors) -> None:
        self._hub = hub
        self._visitors = visitors

    async def serve(self, request: web.Request) -> web.StreamResponse:
        """One page, until it goes."""
        socket = web.WebSocketResponse(max_msg_size=LONGEST, heartbeat=STILL_S, compress=False)
        await socket.prepare(request)
        secret, person = self._visitors.of(request)
        if self._hub.full(person):
            self._hub.access.count_refusal("viewers")
            why = f"{len(self._hub.pages)} pages are open already"
            await socket.send_str(pack({"kind": "bye", "why": why}))
            await socket.close(code=WSCloseCode.TRY_AGAIN_LATER)
            return socket
        robot = request.query.get("robot") or self._hub.robots[0]
        why = self._hub.find(robot, person)
        model = self._hub.models[self._hub.robots[0] if why else robot]
        page = OpenPage(socket, model, secret, person)
        self._hub.enter(page)
        if why:  # it was on this page before it was away: another one must not take its place unsaid
            text = f"{robot}: {why}; this page shows {model.robot}"
            page.say({"kind": "answer", "to": "robot", "done": False, "text": text})
        writing = asyncio.create_task(page.write())
        try:
            why = await self._listen(socket, page)
            if why:
                log.warning("page of %s closed: %s", page.name, why)
                with suppress(ConnectionError):
                    await asyncio.wait_for(socket.send_str(pack({"kind": "bye", "why": why})), 1.0)
                await socket.close(code=WSCloseCode.POLICY_VIOLATION)
        finally:
            self._hub.leave(page)
            writing.cancel()
            await asyncio.gather(writing, return_exceptions=True)
        return socket

    async def _listen(self, socket: web.WebSocketResponse, page: OpenPage) -> str:
        """Take the page's messages until it goes; why it is closed, where this side does."""
        access = self._hub.access
        async for message in socket:
            if message.type is WSMsgType.ERROR:
                access.count_refusal("size" if message.data.code == WSCloseCode.MESSAGE_TOO_BIG else "form")
                break
            now_ns = monotonic_ns()
            body = parsed(message.data) if message.type is WSMsgType.TEXT else None
            kind = None if body is None else body.get("kind")
            if body is not None and kind == "stop":  # before any limit
                self._request(page, kind, body.get("robot") or page.model.robot)
            if not page.messages.passes(now_ns):
                access.count_refusal("rate")
                return "too many messages"
            if body is None:
                access.count_refusal("form")
                return "a message that is no JSON object"
            if kind == "ack":
                page.acknowledge(body.get("n"))
            elif kind == "held":
                words = self._hub.held(page, body.get("down") is True, body.get("n"))
                if words:
                    page.say({"kind": "answer", "to": "held", "done": False, "text": words})
            elif kind != "stop" and not page.requests.passes(now_ns):
                access.count_refusal("rate")
                return f"more than {REQUESTS_PER_S:g} requests a second"
            elif kind == "shown":
                page.saw_code(body, now_ns)
            elif kind == "look":
                page.look(body.get("camera"))
            elif kind == "jpeg":
                if words := self._hub.want_jpeg(page):
                    page.say({"kind": "answer", "to": "jpeg", "done": False, "text": words})
            elif kind == "keyframe" and isinstance(camera := body.get("camera"), str):
                self._hub.ask_for_key(page.model.robot, camera)
            elif kind != "stop":
                self._request(page, kind, body.get("robot", page.model.robot))
        return ""

    def _request(self, page: OpenPage, kind: object, robot: object) -> None:
        stopper = self._hub.stopper(robot) if kind == "stop" and isinstance(robot, str) else None
        known = stopper is not None or (isinstance(robot, str) and robot in self._hub.models)
        if kind == "robot" and isinstance(robot, str):
            why = self._hub.turn(page, robot)
            if why:
                page.say({"kind": "answer", "to": "robot", "done": False, "text": why})
        elif not known:
            text = f"no such robot here: expected one of {', '.join(self._hub.robots)}"
            page.say({"kind": "answer", "to": str(kind)[:20], "done": False, "text": text})
        elif stopper is not None:
            page.asked_stop |= robot == page.model.robot
            shown = stopper.stop(f"console: {page.name}")
            sure = shown.kept or shown.robot_ns is not None
            text = "asked" if sure else NOT_KEPT
            page.say({"kind": "answer", "to": "stop", "done": sure, "text": text, "id": shown.number})
        else:
            page.say({"kind": "answer", "to": str(kind)[:20], "done": False, "text": "no such message"})
