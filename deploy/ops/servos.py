"""`tandem servos`: what servos on a serial bus keep without power, and what they must; see --write."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text

from common.config.load import load_config
from common.errors import TandemError
from deploy.report.options import Overrides

if TYPE_CHECKING:
    from slave.servos.dynamixel.setup import Looked, SetUp


def servos(
    config: Annotated[
        Path,
        typer.Argument(help="The slave's TOML file; its section [servos.dynamixel] describes the servos."),
    ],
    set_: Overrides = None,
    write: Annotated[
        bool, typer.Option("--write", help="Write the settings that differ to the servos' permanent memory.")
    ] = False,
) -> None:
    """Check every servo on a serial bus: whether it answers, how fast, and its permanent settings.

    Without --write no permanent setting is changed. With --write they are changed, but only if every
    servo is usable. It ends with status 1 if the slave would not start.

    Example: `tandem servos slave.toml --write`
    """
    from slave.config import SlaveConfig
    from slave.servos.dynamixel.config import DynamixelConfig
    from slave.servos.dynamixel.latency import too_late
    from slave.servos.dynamixel.setup import set_up

    checked = load_config(config, SlaveConfig, list(set_ or ()))
    bus = checked.servos.used(DynamixelConfig)
    if bus is None:
        used = ", ".join(checked.servos.names)
        raise TandemError(f'{config}: its servo backend is "{used}": expected "dynamixel"')
    share = checked.servos.share(DynamixelConfig, checked.skeleton, checked.encoders)
    found = set_up(bus, share.skeleton, share.encoders, write)
    Console().print(as_table(found))
    late = too_late(bus.port, found.quickest_s, bus.reply_timeout_s)
    trouble = [in_words(looked) for looked in found.servos if looked.wrong]
    left = sum(bool(looked.different) and not looked.written for looked in found.servos)
    if left and not trouble:
        trouble.append(f"{left} servos keep what must be replaced: once more with --write")
    trouble += [late] if late else []
    if trouble:
        raise TandemError("; ".join(trouble))


def as_table(found: SetUp) -> Table:
    """One row a servo."""
    table = Table("joint", "id", "found", title=f"quickest answer {1e3 * found.quickest_s:.1f} ms")
    for looked in found.servos:
        differences = [difference.words for difference in looked.different]
        if looked.written:
            differences = [
                f"{words.partition(', must')[0].replace(' is ', ' was ')}, is {d.wanted} now"
                for words, d in zip(differences, looked.different, strict=True)
            ]
        words = "\n".join([*differences, *([looked.wrong] if looked.wrong else [])]) or "as it must be"
        table.add_row(looked.servo.joint, str(looked.servo.id), Text(words))
    return table


def in_words(looked: Looked) -> str:
    """A servo that cannot be used."""
    return f"{looked.servo.joint} (id {looked.servo.id}): {looked.wrong}"
