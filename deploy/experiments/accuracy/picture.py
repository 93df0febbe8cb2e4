"""Errors over time as a picture: a row a recording, a line a filter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from common.quaternion import Array
from common.wire.messages import Mask
from deploy.report.output import writing

_POINTS = 1500
"""So many points a line: each is the largest of its share of samples, so that no peak is lost."""


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


def draw(panels: list[Panel], path: Path) -> None:
    """Write the PNG; at least one of the panels has curves."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    panels = [panel for panel in panels if panel.curves]
    columns = list(dict.fromkeys(part for panel in panels for part in panel.curves))
    filters = dict.fromkeys(name for panel in panels for curves in panel.curves.values() for name in curves)
    colours = {name: f"C{number}" for number, name in enumerate(filters)}
    figure = Figure(figsize=(5.0 * len(columns), 0.6 + 2.4 * len(panels)), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(len(panels), len(columns), squeeze=False)
    for row, panel in zip(grid, panels, strict=True):
        step = max(1, len(panel.movement) // _POINTS)
        time_s = np.arange(0, len(panel.movement) - step + 1, step) / panel.rate_hz
        moving = _peaks(panel.movement.astype(np.float64), step) > 0.0
        for axes, part in zip(row, columns, strict=True):
            for name, curve in panel.curves[part].items():
                axes.plot(time_s, _peaks(curve, step), colours[name], label=name, linewidth=0.8)
            if not moving.all():
                axes.fill_between(
                    time_s, 0, 1, where=moving, transform=axes.get_xaxis_transform(), alpha=0.08, color="k"
                )
            axes.set_title(f"{panel.name}: {part}, from {panel.against}", fontsize=8)
            axes.set_ylabel("°")
            axes.legend(fontsize=7)
            axes.grid(alpha=0.3)
    for axes in grid[-1]:
        axes.set_xlabel("s")
    with writing(path):
        figure.savefig(path, dpi=110, format="png")


def _peaks(values: Array, step: int) -> Array:
    """The largest of every `step` values; NaN only where all of them are."""
    count = len(values) // step
    blocks = values[: count * step].reshape(count, step)
    out: Array = np.max(np.where(np.isnan(blocks), -np.inf, blocks), axis=1)
    return np.where(np.isinf(out), np.nan, out)
