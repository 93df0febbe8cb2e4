"""Tables of numbers (.csv, .txt, .tsv) of any logger, by a map of its columns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from common.errors import RecordingError
from common.quaternion import Array
from common.recording.formats.columns import ColumnMeaning, meanings
from common.recording.formats.samples import (
    ACC,
    GYR,
    MOVEMENT,
    QUAT,
    TIME,
    WIDTHS,
    ReadFile,
    ReadOptions,
    SensorSeries,
    UnitSamples,
)
from common.recording.formats.text_table import TextTable, read_table
from common.recording.formats.units import SI, factor, known_unit

_ORDER = {3: ("xyz", "012", "123"), 4: ("wxyz", "0123"), 1: ("",)}
_RATES_HZ = (5.0, 20_000.0)
"""Of a time column without a unit: the first of s, ms, µs and ns that makes the rate lie between is taken."""
_UNITS_OF_TIME = ("s", "ms", "us", "ns")
Assigned = dict[tuple[str, str], tuple[tuple[str, ...], str | None]]
"""By node and quantity: the columns in the order of the axes, and the unit that their names tell."""


def read_csv(path: Path, options: ReadOptions) -> ReadFile:
    """The units of a table. Raises RecordingError where its columns cannot be told apart."""
    return of_table(path, read_table(path), options, path.stem)


def of_table(path: Path, table: TextTable, options: ReadOptions, name: str) -> ReadFile:
    """The units of a table that has been read; `name` is of a unit that its columns do not name."""
    found = meanings(table.names)
    assigned = _assigned(str(path), found)
    _override(str(path), assigned, options.columns, table.names)
    if not assigned:
        raise RecordingError(
            f"{path}: none of the columns {', '.join(table.names[:8])} … is a sensor's by its name; give "
            "them, as --columns acc=A,B,C --columns gyr=D,E,F --columns time=T"
        )
    notes = list(table.notes)
    time_s, stamps = _times(str(path), table, found, options, notes)
    units: dict[str, dict[str, SensorSeries]] = {}
    assumed: dict[str, set[str]] = {}
    for (node, quantity), (columns, unit) in assigned.items():
        values = np.stack([table.column(column) for column in columns], axis=-1)
        values = values * _scale(str(path), (node or name, quantity), (columns, unit), options, notes)
        units.setdefault(node or name, {})[quantity] = SensorSeries(values, time_s, stamps)
        if quantity in SI and unit is None and quantity not in options.units:
            assumed.setdefault(node or name, set()).add(quantity)
    read = tuple(
        UnitSamples(unit, series, options.rate_hz, assumed=frozenset(assumed.get(unit, ())))
        for unit, series in units.items()
    )
    return ReadFile(read, tuple(notes))


def _assigned(where: str, found: Sequence[ColumnMeaning]) -> Assigned:
    axes: dict[tuple[str, str], dict[str, ColumnMeaning]] = {}
    for one in found:
        if one.quantity != TIME:
            axes.setdefault((one.node, one.quantity), {}).setdefault(one.axis, one)
    out: Assigned = {}
    for key, by_axis in axes.items():
        for order in _ORDER[WIDTHS[key[1]]]:
            if all(axis in by_axis for axis in order):
                chosen = [by_axis[axis] for axis in order]
                units = {one.unit for one in chosen}
                if len(units) > 1:
                    raise RecordingError(f"{where}: the columns of {key[1]} tell different units: {units}")
                out[key] = (tuple(one.column for one in chosen), chosen[0].unit)
                break
    return out


def _override(
    where: str, assigned: Assigned, columns: Mapping[str, tuple[str, ...]], names: Sequence[str]
) -> None:
    for key, chosen in columns.items():
        node, _, quantity = key.rpartition(".")
        if quantity == TIME:
            continue
        if quantity not in WIDTHS:
            raise RecordingError(f"--columns {key}: expected one of {', '.join(WIDTHS)}, {TIME}")
        if len(chosen) != WIDTHS[quantity]:
            raise RecordingError(f"--columns {key}: expected {WIDTHS[quantity]} columns, not {len(chosen)}")
        for column in chosen:
            if column not in names:
                raise RecordingError(f"{where}: has no column {column!r}; it has {', '.join(names)}")
        assigned[node, quantity] = (chosen, None)


def _scale(
    where: str,
    key: tuple[str, str],
    columns: tuple[tuple[str, ...], str | None],
    options: ReadOptions,
    notes: list[str],
) -> float:
    """What the numbers are multiplied by; tells the columns, and a unit that was converted or assumed."""
    node, quantity = key
    names, told = columns
    what = f"{where}: {node}: {quantity} is {', '.join(names)}"
    if quantity in (QUAT, MOVEMENT):
        notes.append(what)
        return 1.0
    asked = options.units.get(quantity)
    unit = asked or told
    if unit is None:
        notes.append(f"{what}, taken as {SI[quantity]} (its name tells no unit)")
        return 1.0
    scale = factor(f"{where}: {', '.join(names)}", quantity, unit)
    notes.append(f"{what}, in {unit}" + ("" if scale == 1.0 else f", converted to {SI[quantity]}"))
    return scale


def _times(
    where: str,
    table: TextTable,
    found: Sequence[ColumnMeaning],
    options: ReadOptions,
    notes: list[str],
) -> tuple[Array | None, str]:
    """Stamps (T,), s, and the name of their column; None where a rate was given, or has to be."""
    chosen = next((c for key, c in options.columns.items() if key == TIME), None)
    if options.rate_hz is not None and chosen is None:
        return None, "time"
    times = [one for one in found if one.quantity == TIME]
    if chosen is not None:
        column, unit = chosen[0], None
        if column not in table.names:
            raise RecordingError(f"{where}: has no column {column!r}; it has {', '.join(table.names)}")
    elif times:
        # of several, the one that tells its unit
        best = min(times, key=lambda one: one.unit is None)
        column, unit = best.column, best.unit
    else:
        raise RecordingError(f"{where}: has no column of times; give one (--columns time=NAME) or --rate HZ")
    values = table.column(column)
    unit = options.units.get(TIME) or unit
    if unit is None:
        unit = _unit_of_time(where, column, values)
        notes.append(f"{where}: times are {column}, taken as {unit} by their steps (its name tells no unit)")
    else:
        notes.append(f"{where}: times are {column}, in {unit}")
    scale = factor(f"{where}: {column}", TIME, unit)
    return values * scale, column


def _unit_of_time(where: str, column: str, values: Array) -> str:
    steps = np.diff(values[np.isfinite(values)])
    step = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
    for unit in _UNITS_OF_TIME:
        if step > 0.0 and _RATES_HZ[0] <= 1.0 / (step * factor(where, TIME, unit)) <= _RATES_HZ[1]:
            return unit
    raise RecordingError(
        f"{where}: {column} steps by {step:g}, no usual unit of time; name it, as --units time=ms"
    )


def parse_units(items: Sequence[str]) -> dict[str, str]:
    """`acc=g,gyr=deg/s` as a table. Raises RecordingError."""
    out = {}
    for item in (part for text in items for part in text.split(",")):
        quantity, _, unit = (word.strip() for word in item.partition("="))
        if quantity not in SI or known_unit(quantity, unit) is None:
            raise RecordingError(
                f"--units {item}: expected a quantity and its unit, such as {ACC}=g or {GYR}=deg/s"
            )
        out[quantity] = unit
    return out
