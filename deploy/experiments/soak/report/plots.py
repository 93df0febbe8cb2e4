"""A soak at a glance: latency, memory and what went wrong over time, faults as vertical lines."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from common.quaternion import Array
from deploy.experiments.soak.files.events import of_kind
from deploy.experiments.soak.files.happenings import FaultBegun
from deploy.experiments.soak.files.samples import Samples
from deploy.experiments.soak.judge.evidence import SoakEvidence
from deploy.report.plots import png

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

GAP_S = 4.0
"""A curve is not drawn through a longer silence."""
POINTS = 1500
"""At most, of a curve: longer ones are drawn as medians, and the largest of each bin above them."""
COLOURS = {
    "master": "tab:blue", "slave": "tab:orange", "suit": "tab:green", "recorder": "tab:red",
    "router": "tab:brown", "soak": "tab:gray",
}  # fmt: skip
FAULT_COLOURS = (
    "#c0392b",
    "#8e44ad",
    "#2980b9",
    "#16a085",
    "#f39c12",
    "#7f8c8d",
    "#d35400",
    "#2c3e50",
    "#e84393",
    "#6c5ce7",
)


def draw(seen: SoakEvidence) -> bytes:
    """A PNG of the whole soak."""
    return png(lambda figure: _draw(figure, seen), 13.0, 15.0, dpi=100)


def _draw(figure: Figure, seen: SoakEvidence) -> None:
    samples = seen.samples
    unit_s, unit = (3600.0, "h") if len(samples) > 7200 else (60.0, "min")
    panels = figure.subplots(5, 1, sharex=True, height_ratios=(3, 2, 3, 2, 2))
    _latency(panels[0], samples, unit_s)
    _wrong(panels[1], samples, unit_s)
    _of_processes(panels[2], samples, "rss_mb", "resident memory, MB", unit_s)
    _of_processes(panels[3], samples, "fds", "descriptors", unit_s)
    _of_processes(panels[4], samples, "threads", "threads", unit_s)
    _faults(list(panels), seen, unit_s)
    panels[-1].set_xlabel(f"time since the soak began, {unit}")
    panels[-1].set_xlim(0.0, max(1.0, float(samples.at_s[-1]) if len(samples) else 1.0) / unit_s)


def with_gaps(at: Array, values: Array, gap: float) -> tuple[Array, Array]:
    """A series (N,) without its missing values, but for one NaN where more than `gap` is missing."""
    good = np.isfinite(values)
    at, values = at[good], values[good]
    breaks = np.flatnonzero(np.diff(at) > gap) + 1
    return np.insert(at, breaks, at[breaks - 1]), np.insert(values, breaks, np.nan)


def decimated(at: Array, values: Array, points: int = POINTS) -> tuple[Array, Array, Array]:
    """Bins' middles, medians and maxima of a series (N,), NaN left out; itself where it is short."""
    if len(at) <= points:
        return at, values, values
    good = np.isfinite(values)
    at, values = at[good], values[good]
    edges = np.linspace(0, len(at), points + 1).astype(int)
    bins = list(pairwise(edges))
    middles = np.array([at[i:j].mean() for i, j in bins])
    medians = np.array([np.median(values[i:j]) for i, j in bins])
    return middles, medians, np.array([values[i:j].max() for i, j in bins])


def _latency(panel: Axes, samples: Samples, unit_s: float) -> None:
    for column, words, colour in (
        ("one_way_p50_ms", "one way, median of a second", "tab:blue"),
        ("round_trip_ms", "round trip, mean", "tab:green"),
        ("written_p50_ms", "put → servo written, median of a second", "tab:purple"),
        ("end_to_end_ms", "sampled → encoder moved, mean", "tab:orange"),
    ):
        at, medians, most = decimated(*with_gaps(samples.at_s / unit_s, samples[column], GAP_S / unit_s))
        panel.plot(at, medians, color=colour, linewidth=0.9, label=words)
        if most is not medians:
            panel.plot(at, most, color=colour, linewidth=0.4, alpha=0.4)
    panel.set_yscale("log")
    panel.set_ylabel("latency, ms")


def _wrong(panel: Axes, samples: Samples, unit_s: float) -> None:
    for column, words, marker in (
        ("lost", "commands lost", "x"), ("late", "out of order", "+"),
        ("link_lost", "packets lost by the network", "2"), ("refused", "refused", "1"),
        ("master_missed", "ticks missed, master", "."), ("slave_missed", "ticks missed, slave", "."),
        ("host_still_ms", "host stall, ms", "|"),
    ):  # fmt: skip
        some = np.nan_to_num(samples[column]) > 0.0
        if some.any():
            panel.plot(samples.at_s[some] / unit_s, samples[column][some], marker, label=words, alpha=0.8)
    panel.set_yscale("log")
    panel.set_ylim(bottom=0.5)
    panel.set_ylabel("in a second")


def _of_processes(panel: Axes, samples: Samples, what: str, words: str, unit_s: float) -> None:
    for name in samples.processes:
        lives, values = samples[f"{name}_life"], samples[f"{name}_{what}"]
        for life in np.unique(lives[np.isfinite(lives)]):
            mine = lives == life
            at, medians, _ = decimated(samples.at_s[mine] / unit_s, values[mine])
            colour = COLOURS.get(name, "black")
            panel.plot(at, medians, color=colour, linewidth=1.1, label=name if life == 1 else None)
    panel.set_ylabel(words)


def _faults(panels: list[Axes], seen: SoakEvidence, unit_s: float) -> None:
    faults = of_kind(seen.events, FaultBegun)
    names = sorted({event.what.fault for event in faults})
    colours = {name: FAULT_COLOURS[i % len(FAULT_COLOURS)] for i, name in enumerate(names)}
    for panel in panels:
        handles, labels = panel.get_legend_handles_labels()
        if handles:
            panel.legend(handles, labels, loc="upper left", bbox_to_anchor=(1.0, 1.0))
        for event in faults:
            colour = colours[event.what.fault]
            panel.axvline(event.at_s / unit_s, color=colour, linewidth=0.8, alpha=0.7)
    for window in seen.explained.faults:
        until_s = min(window.until_s, float(seen.samples.at_s[-1]) if len(seen.samples) else window.from_s)
        panels[0].axvspan(window.from_s / unit_s, until_s / unit_s, color="0.5", alpha=0.08, linewidth=0)
    for i, name in enumerate(names):
        panels[0].text(
            0.005 + 0.11 * (i % 9), 1.02 + 0.05 * (i // 9), name, color=colours[name], fontsize=8,
            transform=panels[0].transAxes,
        )  # fmt: skip
