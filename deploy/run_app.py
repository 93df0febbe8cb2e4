"""Runs a command line, and turns errors into one line and a status."""

from __future__ import annotations

import sys
from collections.abc import Callable

import typer

from common.errors import TandemError
from common.log.handler import describe_exception, flush_log, print_error
from common.log.streams import lost_output, secure
from common.process.extras import missing_extra
from deploy.log_options import debugging

EXIT_FAULT = 70
"""Status after a fault that no person caused (`EX_SOFTWARE`)."""
EXIT_OUTPUT = 74
"""Status of a report that could not be written (`EX_IOERR`); an act that was done keeps its own status."""


def run_app(app: typer.Typer, acted: Callable[[], bool] = lambda: False) -> None:
    """Run and exit: errors a person can cause are one clear line each, and status 1.

    `acted`: whether something was done at a robot, which a report that is lost does not undo.
    """
    secure()
    status = _run(app)
    flush_log()
    if status == 0 and not acted() and (why := lost_output()) is not None:
        print_error("tandem", f"not all of the output could be written: {why}")
        status = EXIT_OUTPUT
    sys.exit(status)


def _run(app: typer.Typer) -> int:
    """The status: 1 for what a person can mend, EXIT_FAULT for a fault of tandem itself."""
    try:
        app()
    except SystemExit as done:
        return done.code if isinstance(done.code, int) else int(done.code is not None)
    except TandemError as error:
        if debugging():
            raise
        print_error("tandem", str(error))
        return 1
    except Exception as error:
        if debugging():
            raise
        if isinstance(error, ModuleNotFoundError) and (missing := missing_extra(error)):
            print_error("tandem", missing)
            return 1
        fault = f"a fault of tandem itself: {describe_exception(error)}; with --debug it shows the traceback"
        print_error("tandem", fault)
        return EXIT_FAULT
    return 0
