"""`python -m master FILE` and `python -m slave FILE`: one side alone, from its TOML file."""

from __future__ import annotations

import argparse
import asyncio
import logging
import sys
from collections.abc import Awaitable, Callable
from pathlib import Path

from common.config.load import Model, load_config
from common.errors import TandemError
from common.process.logs import flush_log, start_log
from common.process.runtime import run
from common.process.streams import secure

WriteFigures = Callable[[dict[str, object]], None]
"""What a side hands its counters to when it stops."""


def launch(
    role: str, model: type[Model], side: Callable[[Model, asyncio.Event, WriteFigures], Awaitable[None]]
) -> int:
    """Run a side until SIGINT, SIGTERM or SIGHUP; the exit status. A mistake is one clear line each."""
    parser = argparse.ArgumentParser(prog=f"python -m {role}")
    parser.add_argument("config", type=Path, help=f"TOML file, such as deploy/examples/{role}.toml")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", dest="overrides")
    arguments = parser.parse_args()
    secure()
    start_log(logging.INFO)
    try:
        config = load_config(arguments.config, model, arguments.overrides)
        run(lambda stop: side(config, stop, lambda _: None))
    except TandemError as error:
        flush_log()
        for line in str(error).splitlines():
            sys.stderr.write(f"{role}: {line}\n")
        return 1
    return 0
