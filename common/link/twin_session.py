"""Several Zenoh sessions in the place of one, one a path: what of `zenoh.Session` a link uses, on each.

A path may come late: what is declared by then is declared on it too, in the same order. See twin.py.
"""

from __future__ import annotations

import asyncio
import secrets
import threading
from collections.abc import Callable
from functools import partial
from typing import Generic, TypeVar

import zenoh
from zenoh.handlers import Callback

from common.link.twin import NUMBER, TwinAnswers, TwinPublisher, TwinQuestions

Part = TypeVar("Part")


class OnPaths(Generic[Part]):
    """One thing, declared on every path that is open."""

    def __init__(
        self, declare: Callable[[int, zenoh.Session], Part], drop: Callable[[OnPaths[Part]], object]
    ) -> None:
        """`declare(path, session)` declares it on one path. `drop` is told when it is declared no more."""
        self._declare = declare
        self._drop = drop
        self._parts: dict[int, Part] = {}
        self.each: tuple[Part, ...] = ()
        """What holds it on each path. Replaced as a whole: Zenoh's threads read it."""

    def is_on(self, path: int) -> bool:
        """Whether it is declared on that path."""
        return path in self._parts

    def open(self, path: int, session: zenoh.Session) -> None:
        """Declare it on a path too."""
        if path not in self._parts:
            self._parts[path] = self._declare(path, session)
            self.each = tuple(self._parts.values())

    def on(self, path: int) -> Part:
        """What holds it on that path."""
        return self._parts[path]

    def undeclare(self) -> None:
        """On every path."""
        self._drop(self)
        for each in self.each:
            undeclare = getattr(each, "undeclare", None)
            if undeclare is not None:
                undeclare()


class TwinSession:
    """Stands for a `zenoh.Session` towards `Link` and `LinkSession`. All but `close` is for the loop."""

    def __init__(self, sessions: dict[int, zenoh.Session], names: tuple[str, ...] = ("", "")) -> None:
        """`sessions`: of the paths that are open, by number; at least one. `names`: of all paths."""
        self._sessions = dict(sessions)
        self._names = names
        self._declared: list[OnPaths[object]] = []
        self._closed = False
        self._closing = threading.Lock()
        self._asker, self._asked = secrets.randbits(64), 0
        self.missing: dict[int, str] = {}
        """Why a path is not open, in words, by number."""
        self.on_close: Callable[[], object] = lambda: None
        """Called as it closes, in any thread: nobody need look for the missing paths any more."""
        self.info = TwinInfo(self)

    @property
    def each(self) -> tuple[zenoh.Session, ...]:
        """The sessions that are open."""
        return tuple(self._sessions.values())

    async def attach(self, path: int, session: zenoh.Session) -> bool:
        """A path that was missing has opened; False where this session was closed meanwhile.

        The loop goes on between two declarations: a robot may be following. Raises ZError where one fails;
        called again with the same session it goes on there. Who calls closes a session that is not attached.
        """
        while (lacks := next((one for one in self._declared if not one.is_on(path)), None)) is not None:
            lacks.open(path, session)
            await asyncio.sleep(0)
        with self._closing:
            if self._closed:
                return False
            self._sessions[path] = session  # from now on in use for what is declared or asked
        self.missing.pop(path, None)
        return True

    @property
    def words(self) -> str:
        """Which paths do not carry while another does; empty where all do, or none does."""
        lacks = [f"{self._names[path]}: {why}" for path, why in self.missing.items()]
        connected = {path: bool(one.info.transports()) for path, one in tuple(self._sessions.items())}
        if any(connected.values()):
            lacks += [f"{self._names[p]}: nobody is connected" for p, there in connected.items() if not there]
        return "; ".join(lacks)

    def declare(self, declare: Callable[[int, zenoh.Session], Part]) -> OnPaths[Part]:
        """Declare something on each path, those that open later too."""
        declared = OnPaths(declare, self._dropped)
        for path, session in self._sessions.items():
            declared.open(path, session)
        self._declared.append(declared)  # type: ignore[arg-type]  # whatever its parts are
        return declared

    def _dropped(self, declared: object) -> None:
        self._declared = [each for each in self._declared if each is not declared]

    def declare_publisher(
        self,
        key: str,
        *,
        congestion_control: zenoh.CongestionControl,
        priority: zenoh.Priority,
        express: bool,
        reliability: zenoh.Reliability,
        allowed_destination: zenoh.Locality,
    ) -> TwinPublisher:
        """On each path."""
        held = self.declare(
            lambda _, session: session.declare_publisher(
                key, congestion_control=congestion_control, priority=priority, express=express,
                reliability=reliability, allowed_destination=allowed_destination,
            )
        )  # fmt: skip
        return TwinPublisher(held, self.declare)

    def declare_subscriber(self, key: str, handler: Callback[zenoh.Sample]) -> OnPaths[object]:
        """On each path; the receiver tells the copies apart (`FirstArrivals`)."""
        return self.declare(lambda _, session: session.declare_subscriber(key, handler))

    def declare_queryable(
        self, key: str, handler: Callback[zenoh.Query], *, complete: bool = False
    ) -> OnPaths[object]:
        """On each path; the copies of one question are handled once."""
        questions = TwinQuestions(handler.callback)
        both: Callback[zenoh.Query] = Callback(questions.on_query, indirect=False)
        return self.declare(lambda _, session: session.declare_queryable(key, both, complete=complete))

    def declare_querier(self, key: str, *, allowed_destination: zenoh.Locality) -> TwinQuerier:
        """On each path."""
        held = self.declare(
            lambda _, session: session.declare_querier(key, allowed_destination=allowed_destination)
        )
        return TwinQuerier(held, self.declare)

    def get(
        self,
        key: str,
        handler: Callback[zenoh.Reply],
        *,
        payload: bytes,
        timeout: float,
        target: zenoh.QueryTarget,
        consolidation: zenoh.ConsolidationMode,
        congestion_control: zenoh.CongestionControl,
        priority: zenoh.Priority,
        express: bool,
        allowed_destination: zenoh.Locality,
    ) -> None:
        """Ask on each path under one number."""
        self._asked += 1
        drop, sessions = handler.drop, self.each
        answers = TwinAnswers(
            handler.callback, drop if drop is not None else lambda: None, paths=len(sessions)
        )
        for each in sessions:
            each.get(
                key, Callback(answers.reply, answers.end, indirect=False), payload=payload, timeout=timeout,
                target=target, consolidation=consolidation, congestion_control=congestion_control,
                priority=priority, express=express, allowed_destination=allowed_destination,
                attachment=NUMBER.pack(self._asker, self._asked),
            )  # fmt: skip

    def liveliness(self) -> TwinLiveliness:
        """Of all paths."""
        return TwinLiveliness(self)

    def close(self) -> None:
        """Close all, side by side: on a path that leads nowhere it can take ten seconds."""
        with self._closing:
            self._closed = True
        self.on_close()
        first, *others = self.each
        closing = [threading.Thread(target=one.close, name="twin-close", daemon=True) for one in others]
        for thread in closing:
            thread.start()
        first.close()
        for thread in closing:
            thread.join()


