"""A process's life: run until a signal comes, then end within one deadline, whatever hangs."""

from __future__ import annotations

import asyncio
import logging
import os
import signal
import sys
import threading
from collections.abc import Awaitable, Callable, Coroutine
from contextlib import suppress
from types import FrameType

from common.log.handler import in_journal, with_priority
from common.process.heap import freeze_heap, use_one_arena

SHUTDOWN_S = 3.0
EXIT_HUNG = 70
"""Status of a process that did not end in time (`EX_SOFTWARE`)."""
SWITCH_INTERVAL_S = 0.0005
"""How long a Python thread may keep the interpreter: 5 ms, the default, delays the loop by as much."""


def new_event_loop() -> asyncio.AbstractEventLoop:
    """uvloop's; where there is none (Windows), the one of asyncio that can watch a CAN bus's socket."""
    try:
        import uvloop
    except ModuleNotFoundError:
        return asyncio.SelectorEventLoop()
    loop: asyncio.AbstractEventLoop = uvloop.new_event_loop()
    return loop


def run(
    main: Callable[[asyncio.Event], Awaitable[None]],
    shutdown_s: float = SHUTDOWN_S,
    hangup_stops: bool = True,
) -> None:
    """Run `main(stop)` under uvloop until it returns; whatever it raises passes through.

    SIGTERM, SIGINT and SIGHUP set `stop`. SIGINT and SIGHUP that the process inherited as ignored stay
    ignored: nohup ignores SIGHUP, and a shell script ignores SIGINT for what it starts with `&`, so that a
    Ctrl-C meant for the script does not stop a robot beside it. SIGTERM always works. `hangup_stops` false:
    SIGHUP changes nothing. After a signal, or after the end of `main`, all must be over within `shutdown_s`;
    else the process says what hangs and exits with EXIT_HUNG. A second signal ends it at once with
    128 + signal, except SIGHUP: a terminal that closes sends several. For the main thread only.
    """
    shutdown = _Shutdown(shutdown_s)
    sys.setswitchinterval(SWITCH_INTERVAL_S)
    use_one_arena()
    freeze_heap()
    on_hangup = shutdown.on_hangup if hangup_stops else signal.SIG_IGN
    handlers = {signal.SIGTERM: signal.signal(signal.SIGTERM, shutdown.on_signal)}
    hangup = getattr(signal, "SIGHUP", None)  # Windows has none
    others = [(signal.SIGINT, shutdown.on_signal), *([] if hangup is None else [(hangup, on_hangup)])]
    for number, handler in others:
        if signal.getsignal(number) is not signal.SIG_IGN:
            handlers[number] = signal.signal(number, handler)
    try:
        with asyncio.Runner(loop_factory=new_event_loop) as runner:
            shutdown.loop = runner.get_loop()
            runner.run(_main(main, shutdown))
        # leaving the runner waits for its tasks and threads: within the deadline too
    finally:
        shutdown.over.set()
        for number, before in handlers.items():
            signal.signal(number, before)


async def until_stopped(stop: asyncio.Event, work: Coroutine[object, object, None]) -> None:
    """Run `work` until it ends or `stop` is set, then cancel it and wait for it. Its errors pass through."""
    running = asyncio.create_task(work)
    stopping = asyncio.create_task(stop.wait())
    await asyncio.wait({running, stopping}, return_when=asyncio.FIRST_COMPLETED)
    running.cancel()
    stopping.cancel()
    with suppress(asyncio.CancelledError):
        await running


async def _main(main: Callable[[asyncio.Event], Awaitable[None]], shutdown: _Shutdown) -> None:
    if shutdown.signalled:  # before there was a loop
        shutdown.stop.set()
    try:
        await main(shutdown.stop)
    finally:
        shutdown.begin()


class _Shutdown:
    """The stop event, and a watch in its own thread, so that a loop that hangs cannot hold it up."""

    def __init__(self, shutdown_s: float) -> None:
        self.stop = asyncio.Event()
        self.over = threading.Event()
        self.loop: asyncio.AbstractEventLoop | None = None
        self._shutdown_s = shutdown_s
        self._signals = 0
        self._hung_up = False
        self._begun = False

    @property
    def signalled(self) -> bool:
        """Whether a signal has come."""
        return self._signals > 0 or self._hung_up

    def on_signal(self, number: int, _: FrameType | None) -> None:
        """Runs between two bytecodes of the main thread, so also when the loop is stuck in one callback."""
        self._signals += 1
        if self._signals > 1:
            self._end(128 + number, "second signal")
        self._stop()

    def on_hangup(self, _: int, __: FrameType | None) -> None:
        """As on_signal, but it ends nothing hard: shell, terminal and manager may each send one."""
        self._hung_up = True
        self._stop()

    def _stop(self) -> None:
        self.begin()
        if self.loop is not None and not self.loop.is_closed():
            self.loop.call_soon_threadsafe(self.stop.set)

    def begin(self) -> None:
        """Start the deadline, once."""
        if not self._begun:
            self._begun = True
            threading.Thread(target=self._watch, name="shutdown-watch", daemon=True).start()

    def _watch(self) -> None:
        if not self.over.wait(self._shutdown_s):
            self._end(EXIT_HUNG, f"not over within {self._shutdown_s:g} s")

    def _end(self, status: int, why: str) -> None:
        # straight to the descriptor: a lock of logging or stderr may be what hangs
        text = "\n  ".join([f"ended by force ({why}); still running:", *self._hanging()])
        if in_journal():
            text = with_priority(text, logging.CRITICAL)
        with suppress(OSError):  # standard error may be closed: the process ends all the same
            os.write(2, f"{text}\n".encode("utf-8", "replace"))
        os._exit(status)

    def _hanging(self) -> list[str]:
        tasks = asyncio.all_tasks(self.loop) if self.loop is not None else set()
        lines = [f"task {task.get_name()} in {_chain(task.get_coro())}" for task in tasks]
        frames_now = sys._current_frames()
        for thread in threading.enumerate():
            frame = frames_now.get(thread.ident or 0)
            if frame is not None and thread is not threading.current_thread():
                lines.append(f"thread {thread.name} in {_place(frame)}")
        return lines


def _chain(awaited: object) -> str:
    """Where a coroutine waits: the chain of what awaits what, and the place of the last."""
    names, place = [], ""
    while (frame := getattr(awaited, "cr_frame", None)) is not None:
        names.append(frame.f_code.co_name)
        place = f" ({frame.f_code.co_filename}:{frame.f_lineno})"
        awaited = getattr(awaited, "cr_await", None)
    return " → ".join(names) + place


def _place(frame: FrameType) -> str:
    return f"{frame.f_code.co_name} ({frame.f_code.co_filename}:{frame.f_lineno})"
