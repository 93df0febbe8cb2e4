"""`python -m master FILE` and `python -m slave FILE`: one side alone, from its TOML file."""

from __future__ import annotations

import argparse
import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path

from common.config.load import Model, load_config
from common.errors import TandemError
from common.log.handler import log_level, print_error, start_log
from common.log.streams import secure
from common.metrics.tree import WriteMetrics
from common.process.runtime import run


def launch(
    role: str, model: type[Model], side: Callable[[Model, asyncio.Event, WriteMetrics], Awaitable[None]]
) -> int:
    """Run a side until SIGINT, SIGTERM or SIGHUP; the exit status. A mistake is one clear line each."""
    parser = argparse.ArgumentParser(prog=f"python -m {role}")
    parser.add_argument("config", type=Path, help=f"TOML file, such as deploy/examples/{role}.toml")
    parser.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", dest="overrides",
        help="set one key, whatever the file says",
    )  # fmt: skip
    parser.add_argument("--debug", action="store_true", help="log everything, and show tracebacks")
    parser.add_argument("--quiet", action="store_true", help="log warnings and errors only")
    arguments = parser.parse_args()
    secure()
    try:
        start_log(log_level(debug=arguments.debug, quiet=arguments.quiet))
        config = load_config(arguments.config, model, arguments.overrides)
        run(lambda stop: side(config, stop, lambda _: None))
    except TandemError as error:
        if arguments.debug:
            raise
        print_error(role, str(error))
        return 1
    return 0