class TwinInfo:
    """Who is connected, on any path."""

    def __init__(self, twin: TwinSession) -> None:
        self._twin = twin

    def transports(self) -> list[object]:
        """Of the path that has most: one peer has one on each."""
        return max(([*each.info.transports()] for each in self._twin.each), key=len)

    def declare_transport_events_listener(
        self, handler: Callback[object], *, history: bool
    ) -> OnPaths[object]:
        """Of all paths."""
        return self._twin.declare(
            lambda _, session: session.info.declare_transport_events_listener(handler, history=history)
        )

    def declare_link_events_listener(
        self, handler: Callback[zenoh.LinkEvent], *, history: bool
    ) -> OnPaths[object]:
        """Of all paths."""
        return self._twin.declare(
            lambda _, session: session.info.declare_link_events_listener(handler, history=history)
        )


class TwinQuerier:
    """Whether somebody answers, on any path."""

    def __init__(
        self,
        held: OnPaths[zenoh.Querier],
        declare: Callable[[Callable[[int, zenoh.Session], object]], OnPaths[object]],
    ) -> None:
        self._held = held
        self._declare = declare
        self._listeners: list[OnPaths[object]] = []

    def declare_matching_listener(self, handler: Callback[object]) -> OnPaths[object]:
        """Of all paths."""
        listener = self._declare(lambda path, _: self._held.on(path).declare_matching_listener(handler))
        self._listeners.append(listener)
        return listener

    @property
    def matching_status(self) -> bool:
        """Whether somebody does."""
        return any(bool(getattr(s, "matching", s)) for s in (one.matching_status for one in self._held.each))

    def undeclare(self) -> None:
        """On every path, and what listens to it."""
        for listener in self._listeners:
            listener.undeclare()
        self._held.undeclare()


class TwinLiveliness:
    """Tokens on all paths: one is there while any path shows it."""

    def __init__(self, twin: TwinSession) -> None:
        self._twin = twin

    def declare_token(self, key: str) -> OnPaths[object]:
        """On each path."""
        return self._twin.declare(lambda _, session: session.liveliness().declare_token(key))

    def declare_subscriber(
        self, key: str, handler: Callback[zenoh.Sample], *, history: bool
    ) -> OnPaths[object]:
        """Tell of the first copy that comes and of the last that goes."""
        tokens = TwinTokens(handler.callback)
        return self._twin.declare(
            lambda path, session: session.liveliness().declare_subscriber(
                key, Callback(partial(tokens.on_sample, path), indirect=False), history=history
            )
        )


class TwinTokens:
    """Which paths show each token. Zenoh may tell of one twice on a path: it counts once there."""

    def __init__(self, callback: Callable[[zenoh.Sample], object]) -> None:
        self._callback = callback
        self._paths: dict[str, set[int]] = {}
        self._lock = threading.Lock()

    def on_sample(self, path: int, sample: zenoh.Sample) -> None:
        """Called in Zenoh's threads."""
        key, alive = str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT
        # told under the lock: else "gone" on one path could be told after "here" on the other
        with self._lock:
            paths = self._paths.get(key, set())
            before = bool(paths)
            (paths.add if alive else paths.discard)(path)
            if paths:
                self._paths[key] = paths
            else:
                self._paths.pop(key, None)
            if bool(paths) != before:
                self._callback(sample)
