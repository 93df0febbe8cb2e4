"""Runs a bench in a process of its own: a cold one, of which nothing else has a part.

The parent names a function of this folder and gives it JSON arguments; the last line of output is its
result. A worker ends when its parent does: it watches its standard input for the end.
"""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from typing import Any

from common.errors import TandemError
from common.process.runtime import SWITCH_INTERVAL_S

GRACE_S = 30.0
"""Beyond what a worker was asked to take: starting Python, importing, opening sessions."""


class BenchError(TandemError):
    """A bench that failed in its process."""


def in_worker(function: str, seconds: float, **arguments: Any) -> Any:
    """The result of `module:function` of this package, called with `seconds` and the arguments elsewhere.

    Raises BenchError with the last line it said.
    """
    with _process(function, {"seconds": seconds, **arguments}) as process:
        try:
            out, err = process.communicate(timeout=seconds + GRACE_S)
        except subprocess.TimeoutExpired:
            raise BenchError(f"{function} did not end within {seconds + GRACE_S:.0f} s") from None
        if process.returncode != 0:
            said = err.strip().splitlines()
            raise BenchError(f"{function}: {said[-1] if said else f'ended with status {process.returncode}'}")
        return json.loads(out.splitlines()[-1])


@contextlib.contextmanager
def beside(function: str, **arguments: Any) -> Iterator[None]:
    """Keep `module:function` running in another process meanwhile."""
    with _process(function, arguments):
        yield


@contextlib.contextmanager
def _process(function: str, arguments: dict[str, Any]) -> Iterator[subprocess.Popen[str]]:
    # the worker reads one end of a pipe, whose other end closes with this process, however it ends
    watched, held = os.pipe()
    command = [sys.executable, "-m", __name__, function, json.dumps(arguments)]
    pipe = subprocess.PIPE
    try:
        process = subprocess.Popen(command, stdin=watched, stdout=pipe, stderr=pipe, text=True)
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
    module, name = sys.argv[1].split(":")
    result = getattr(importlib.import_module(f"deploy.experiments.bench.{module}"), name)(
        **json.loads(sys.argv[2])
    )
    print(json.dumps(result), flush=True)  # noqa: T201
    # a worker owns nothing that must be closed, and foreign threads could hold it up
    os._exit(0)


def _end_with_parent() -> None:
    sys.stdin.read()
    os._exit(1)


if __name__ == "__main__":
    main()
