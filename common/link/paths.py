"""Opens the path of a link, or both; a path that the host does not have yet does not hold up the other."""

from __future__ import annotations

import asyncio
import logging
import math
from collections.abc import Callable
from functools import partial
from typing import cast

import zenoh

from common.errors import LinkError
from common.link.config import LinkConfig
from common.link.inbox import wake
from common.link.opening import MOST_RETRY_S, close_unwanted, open_zenoh
from common.link.twin_session import TwinSession

log = logging.getLogger(__name__)


async def open_paths(
    config: LinkConfig,
    mode: str = "",
    within_s: float = math.inf,
    waits: Callable[[str], None] = lambda _: None,
    revoked: frozenset[str] = frozenset(),
) -> zenoh.Session:
    """As `open_zenoh`; with `[link.twin]` two sessions that stand as one.

    One path is enough to begin. The other is looked for in the background, and attached once it is there.
    """
    if config.second is None:
        return await open_zenoh(config, mode, within_s, waits, revoked)
    opening = _Opening((config, config.second), mode, within_s, waits, revoked)
    # it has what a link uses of a session
    return cast("zenoh.Session", await opening.run())


class _Opening:
    """Two paths that are being opened side by side."""

    def __init__(
        self,
        paths: tuple[LinkConfig, LinkConfig],
        mode: str,
        within_s: float,
        waits: Callable[[str], None],
        revoked: frozenset[str],
    ) -> None:
        self._paths, self._mode, self._within_s = paths, mode, within_s
        self._waits, self._revoked = waits, revoked
        self._names = tuple(f"path {', '.join([*p.listen, *p.connect])}" for p in paths)
        self._missing: dict[int, str] = {}
        self._changed = asyncio.Event()
        self._begun = False

    async def run(self) -> TwinSession:
        """Until each path is open or known to be missing, and one is open. Raises LinkError."""
        tasks = {path: self._open(path) for path in range(len(self._paths))}
        try:
            while not (sessions := self._begins_with(tasks)):
                self._changed.clear()
                await self._changed.wait()
        except BaseException:
            for task in tasks.values():
                task.cancel()
                task.add_done_callback(close_unwanted)
            raise
        self._begun = True
        for path in sessions:
            self._missing.pop(path, None)
        twin = TwinSession(sessions, self._names)
        twin.missing = self._missing
        late = [
            asyncio.create_task(self._attach_late(twin, path, task))
            for path, task in tasks.items()
            if path not in sessions
        ]
        twin.on_close = partial(_cancel, asyncio.get_running_loop(), late)
        return twin

    def _open(self, path: int) -> asyncio.Task[zenoh.Session]:
        task = asyncio.create_task(
            open_zenoh(
                self._paths[path], self._mode, self._within_s, partial(self._wait, path), self._revoked
            )
        )
        task.add_done_callback(lambda _: self._changed.set())
        return task

    def _wait(self, path: int, words: str) -> None:
        self._missing[path] = words.removeprefix("waiting: ")
        self._changed.set()
        if not self._begun:
            self._waits(words)

    def _begins_with(self, tasks: dict[int, asyncio.Task[zenoh.Session]]) -> dict[int, zenoh.Session]:
        """The sessions to begin with; none yet where a path may still open at once. Raises LinkError."""
        sessions: dict[int, zenoh.Session] = {}
        failed: list[BaseException] = []
        for path, task in tasks.items():
            if not task.done():
                continue
            error = task.exception()
            if error is None:
                sessions[path] = task.result()
            elif path in self._missing:
                failed.append(error)  # it was waited for as long as was asked
            else:
                raise error  # what no waiting mends is said at the start
        if len(failed) == len(tasks):
            raise failed[0]
        known = all(task.done() or path in self._missing for path, task in tasks.items())
        return sessions if known else {}

    async def _attach_late(self, twin: TwinSession, path: int, opening: asyncio.Task[zenoh.Session]) -> None:
        """Attach a path once it is there; a robot looks for it for ever, a command as long as it was told."""
        attached = False
        try:
            while not attached:
                try:
                    attached = await twin.attach(path, await opening)
                except (LinkError, zenoh.ZError) as error:
                    if not math.isinf(self._within_s):
                        return
                    self._missing[path] = str(error)
                    log.warning("%s: %s; trying again", self._names[path], error)
                    await asyncio.sleep(MOST_RETRY_S)
                    if opening.exception() is not None:
                        opening = self._open(path)
                    continue
                if not attached:
                    return
            log.info("%s: is open now; both paths are in use", self._names[path])
        finally:
            if not attached:
                opening.add_done_callback(close_unwanted)


def _cancel(loop: asyncio.AbstractEventLoop, tasks: list[asyncio.Task[None]]) -> None:
    """From any thread."""
    for task in tasks:
        wake(loop, _cancel_on_loop, task)


def _cancel_on_loop(task: asyncio.Task[None]) -> None:
    task.cancel()
