"""Runs a function in a new process, in which nothing else happens.

The parent pickles the function, by its module and name, and its arguments; the last line of output is the
result as JSON. A worker ends when its parent does: it watches its standard input for the end.
"""

from __future__ import annotations

import contextlib
import json
import os
import pickle
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from typing import TypeVar

from common.errors import TandemError
from common.process.runtime import SWITCH_INTERVAL_S

GRACE_S = 30.0
"""Beyond what a worker was asked to take: starting Python, importing, opening sessions."""


Result = TypeVar("Result")


class BenchError(TandemError):
    """A bench that failed in its process."""


def in_worker(function: Callable[..., Result], seconds: float, **arguments: object) -> Result:
    """The result of `function(seconds, **arguments)`, called in another process.

    Raises BenchError with the last line that the process wrote.
    """
    name = function.__name__
    with _process(function, {"seconds": seconds, **arguments}) as process:
        try:
            out, err = process.communicate(timeout=seconds + GRACE_S)
        except subprocess.TimeoutExpired:
            raise BenchError(f"{name} did not end within {seconds + GRACE_S:.0f} s") from None
        if process.returncode != 0:
            lines = err.strip().splitlines()
            raise BenchError(f"{name}: {lines[-1] if lines else f'ended with status {process.returncode}'}")
        result: Result = json.loads(out.splitlines()[-1])
        return result


@contextlib.contextmanager
def beside(function: Callable[..., None], **arguments: object) -> Iterator[int]:
    """Keep a function running in another process meanwhile; gives that process's id."""
    with _process(function, arguments) as process:
        yield process.pid


def command_of(function: Callable[..., object], arguments: dict[str, object]) -> list[str]:
    """The command that runs a function in a process of its own."""
    return [sys.executable, "-m", __name__, pickle.dumps((function, arguments)).hex()]


@contextlib.contextmanager
def _process(
    function: Callable[..., object], arguments: dict[str, object]
) -> Iterator[subprocess.Popen[str]]:
    # the worker reads one end of a pipe, whose other end closes with this process, however it ends
    watched, held = os.pipe()
    pipe = subprocess.PIPE
    try:
        process = subprocess.Popen(
            command_of(function, arguments), stdin=watched, stdout=pipe, stderr=pipe, text=True
        )
        try:
            yield process
        finally:
            process.kill()
            process.communicate()
    finally:
        os.close(watched)
        os.close(held)


def main() -> None:
    """The worker's side."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    sys.setswitchinterval(SWITCH_INTERVAL_S)  # as the services have it
    # from the parent's command line, so it is trusted
    function, arguments = pickle.loads(bytes.fromhex(sys.argv[1]))
    print(json.dumps(function(**arguments)), flush=True)  # noqa: T201
    # a worker owns nothing that must be closed, and foreign threads could hold it up
    os._exit(0)


def _end_with_parent() -> None:
    sys.stdin.read()
    os._exit(1)


if __name__ == "__main__":
    main()
