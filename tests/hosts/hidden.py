"""Run as a process: hides what only Linux has, then runs the master for a while.

`python -m tests.hosts.hidden MASTER.toml SECONDS`
"""

import asyncio
import ctypes
import importlib.abc
import multiprocessing.util  # noqa: F401  # what libraries need of it on Linux, and not elsewhere, comes first
import os
import signal
import socket
import subprocess  # noqa: F401
import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType

import can.interfaces.udp_multicast  # noqa: F401
import psutil  # noqa: F401

HIDDEN = (
    "uvloop", "fcntl", "termios", "resource", "pwd", "grp", "tty", "pty", "syslog", "spwd", "evdev", "gpiod",
    "linuxpy",
)  # fmt: skip
NAMES = {
    socket: ("AF_CAN", "CAN_RAW", "AF_NETLINK", "AF_PACKET", "SO_ATTACH_FILTER", "TCP_CONGESTION"),
    signal: ("SIGHUP", "SIGUSR1", "SIGUSR2"),
    os: ("sched_setscheduler", "sched_param", "SCHED_FIFO", "SCHED_OTHER", "sched_getaffinity", "geteuid"),
}


class _Hider(importlib.abc.MetaPathFinder):
    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if fullname.partition(".")[0] in HIDDEN:
            raise ModuleNotFoundError(f"No module named {fullname!r} (hidden)", name=fullname)
        return None


def hide() -> None:
    """From now on this process is on a system that has none of it."""
    for name in HIDDEN:
        sys.modules.pop(name, None)
    sys.meta_path.insert(0, _Hider())
    for module, names in NAMES.items():
        for name in names:
            if hasattr(module, name):
                delattr(module, name)
    library = ctypes.CDLL

    class NoLibrary(library):  # type: ignore[misc, valid-type]
        def __init__(self, name: str | None, *others: object, **more: object) -> None:
            if name is None:
                raise TypeError("LoadLibrary() argument 1 must be str, not None")
            super().__init__(name, *others, **more)

    ctypes.CDLL = NoLibrary  # type: ignore[misc]


OVERRIDES = (
    'capture.buses=[{name="suit", interface="udp_multicast", channel="239.74.163.9", fd=true, '
    "options={port=43977, hop_limit=0}}]",
    'link.connect=["tcp/127.0.0.1:1"]',
)


def _tell(metrics: object) -> None:
    print("ticks", metrics.ticks.expected)  # type: ignore[attr-defined]  # noqa: T201


async def _run(config_file: Path, seconds: float) -> None:
    from common.config.load import load_config
    from master.app import run
    from master.config import MasterConfig

    stop = asyncio.Event()
    asyncio.get_running_loop().call_later(seconds, stop.set)
    await run(load_config(config_file, MasterConfig, OVERRIDES), stop, _tell)


def main() -> None:
    """The story."""
    hide()
    import deploy.cli  # noqa: F401
    from common.process.runtime import run

    print(type(asyncio.SelectorEventLoop()).__name__)  # noqa: T201
    file, seconds = Path(sys.argv[1]), float(sys.argv[2])
    run(lambda stop: _run(file, seconds))
    print("ended in order")  # noqa: T201


if __name__ == "__main__":
    main()
