"""Work spread over processes that end with this one, however it ends."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from multiprocessing.connection import wait as wait_for
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from multiprocessing.sharedctypes import Synchronized

MOST_JOBS = 4
"""A process holds some 150 MB."""
_HEAR_S = 0.2

Item = TypeVar("Item")
Result = TypeVar("Result")
OnProgress = Callable[[int], object]
"""Takes how much was done since the last call."""


def jobs_here() -> int:
    """One process a core, but not too many."""
    return min(os.cpu_count() or 1, MOST_JOBS)


def run_each(
    call: Callable[[Item, OnProgress], Result],
    items: Sequence[Item],
    jobs: int,
    on_progress: OnProgress = lambda _: None,
) -> Iterator[tuple[Item, Result]]:
    """`call(item, tell)` of every item, as they finish; `tell` passes progress on to `on_progress` here.

    One job works in this process; of more, `call`, items and results travel between processes. The first
    error of a call ends all of it and passes through.
    """
    if jobs == 1 or len(items) <= 1:
        for item in items:
            yield item, call(item, on_progress)
        return
    others = set(multiprocessing.active_children())
    # spawn: a fork would copy this process's threads' locks
    context = multiprocessing.get_context("spawn")
    counter: Synchronized[int] = context.Value("q", 0)
    pool = ProcessPoolExecutor(min(jobs, len(items)), context, _begin, (counter,))
    try:
        open_ = {pool.submit(_call, call, item): item for item in items}
        heard = 0
        while open_:
            done, _ = wait(open_, _HEAR_S, FIRST_COMPLETED)
            now = counter.value
            on_progress(now - heard)
            heard = now
            for future in done:
                yield open_.pop(future), future.result()
    except BaseException:  # Ctrl-C too: it does not wait for the calls that run
        for child in set(multiprocessing.active_children()) - others:
            child.terminate()
        raise
    finally:
        # waits until the pool's own thread has seen every process end
        pool.shutdown(cancel_futures=True)


_counter: Synchronized[int] | None = None
"""In a worker process: how much all of them have done."""


def _begin(counter: Synchronized[int]) -> None:
    """Prepare a new process: the first process handles Ctrl-C, and this one ends with it."""
    global _counter
    _counter = counter
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    assert parent is not None

    def watch() -> None:
        wait_for([parent.sentinel])
        os._exit(1)

    threading.Thread(target=watch, name="parent-watch", daemon=True).start()


def _call(call: Callable[[Item, OnProgress], Result], item: Item) -> Result:
    return call(item, _report)


def _report(count: int) -> None:
    assert _counter is not None
    with _counter.get_lock():
        _counter.value += count
