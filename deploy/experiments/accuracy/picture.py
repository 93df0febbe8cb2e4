"""A plot of errors over time: a row for each recording, a line for each filter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from common.quaternion import Array
from common.wire.messages import Mask
from deploy.report.plots import colour, save_png

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_POINTS = 1500
"""Points for each line. A point is the largest of its samples, so that no peak is lost."""


@dataclass(frozen=True, slots=True)
class Panel:
    """One recording's curves."""

    name: str
    against: str
    """What the curves are errors from."""
    rate_hz: float
    movement: Mask
    """(T,) shaded."""
    curves: Mapping[str, Mapping[str, Array]]
    """Total, heading or inclination ▸ filter ▸ (T,) °."""


def draw(panels: Sequence[Panel], path: Path) -> None:
    """Write the PNG; at least one of the panels has curves."""
    panels = [panel for panel in panels if panel.curves]
    columns = list(dict.fromkeys(part for panel in panels for part in panel.curves))
    filters = dict.fromkeys(name for panel in panels for curves in panel.curves.values() for name in curves)
    colours = {name: colour(number) for number, name in enumerate(filters)}

    def draw_all(figure: Figure) -> None:
        grid = figure.subplots(len(panels), len(columns), squeeze=False)
        for row, panel in zip(grid, panels, strict=True):
            for axes, part in zip(row, columns, strict=True):
                _draw(axes, panel, part, colours)
        for axes in grid[-1]:
            axes.set_xlabel("s")

    save_png(path, draw_all, 5.0 * len(columns), 0.6 + 2.4 * len(panels))


def _draw(axes: Axes, panel: Panel, part: str, colours: Mapping[str, str]) -> None:
    """One part of the error of one recording."""
    step = max(1, len(panel.movement) // _POINTS)
    time_s = np.arange(0, len(panel.movement) - step + 1, step) / panel.rate_hz
    moving = _peaks(panel.movement.astype(np.float64), step) > 0.0
    for name, curve in panel.curves[part].items():
        axes.plot(time_s, _peaks(curve, step), colours[name], label=name, linewidth=0.8)
    if not moving.all():
        axes.fill_between(
            time_s, 0, 1, where=moving.tolist(), transform=axes.get_xaxis_transform(), alpha=0.08, color="k"
        )
    axes.set_title(f"{panel.name}: {part}, from {panel.against}")
    axes.set_ylabel("°")
    axes.legend()


def _peaks(values: Array, step: int) -> Array:
    """The largest of every `step` values; NaN only where all of them are."""
    count = len(values) // step
    blocks = values[: count * step].reshape(count, step)
    out: Array = np.max(np.where(np.isnan(blocks), -np.inf, blocks), axis=1)
    return np.where(np.isinf(out), np.nan, out)
