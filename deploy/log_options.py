"""`--debug` and `--quiet`: before the command's name or after it, the same for every command."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import Annotated, get_type_hints

import typer

from common.log.handler import log_level, start_log

Debug = Annotated[
    bool,
    typer.Option("--debug", help="Log everything, and show the traceback of an error."),
]
Quiet = Annotated[bool, typer.Option("--quiet", help="Log warnings and errors only.")]

_given: set[str] = set()
"""Which of the two this process was started with."""


def add_log_options(app: typer.Typer) -> None:
    """Let every command of the app and of its groups take the options."""
    for command in app.registered_commands:
        if command.callback is not None:
            command.callback = _logged(command.callback)
    for group in app.registered_groups:
        if group.typer_instance is not None:
            own = group.typer_instance.registered_callback
            # a group that is a command too, such as `tandem bench`
            if own is not None and own.callback is not None and own.invoke_without_command is True:
                own.callback = _logged(own.callback)
            add_log_options(group.typer_instance)


def start_chosen_log(*, debug: bool, quiet: bool) -> None:
    """Start the log as the options before the command's name ask for."""
    _given.clear()
    _add(debug=debug, quiet=quiet)


def debugging() -> bool:
    """Whether `--debug` was given."""
    return _given == {"debug"}


def _logged(command: Callable[..., object]) -> Callable[..., object]:
    """The command with two options more. typer reads them from the signature."""

    @functools.wraps(command)
    def run(*arguments: object, debug: bool, quiet: bool, **options: object) -> object:
        _add(debug=debug, quiet=quiet)
        return command(*arguments, **options)

    hints = {**get_type_hints(command, include_extras=True), "debug": Debug, "quiet": Quiet}
    parameters = [
        *(p.replace(annotation=hints[p.name]) for p in inspect.signature(command).parameters.values()),
        *(
            inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=False, annotation=hints[name])
            for name in ("debug", "quiet")
        ),
    ]
    run.__annotations__ = hints
    run.__dict__["__signature__"] = inspect.Signature(parameters)
    del run.__dict__["__wrapped__"]
    return run


def _add(**options: bool) -> None:
    _given.update(name for name, given in options.items() if given)
    start_log(log_level(debug="debug" in _given, quiet="quiet" in _given))
