"""A console that plays a robot: what a test says is sent to the page, and what the page sends is kept."""

from __future__ import annotations

import asyncio
import json
import math
import struct
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import simplejpeg
from aiohttp import WSMsgType, web

from common.clock import monotonic_ns, to_ms
from common.picture_code import paste_code
from common.skeleton import load_skeleton
from deploy.console.app import PAGES
from deploy.console.files import PageFiles
from deploy.console.model.scene import scene
from deploy.console.study import questionnaires
from slave.guard.states import TRANSITIONS, State

CONSOLE = Path(__file__).parents[3] / "deploy" / "console"
POLICY = (
    "default-src 'self'; img-src 'self' blob:; style-src 'self'; connect-src 'self'; worker-src 'self'; "
    "frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
)
WINDOW = 8
SITUATIONS = {"boot": "starting", "hold": "holds", "align": "aligns", "track": "follows", "estop": "stopped"}


class FakeConsole:
    """Serves the page on a port of its own, in a thread of its own. Tests change the public attributes."""

    def __init__(self) -> None:
        self.view: dict[str, Any] = {}
        """Replaces keys of each `view`."""
        self.facts: dict[str, Any] = {}
        self.setup: dict[str, Any] = {}
        self.role = "operator"
        self.may = {"stop": True, "act": True, "reset": True, "hold": True}
        self.guard, self.reason = "track", "follows nurse-1"
        self.silent = False
        """Frames are no longer sent, and stops are not answered."""
        self.mute = False
        """No socket is told anything, as where too many pages are open; posts are answered."""
        self.robot = "robot-1"
        """The one that pages are shown; a page may turn to another."""
        self.told_stop: dict[str, Any] | None = None
        """What a page that may not look is told of its stop."""
        self.pictures = True
        self.picture: bytes | None = None
        self.h264: Any = None
        """Makes (bytes, alone) of pixels and whether the picture must stand alone: they are H.264."""
        self.loses = 0
        """So many of the next pictures do not arrive."""
        self.beside: tuple[str, ...] = ()
        """Cameras beside `head`."""
        self.frozen: tuple[str, ...] = ()
        """Cameras of which no picture comes any more."""
        self.coded = False
        """Each picture shows the time of this host as a code."""
        self.reports: list[dict[str, str]] = []
        self.calibration: dict[str, Any] | None = None
        """What the page of calibration is shown; each other value is sent once."""
        self.still = False
        """The robot and its operator do not move."""
        self.received: list[dict[str, Any]] = []
        self.posted: list[tuple[str, dict[str, Any]]] = []
        self.sent_encoders: list[float] = []
        self.most_unacknowledged = 0
        self.stop: dict[str, Any] | None = None
        self.shape: dict[str, Any] = scene(load_skeleton("nursing"))
        self._number, self._wants_key = 0, True
        self._stopped_s = 0.0
        self._sockets: set[web.WebSocketResponse] = set()
        self._ready = threading.Event()
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()
        self._ready.wait(10.0)

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    def of_kind(self, kind: str) -> list[dict[str, Any]]:
        return [message for message in self.received if message.get("kind") == kind]

    def drop_sockets(self) -> None:
        """Every socket is cut, as when the console restarts."""

        async def cut() -> None:
            for socket in list(self._sockets):
                await socket.close(code=1001)

        asyncio.run_coroutine_threadsafe(cut(), self._loop).result(5.0)

    def close(self) -> None:
        self.drop_sockets()
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(5.0)

    # ---- in the server's thread

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        runner = self._loop.run_until_complete(self._start())
        self._ready.set()
        self._loop.run_forever()
        self._loop.run_until_complete(runner.cleanup())
        self._loop.close()

    async def _start(self) -> web.AppRunner:
        app = web.Application(middlewares=[_headers])
        for path in PAGES:
            app.router.add_get(path, self._page)
        app.router.add_get("/api/questionnaires", self._questionnaires)
        app.router.add_get("/api/reports", self._reports)
        app.router.add_get("/api/setup", self._setup)
        app.router.add_get("/api/clock", self._clock)
        app.router.add_get("/ws", self._socket)
        app.router.add_post("/api/{what}", self._post)
        app.router.add_static("/page", CONSOLE / "page")
        app.router.add_static("/vendor", CONSOLE / "vendor")
        runner = web.AppRunner(app, access_log=None, shutdown_timeout=0.2)
        await runner.setup()
        site = web.TCPSite(runner, "127.0.0.1", 0)
        await site.start()
        self.port = runner.addresses[0][1]
        return runner

    async def _page(self, request: web.Request) -> web.Response:
        """As the console puts it together."""
        file = PageFiles().find("page", PAGES[request.path])
        assert file is not None
        return web.Response(body=file.plain, content_type="text/html", charset="utf-8")

    async def _questionnaires(self, _: web.Request) -> web.Response:
        return web.json_response(questionnaires())

    async def _reports(self, _: web.Request) -> web.Response:
        return web.json_response({"reports": self.reports})

    async def _setup(self, request: web.Request) -> web.Response:
        return web.json_response({
            "version": 1, "tandem": "0", "robots": ["robot-1", "robot-2"],
            "robot": request.query.get("robot", self.robot),
            "operator": "nurse-1", "side": "operator", "language": "en", "hardware_estop": False,
            "deadman": "console",
            "guard_states": [str(state) for state in State],
            "transitions": [[str(a), str(event), str(b)] for (a, event), b in TRANSITIONS.items()],
            "zones": [_BED], "calibrates": True,
            "zones_known": True, "cameras": ["head"], "stale_picture_s": 0.5, "silent_s": 0.5, "rate_hz": 25,
            "window": WINDOW, **self.shape, **self.setup,
        })  # fmt: skip

    async def _clock(self, _: web.Request) -> web.Response:
        return web.json_response({"here_ms": to_ms(monotonic_ns())})

    async def _post(self, request: web.Request) -> web.Response:
        if self.silent:
            await asyncio.sleep(3600.0)
        what, body = request.match_info["what"], await request.json()
        self.posted.append((what, body))
        if what == "stop":
            self._stop()
            return web.json_response({"id": 1}, status=202)
        if what == "act" and body["act"] == "engage":
            self.guard, self.reason = "align", "moves to the operator's posture"
        return web.json_response({"done": True, "text": f"{body.get('act', what)}: done", "role": "operator"})

    def _stop(self) -> None:
        if self.stop is None:
            self._stopped_s = time.monotonic()
            self.guard, self.reason = "estop", "stopped by console: nurse-1"
            self.stop = {"id": 1, "by": "console: nurse-1", "asked_s": 0.0, "robot_s": 0.02, "stands_s": None,
                         "text": "", "failed": ""}  # fmt: skip

    async def _socket(self, request: web.Request) -> web.WebSocketResponse:
        socket = web.WebSocketResponse()
        await socket.prepare(request)
        self._sockets.add(socket)
        acknowledged = {"n": 0}
        sender = asyncio.create_task(self._send(socket, acknowledged))
        try:
            async for message in socket:
                if message.type is WSMsgType.TEXT:
                    self._hear(json.loads(message.data), acknowledged)
        finally:
            sender.cancel()
            self._sockets.discard(socket)
        return socket

    def _hear(self, message: dict[str, Any], acknowledged: dict[str, int]) -> None:
        if message["kind"] == "ack":
            acknowledged["n"] = message["n"]
            return
        self.received.append(message)
        if message["kind"] == "robot":
            self.robot = message["robot"]
        self._wants_key |= message["kind"] == "keyframe"
        if message["kind"] == "stop" and not self.silent:
            self._stop()

    async def _send(self, socket: web.WebSocketResponse, acknowledged: dict[str, int]) -> None:
        while self.silent or self.mute:  # noqa: ASYNC110 - a test sets it from another thread
            await asyncio.sleep(0.04)
        who = {"role": self.role, "person": "nurse-1", "may": self.may, "session": "0badcafe"}
        n, turn, facts_turn, told = 0, 0, 0, ""
        led: dict[str, Any] | None = None
        while True:
            if told != self.robot:
                told = self.robot
                hello = {"kind": "hello", "robot": told, "viewers": len(self._sockets), **who}
                await socket.send_json(hello)
            await asyncio.sleep(0.04)
            turn += 1
            self.most_unacknowledged = max(self.most_unacknowledged, n - acknowledged["n"])
            if self.role == "nobody" and self.stop is not None and self.told_stop is not None:
                await socket.send_json({"kind": "stop", "stop": self.told_stop})
            if self.silent or self.mute or self.role == "nobody" or n - acknowledged["n"] >= WINDOW:
                continue
            if self.calibration != led and (led := self.calibration) is not None:
                n += 1
                await socket.send_json({"kind": "calibration", "n": n, **led})
            n += 1
            await socket.send_json(self._view(n))
            if turn >= facts_turn:
                n, facts_turn = n + 1, turn + 25
                await socket.send_json(self._facts(n))
            if turn % 2 and self.pictures:
                for camera in ("head", *self.beside):
                    if camera not in self.frozen:
                        n += 1
                        await self._send_picture(socket, n, camera)

    def _view(self, n: int) -> dict[str, Any]:
        now_s = 0.0 if self.still else time.monotonic()
        encoder, target = self.posture(now_s - 0.06), self.posture(now_s)
        self.sent_encoders = encoder
        stop = self.stop
        if stop is not None:
            since_s = time.monotonic() - self._stopped_s
            stop = {**stop, "since_s": since_s, "stands_s": 0.31 if since_s > 0.3 else None}
        return {
            "kind": "view", "n": n, "robot": self.robot, "heard": "tap", "silent_s": 0.02, "state_n": n,
            "guard": self.guard, "reason": self.reason, "operator": "nurse-1", "lease": "ours",
            "situation": SITUATIONS.get(self.guard, "holds"), "master": True, "deadman": True,
            "clutch_out": False, "resting": [], "encoder": encoder, "setpoint": target, "target": target,
            "external_nm": [
                6.0 * max(0.0, math.sin(now_s)) if "left" in joint["name"] else 0.2
                for joint in self.shape["joints"]
            ],
            "latency": {"ms": 48.2, "bound_ms": 0.5, "trusted": True, "one_way_ms": 41, "round_trip_ms": 83},
            "video": {"head": {"age_ms": 93.0, "bound_ms": 1.0, "fps": 12.5, "stale": False}}, "page_ms": 4.0,
            "stop": stop, "holder": "", **self.view,
        }  # fmt: skip

    def posture(self, at_s: float) -> list[float]:
        moving = self.guard in ("track", "align")
        phase = 1.1 * at_s if moving else 0.0
        angles = []
        for j, joint in enumerate(self.shape["joints"]):
            around = _BASE.get(joint["name"].partition("_")[2], 0.0)
            angle = around + 0.25 * math.sin(phase + 0.7 * j)
            angles.append(min(max(angle, joint["lower_rad"]), joint["upper_rad"]))
        return angles

    def _facts(self, n: int) -> dict[str, Any]:
        return {"kind": "facts", "n": n, "robot": self.robot, **_FACTS, **self._levels(), **self.facts}

    def _levels(self) -> dict[str, Any]:
        level = {"left_forearm": ("silent", "silent for 3 s; check its cable")}
        nodes = []
        for node in self.shape["nodes"]:
            found, words = level.get(node["name"], ("ok", ""))
            nodes.append(
                {"name": node["name"], "level": found, "answered_percent": 99.9, "lost": 0, "words": words}
            )
        return {"nodes": nodes}

    async def _send_picture(self, socket: web.WebSocketResponse, n: int, camera: str) -> None:
        if self.h264 is None:
            await socket.send_bytes(self._frame(n, camera))
            return
        number, self._number = self._number + 1, self._number + 1
        body, alone = self.h264(_pixels(self.coded), self._wants_key)
        after = 0 if alone else number - 1
        self._wants_key = False
        if self.loses and not alone:
            self.loses -= 1
            return
        about = {"camera": "head", "number": number, "codec": "h264", "after": after, "age_ms": 92.1,
                 "bound_ms": 1.0, "width": 320, "height": 240}  # fmt: skip
        header = json.dumps({"kind": "picture", "n": n, **about}).encode()
        await socket.send_bytes(struct.pack("<I", len(header)) + header + body)

    def _frame(self, n: int, camera: str) -> bytes:
        about = {"camera": camera, "number": n, "age_ms": 92.1, "bound_ms": 1.0, "width": 320, "height": 240}
        header = json.dumps({"kind": "picture", "n": n, **about}).encode()
        return struct.pack("<I", len(header)) + header + (self.picture or _jpeg(self.coded))


