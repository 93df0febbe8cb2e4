"""What the columns of a stranger's table are: guessed from their names, with unit and node."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

from common.recording.formats.samples import ACC, GYR, MAG, QUAT, TIME
from common.recording.formats.units import known_unit

_WORDS = {
    ACC: ("acc", "accel", "accelerometer", "acceleration", "linearacceleration"),
    GYR: ("gyr", "gyro", "gyroscope", "angularvelocity", "angularrate", "omega", "rate", "turnrate"),
    MAG: ("mag", "magn", "magnetometer", "magneticfield", "magnetic"),
    QUAT: ("quat", "quaternion", "orientation", "q"),
}
_GLUED = {"a": ACC, "g": GYR, "w": GYR, "m": MAG, "q": QUAT}
"""One letter right before the axis: ax, gz, wy, mx, qw."""
_BY_WORD = {word: quantity for quantity, words in _WORDS.items() for word in words}
_TIMES = ("time", "timestamp", "t", "sampletimefine", "epoch", "datetime", "elapsed")
_NOT_MEASURED = ("free", "user", "gravity", "covariance", "bias", "temp")
"""Words of columns that look like a sensor's, but are computed or something else."""
_AXES = {**dict.fromkeys("xyz"), "w": None, "0": None, "1": None, "2": None, "3": None}
_BRACKET = re.compile(r"[(\[{]([^)\]}]*)[)\]}]")


@dataclass(frozen=True, slots=True)
class ColumnMeaning:
    """One column: of which node, which quantity and axis, in which unit."""

    column: str
    node: str
    """Lower case; empty where the name tells none."""
    quantity: str
    axis: str
    """x, y, z, w or a number from 0; empty for a time."""
    unit: str | None
    """None where the name tells none."""


def meaning(column: str) -> ColumnMeaning | None:
    """What a column's name says; None where it is neither a time nor an axis of a sensor."""
    found = _BRACKET.search(column)
    bracket = found.group(1) if found else ""
    tokens = _tokens(_BRACKET.sub(" ", column))
    if not tokens or any(word in tokens for word in _NOT_MEASURED):
        return None
    return _axis(column, tokens, bracket) or _time(column, tokens, bracket)


def _tokens(text: str) -> list[str]:
    text = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", text)
    return [token for token in re.split(r"[^0-9a-z°²^/%]+", text.lower()) if token]


def _time(column: str, tokens: list[str], bracket: str) -> ColumnMeaning | None:
    unit = known_unit(TIME, bracket)
    if len(tokens) > 1 and unit is None and (unit := known_unit(TIME, tokens[-1])) is not None:
        tokens = tokens[:-1]
    if unit is None and len(tokens) > 1 and len(tokens[0]) > 3:  # seconds_elapsed
        unit = known_unit(TIME, tokens[0])
    if tokens[-1] in _TIMES or "".join(tokens) in _TIMES or (tokens[0] in _TIMES and len(tokens) <= 2):
        return ColumnMeaning(column, "", TIME, "", unit)
    return None


def _axis(column: str, tokens: list[str], bracket: str) -> ColumnMeaning | None:
    for end in range(len(tokens), max(0, len(tokens) - 3), -1):
        read = _quantity(tokens[:end])
        if read is None:
            continue
        node, quantity, axis = read
        said = bracket or "/".join(tokens[end:])
        unit = known_unit(quantity, said) or known_unit(quantity, said.replace("/", "")) if said else None
        if tokens[end:] and unit is None and quantity != QUAT:
            continue
        return ColumnMeaning(column, "_".join(node), quantity, axis, unit or (said or None))
    return None


def _quantity(tokens: list[str]) -> tuple[list[str], str, str] | None:
    """Node, quantity and axis of words that end with the axis, alone or glued to the word before."""
    *before, last = tokens
    if last in _AXES or re.fullmatch(r"q[0-3]", last):
        axis, words = last[-1], before if last in _AXES else [*before, "q"]
    elif last[-1] in _AXES and (last[:-1] in _BY_WORD or last[:-1] in _GLUED):
        axis, words = last[-1], [*before, last[:-1]]
        if last[:-1] in _GLUED:
            return before, _GLUED[last[:-1]], axis
    else:
        return None
    for first in range(len(words)):
        for stop in range(len(words), first, -1):
            quantity = _BY_WORD.get("".join(words[first:stop]))
            if quantity is not None:
                # a component between the word and the axis (`orientation.quat.x`) says no more
                rest = [w for w in words[stop:] if w not in _BY_WORD]
                return words[:first] + rest, quantity, axis
    return None


def meanings(columns: Iterable[str]) -> list[ColumnMeaning]:
    """What all columns that tell something are, in their order."""
    return [found for column in columns if (found := meaning(column)) is not None]
