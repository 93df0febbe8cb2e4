"""Two Zenoh sessions in the place of one: what of `zenoh.Session` a link uses, on both. See twin.py."""

from __future__ import annotations

import secrets
import threading
from collections.abc import Callable
from functools import partial

import zenoh
from zenoh.handlers import Callback

from common.link.twin import NUMBER, TwinAnswers, TwinHeld, TwinPublisher, TwinQuestions


class TwinSession:
    """Stands for a `zenoh.Session` towards `Link` and `LinkSession`."""

    def __init__(self, first: zenoh.Session, second: zenoh.Session) -> None:
        self._both = (first, second)
        self._asker, self._asked = secrets.randbits(64), 0
        self.info = TwinInfo(self._both)

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
        """On both paths."""
        return TwinPublisher(
            [
                each.declare_publisher(
                    key, congestion_control=congestion_control, priority=priority, express=express,
                    reliability=reliability, allowed_destination=allowed_destination,
                )
                for each in self._both
            ]
        )  # fmt: skip

    def declare_subscriber(self, key: str, handler: Callback[zenoh.Sample]) -> TwinHeld:
        """On both paths; the receiver tells the copies apart (`FirstArrivals`)."""
        return TwinHeld([each.declare_subscriber(key, handler) for each in self._both])

    def declare_queryable(
        self, key: str, handler: Callback[zenoh.Query], *, complete: bool = False
    ) -> TwinHeld:
        """On both paths; the copies of one question are handled once."""
        questions = TwinQuestions(handler.callback)
        both: Callback[zenoh.Query] = Callback(questions.on_query, indirect=False)
        return TwinHeld([each.declare_queryable(key, both, complete=complete) for each in self._both])

    def declare_querier(self, key: str, *, allowed_destination: zenoh.Locality) -> TwinQuerier:
        """On both paths."""
        return TwinQuerier(
            [each.declare_querier(key, allowed_destination=allowed_destination) for each in self._both]
        )

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
        """Ask on both paths under one number."""
        self._asked += 1
        drop = handler.drop
        answers = TwinAnswers(handler.callback, drop if drop is not None else lambda: None)
        for each in self._both:
            each.get(
                key, Callback(answers.reply, answers.end, indirect=False), payload=payload, timeout=timeout,
                target=target, consolidation=consolidation, congestion_control=congestion_control,
                priority=priority, express=express, allowed_destination=allowed_destination,
                attachment=NUMBER.pack(self._asker, self._asked),
            )  # fmt: skip

    def liveliness(self) -> TwinLiveliness:
        """Of both paths."""
        return TwinLiveliness(self._both)

    def close(self) -> None:
        """Close both, side by side: on a path that leads nowhere it can take ten seconds."""
        second = threading.Thread(target=self._both[1].close, name="twin-close", daemon=True)
        second.start()
        self._both[0].close()
        second.join()


class TwinInfo:
    """Who is connected, on either path."""

    def __init__(self, both: tuple[zenoh.Session, zenoh.Session]) -> None:
        self._both = both

    def transports(self) -> list[object]:
        """Of the path that has more: one peer has two."""
        return max(([*each.info.transports()] for each in self._both), key=len)

    def declare_transport_events_listener(self, handler: Callback[object], *, history: bool) -> TwinHeld:
        """Of both paths."""
        listen = [each.info.declare_transport_events_listener for each in self._both]
        return TwinHeld([each(handler, history=history) for each in listen])

    def declare_link_events_listener(self, handler: Callback[zenoh.LinkEvent], *, history: bool) -> TwinHeld:
        """Of both paths."""
        listen = [each.info.declare_link_events_listener for each in self._both]
        return TwinHeld([each(handler, history=history) for each in listen])


class TwinQuerier:
    """Whether somebody answers, on either path."""

    def __init__(self, queriers: list[zenoh.Querier]) -> None:
        self._queriers = queriers

    def declare_matching_listener(self, handler: Callback[object]) -> TwinHeld:
        """Of both paths."""
        return TwinHeld([each.declare_matching_listener(handler) for each in self._queriers])

    @property
    def matching_status(self) -> bool:
        """Whether somebody does."""
        return any(bool(getattr(s, "matching", s)) for s in (each.matching_status for each in self._queriers))

    def undeclare(self) -> None:
        """On both paths."""
        for each in self._queriers:
            each.undeclare()


class TwinLiveliness:
    """Tokens on both paths: one is there while either path shows it."""

    def __init__(self, both: tuple[zenoh.Session, zenoh.Session]) -> None:
        self._both = both

    def declare_token(self, key: str) -> TwinHeld:
        """On both paths."""
        return TwinHeld([each.liveliness().declare_token(key) for each in self._both])

    def declare_subscriber(self, key: str, handler: Callback[zenoh.Sample], *, history: bool) -> TwinHeld:
        """Tell of the first copy that comes and of the last that goes."""
        tokens = TwinTokens(handler.callback)
        return TwinHeld(
            [
                each.liveliness().declare_subscriber(
                    key, Callback(partial(tokens.on_sample, path), indirect=False), history=history
                )
                for path, each in enumerate(self._both)
            ]
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
