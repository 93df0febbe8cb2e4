"""One row a second: what was seen of the robot, its commands and every process; in a file, not in memory."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

import numpy as np

from common.errors import TandemError
from common.quaternion import Array
from deploy.report.output import writing

SEEN = (
    "one_way_n", "one_way_p50_ms", "one_way_max_ms", "written_p50_ms", "offset_bound_ms", "age_max_ms",
    "round_trip_n", "round_trip_ms", "end_to_end_n", "end_to_end_ms",
    "sent", "arrived", "lost", "late", "repeated", "overwritten", "refused", "due", "gone",
    "master_ticks", "master_missed", "slave_ticks", "slave_missed",
    "times_lost", "states_missed", "undecodable", "strayed_deg", "host_still_ms",
    "link_lost", "link_out", "link_odd",
)  # fmt: skip
"""Columns for the whole system. A time in ms is NaN in a second without a measurement."""
OF_PROCESS = ("life", "rss_mb", "fds", "threads", "cpu_s", "in_use_mb", "blocks")
"""Columns for each process: how often it was started, and what it uses; it may publish the last two."""
FILE = "samples.csv"


def header(processes: Iterable[str]) -> list[str]:
    """The columns."""
    return ["at_s", "guard", *SEEN, *(f"{name}_{what}" for name in processes for what in OF_PROCESS)]


class SampleFile:
    """Rows as they come, each on disk at once. Raises TandemError where the disk does not take them."""

    def __init__(self, folder: Path, processes: Iterable[str]) -> None:
        self._path = folder / FILE
        with writing(self._path):
            self._file: TextIO = self._path.open("x", encoding="utf-8", newline="", buffering=1)
            self._rows = csv.DictWriter(self._file, header(processes), restval="")
            self._rows.writeheader()

    def add(self, row: Mapping[str, float | str]) -> None:
        """Write one row; a NaN is an empty cell."""
        cells = {k: _cell(v) for k, v in row.items()}
        with writing(self._path):
            self._rows.writerow(cells)

    def close(self) -> None:
        """May be called again."""
        self._file.close()


@dataclass(frozen=True, slots=True)
class Samples:
    """All rows of a soak, column by column; NaN where a cell is empty."""

    columns: dict[str, Array]

    def __len__(self) -> int:
        return len(self.at_s)

    @property
    def at_s(self) -> Array:
        """(N,) since the soak's begin."""
        return self["at_s"]

    def __getitem__(self, name: str) -> Array:
        """(N,) of one column; all NaN where the recording is of before it was kept."""
        if name not in self.columns and (name in ("due", "gone") or name.endswith(("_in_use_mb", "_blocks"))):
            return np.full(len(self), np.nan)
        return self.columns[name]

    @property
    def processes(self) -> list[str]:
        """The processes whose use was measured."""
        return [name.removesuffix("_life") for name in self.columns if name.endswith("_life")]


def read_samples(folder: Path) -> Samples:
    """The rows of a soak, also of one that was killed. Raises TandemError where there are none."""
    path = folder / FILE
    try:
        with path.open(encoding="utf-8", newline="") as file:
            rows = csv.reader(file)
            names = next(rows, [])
            # a soak that was killed may leave half a row
            table = [row for row in rows if len(row) == len(names)]
    except OSError as error:
        raise TandemError(f"{path}: cannot be read ({error.strerror}); was a soak there?") from None
    if "at_s" not in names:
        raise TandemError(f"{path}: not the samples of a soak")
    columns = {
        name: np.array([_number(row[i]) for row in table], dtype=float)
        for i, name in enumerate(names)
        if name != "guard"
    }
    return Samples(columns)


def _cell(value: float | str) -> str:
    if isinstance(value, str):
        return value
    return "" if math.isnan(value) else f"{value:.6g}" if abs(value) < 1e5 else f"{value:.1f}"


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return math.nan
