"""The pages that are open, and what each is sent; a slow one costs no other anything."""

from __future__ import annotations

import asyncio
import json
import logging
import struct
from collections.abc import Mapping
from typing import Protocol

from common.clock import monotonic_ns, to_ns
from common.wire.video import JPEG, VideoFrame
from deploy.console.model.glass import GlassWatch, read_shown
from deploy.console.model.pictures import picture_header
from deploy.console.model.robot import RobotModel
from deploy.console.outbox import Outbox
from deploy.console.picture_choice import PictureChoice
from deploy.console.session import Person, RateLimit

MOST = 8
"""Pages at once."""
KEPT = 4
"""More pages at once, of those who may act: strangers cannot take the places of all."""
MESSAGES_PER_S = 150.0
REQUESTS_PER_S = 20.0
"""Messages that are neither acknowledgements nor beats of the deadman."""
LOST_S = 2.0
"""A page that owes an acknowledgement for so long counts as lost."""
_LENGTH = struct.Struct("<I")

log = logging.getLogger(__name__)


class PageSocket(Protocol):
    """What is needed of a WebSocket; aiohttp's is one."""

    async def send_str(self, data: str) -> None:
        """Send text; waits while the buffer is full."""

    async def send_bytes(self, data: bytes) -> None:
        """Send bytes; likewise."""


class OpenPage:
    """One page."""

    def __init__(self, socket: PageSocket, model: RobotModel, secret: str, person: Person) -> None:
        """`secret`: of its log-in; empty without one."""
        self.socket = socket
        self.model = model
        self.secret = secret
        self.person = person
        self.outbox = Outbox()
        self.glass = GlassWatch()
        self.messages = RateLimit(MESSAGES_PER_S)
        self.requests = RateLimit(REQUESTS_PER_S)
        self.wants_jpeg = False
        """Its browser cannot decode H.264."""
        self.holds = False
        """Whether this page holds the deadman."""
        self.beat_ns = 0
        """When it last said so."""
        self.lapsed = False
        """Fell silent while it held: must release before it can hold again."""
        self.asked_stop = False
        """Whether it asked for a stop of the robot that it shows."""
        self._choice = PictureChoice()
        self._stop_told: Mapping[str, object] | None = None
        self._first: list[str] = []
        self._ready = asyncio.Event()

    @property
    def name(self) -> str:
        """For people."""
        return self.person.name or self.person.role.value

    def say(self, message: Mapping[str, object]) -> None:
        """Send this before all that waits. At most a few: answers to what the page itself asked."""
        if len(self._first) < REQUESTS_PER_S:
            self._first.append(pack(message))
            self._ready.set()

    def show(self, kind: str, body: str, own: Mapping[str, object]) -> None:
        """Offer a message: `body` is the JSON object that all pages get, `own` what this page alone gets."""
        if not self.person.role.sees:
            return

        def make(number: int) -> str:
            return f"{pack({'kind': kind, 'n': number, **own})[:-1]},{body[1:]}"

        self.outbox.offer(kind, make)
        self._ready.set()

    def show_picture(self, camera: str, frame: VideoFrame) -> bool:
        """Offer a picture; its age is that of the moment at which it leaves.

        False: this page cannot show it, and needs one that stands alone.
        """
        if not self.person.role.sees or not self._choice.wants(camera, frame, monotonic_ns()):
            return True

        def make(number: int) -> bytes:
            now_ns = monotonic_ns()
            header = picture_header(camera, frame, self.model.offset(now_ns), now_ns)
            text = pack({"kind": "picture", "n": number, **header}).encode()
            return _LENGTH.pack(len(text)) + text + frame.body

        shown = True
        if frame.codec == JPEG:
            self.outbox.offer(f"picture {camera}", make)
        else:
            begins = frame.after == 0
            shown = self.outbox.offer_in_order(f"picture {camera}", frame.number, make, begins)
        self._ready.set()
        return shown

    def look(self, camera: object) -> None:
        """The page shows this camera large; None: it shows none at all. Anything else changes nothing."""
        if camera is None or isinstance(camera, str):
            self._choice.at(camera)

    def tell_stop(self, now_ns: int) -> None:
        """What became of the stop that this page asked for, where no view tells it: not who else asked."""
        if self.person.role.sees or not self.asked_stop:
            return
        stop = self.model.stop
        told = None if stop is None else stop.lights()
        if told != self._stop_told:
            self._stop_told = told
            since_s = None if stop is None else stop.shown(now_ns)["since_s"]
            self.say({"kind": "stop", "stop": None if told is None else {**told, "since_s": since_s}})

    def saw_code(self, body: Mapping[str, object], now_ns: int) -> None:
        """The page read the time that a picture on its screen shows."""
        shown = read_shown(body, now_ns)
        if shown is not None and shown.camera in self.model.pictures.newest:
            stamp_ns = self.model.pictures.captured_ns(shown.camera, shown.number)
            self.glass.add(shown, self.model.offset(now_ns), stamp_ns)

    def acknowledge(self, number: object) -> None:
        """The page has processed all up to this number."""
        if type(number) is int and self.outbox.acknowledge(number, monotonic_ns()):
            self._ready.set()

    def saw_lately(self, number: object, within_s: float) -> bool:
        """Whether the message of that number left at most so long ago: a page that stands still did not."""
        left_ns = self.outbox.left_ns(number) if type(number) is int else None
        return left_ns is not None and monotonic_ns() - left_ns <= to_ns(within_s)

    def turn_to(self, model: RobotModel) -> None:
        """Show another robot."""
        self.model = model
        self.asked_stop, self._stop_told = False, None
        self.outbox.clear()
        self.glass.clear()
        self._choice = PictureChoice()

    async def write(self) -> None:
        """Send until cancelled. A socket that stands still stops only this page's own writer."""
        while True:
            await self._ready.wait()
            self._ready.clear()
            while self._first:
                await self.socket.send_str(self._first.pop(0))
            while (message := self.outbox.take(monotonic_ns())) is not None:
                if isinstance(message, str):
                    await self.socket.send_str(message)
                else:
                    await self.socket.send_bytes(message)


def pack(message: Mapping[str, object]) -> str:
    """As JSON. Raises ValueError for a number that is none."""
    return json.dumps(message, separators=(",", ":"), allow_nan=False, ensure_ascii=False)
