"""Which line of which GPIO chip a name means. Pure.

Chips are numbered in the order in which the kernel finds them, and a USB chip gets another number each time
it is plugged in; so lines are found by their names, and chips by their labels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

CONSUMER = "tandem e-stop"
"""What the kernel says of a line that the slave reads."""


@dataclass(frozen=True, slots=True)
class GpioChip:
    """One chip that this user may read."""

    path: str
    label: str
    lines: tuple[str, ...]
    """The lines' names by number; empty where a line has none."""


def find_line(
    chips: Sequence[GpioChip], line: str, chip: str, unreadable: Sequence[str] = ()
) -> tuple[str, int]:
    """Path of the chip and number of the line. Raises LookupError saying what was found instead.

    `chip`: label or path; empty: any. `unreadable`: paths of chips that this user may not open.
    """
    among = [one for one in chips if not chip or chip in (one.label, one.path)]
    found = [
        (one.path, number)
        for one in among
        for number, name in enumerate(one.lines)
        if (name == line if not line.isdecimal() else number == int(line))
    ]
    if len(found) == 1:
        return found[0]
    if found:
        places = ", ".join(f"line {number} of {path}" for path, number in found)
        raise LookupError(f"{len(found)} lines are meant: {places}; give `chip` a label or path that one has")
    if unreadable:
        raise LookupError(
            f"this user may not read {', '.join(unreadable)}: a udev rule gives it to a group, "
            "see 70-tandem.rules"
        )
    if not among:
        there = ", ".join(f"{one.label} ({one.path})" for one in chips) or "none"
        raise LookupError(f"no GPIO chip {chip} is there".replace("  ", " ") + f"; this host has {there}")
    raise LookupError(f"no line {line} is there; `gpioinfo` lists them")