@web.middleware
async def _headers(request: web.Request, handler: Any) -> web.StreamResponse:
    response: web.StreamResponse = await handler(request)
    if not isinstance(response, web.WebSocketResponse):
        response.headers["Content-Security-Policy"] = POLICY
    return response


def _jpeg(coded: bool = False) -> bytes:
    return bytes(simplejpeg.encode_jpeg(_pixels(coded), quality=80))


def _pixels(coded: bool = False) -> Any:
    """A room: wall, floor, bed and a lamp that moves."""
    picture = np.empty((240, 320, 3), dtype=np.uint8)
    picture[:150], picture[150:] = (200, 205, 198), (120, 100, 84)
    picture[120:200, 60:250] = (228, 232, 240)
    picture[105:135, 70:120] = (250, 250, 250)
    x = int(250 + 30 * math.sin(time.monotonic()))
    picture[40:70, x : x + 24] = (250, 230, 150)
    if coded:
        paste_code(picture, monotonic_ns(), (150, 20), 6)
    return picture


_BASE = {"shoulder_pitch": 0.7, "elbow_pitch": 0.9}
"""About which the arms move, rad: ahead of the body."""
_BED = {"name": "bed", "shape": "box", "center_m": [0.9, 0.0, 0.35], "size_m": [0.8, 1.9, 0.7], "yaw_deg": 0}
_FACTS: dict[str, Any] = {
    "latency": {
        "minute": [[-59.0 + s, 46.0 + 3.0 * math.sin(s / 4.0), 0.5] for s in range(60)],
        "stages": [
            {"name": "sampled→frames in", "mean_ms": 1.2, "p99_ms": 2.0},
            {"name": "frames in→solved", "mean_ms": 0.9, "p99_ms": 1.6},
            {"name": "put→received", "mean_ms": 41.0, "p99_ms": 44.1},
            {"name": "received→written", "mean_ms": 5.1, "p99_ms": 9.9},
        ],
        "creep": {"alarm": False, "ms_per_min": 0.02, "low": -0.1, "high": 0.14, "words": ""},
    },
    "link": {"word": "good", "lost_percent": 0.0, "missing_percent": 0.1, "jitter_ms": 3.0, "needs": "",
             "why": ""},
    "faults": {},
    "events": [
        {"id": 1, "age_s": 95.0, "what": "act", "text": "nurse-1 engaged robot-1"},
        {"id": 2, "age_s": 93.0, "what": "state", "text": "follows nurse-1"},
        {"id": 3, "age_s": 61.0, "what": "clamp", "text": "left_elbow_pitch: asked 3.4, given 2.6 rad/s"},
        {"id": 4, "age_s": 12.0, "what": "hold", "text": "held for 0.4 s: commands were silent for 0.2 s"},
    ],
    "doubt": "", "shift": [], "switches": {"deadman": "held"},
    "drives": {"temperature_c": None, "counters": {"writes": 15210}, "no_effort": {}, "effort_nm": None},
    "base": {"tilt_deg": 0.1}, "camera": {"fps": 12.5, "kb_s": 80, "fault": ""},
    "versions": {"master": "0.1.0", "robot": "0.1.0"}, "recorder": None,
    "viewers": [{"person": "nurse-1", "robot": "robot-1", "this": True}],
    "console": {"cpu_percent": 1.4, "rss_mb": 57, "skipped": 0},
}  # fmt: skip
LED: dict[str, Any] = {
    "under_way": True, "what": ["align"],
    "view": {
        "step": "zero_pose", "number": 2, "steps": 3, "share": 0.0,
        "places": {"attitudes": "20", "still": "3", "seconds": "3"},
        "zero_pose": {"waits": True, "countdown_s": 0.0, "held_s": 0.0, "wanted_s": 3.0},
        "nodes": [
            {"name": "left_forearm", "share": 0.0, "hint": "silent", "places": {}},
            {"name": "right_hand", "share": 0.0, "hint": "moves", "places": {}},
            {"name": "head", "share": 1.0, "hint": "still", "places": {"seconds": "3.0"}},
        ],
    },
}  # fmt: skip
"""A suit that is being calibrated."""
STUDY: dict[str, Any] = {
    "subject": "k7pd", "session": "01", "protocol": "cup", "done": 1, "steps": 2, "since_s": 12.0,
    "step": {"name": "questions", "text": {"en": "Answer.", "zh": "请填写。"}, "seconds": 60.0,
             "questionnaire": "nasa-tlx"},
    "next": {"name": "rest", "text": {"en": "Stand."}, "seconds": None, "questionnaire": None},
    "answered": [],
}  # fmt: skip
