"""Calibrations as pictures: before beside after."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from common.quaternion import Array
from deploy.report.plots import save_png
from master.calibrate.inertial import InertialCalibration
from master.calibrate.magnetic import MagneticCalibration

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_POINTS = 3000


def draw_inertial(found: InertialCalibration, path: Path) -> None:
    """Write the PNG: strength of gravity at each rest, and where gravity arrives after each move."""

    def draw(figure: Figure) -> None:
        grid = figure.subplots(2, 2, squeeze=False)
        a, g = found.accelerometer, found.gyroscope
        rests, moves = np.arange(1.0, len(found.still) + 1), np.arange(1.0, len(g.errors_rad) + 1)
        _bars(grid[0, 0], rests, found.acc_before_m_s2, "accelerometer before", "‖a‖ - g, m/s²")
        _bars(grid[0, 1], rests, a.residuals_m_s2, "after", "‖a‖ - g, m/s²")
        grid[0, 1].plot(rests, a.hold_out_m_s2, "k.", markersize=4, label="held out")
        grid[0, 1].legend()
        _bars(grid[1, 0], moves, np.degrees(found.gyr_before_rad), "gyroscope before", "gravity's error, °")
        _bars(grid[1, 1], moves, np.degrees(g.errors_rad), "after", "gravity's error, °")
        grid[1, 1].plot(moves, np.degrees(g.hold_out_rad), "k.", markersize=4, label="held out")
        grid[1, 1].legend()
        for axes, of in ((grid[0], "rest"), (grid[1], "move")):
            for one in axes:
                one.set_xlabel(of)
        figure.suptitle(found.name)

    save_png(path, draw, 10.0, 6.0)


def draw_magnetic(found: MagneticCalibration, path: Path) -> None:
    """Write the PNG: three views of the readings and of the sphere they become, and the strength's spread."""

    def draw(figure: Figure) -> None:
        grid = figure.subplots(2, 4, squeeze=False)
        step = max(1, len(found.readings_ut) // _POINTS)
        raw = found.readings_ut[::step]
        after = (raw - found.fit.centre) @ found.fit.shape
        strengths = np.linalg.norm(np.concatenate([raw, after]), axis=1)
        margin = 0.01 * found.fit.field_ut
        bins = np.linspace(strengths.min() - margin, strengths.max() + margin, 80)
        turn = np.linspace(0.0, 2.0 * np.pi, 200)
        sphere = found.fit.field_ut * np.cos(turn), found.fit.field_ut * np.sin(turn)
        for row, points, title in ((grid[0], raw, "before"), (grid[1], after, "after")):
            for axes, (i, j) in zip(row, ((0, 1), (0, 2), (1, 2)), strict=False):
                axes.plot(points[:, i], points[:, j], ".", markersize=1.5)
                axes.plot(*sphere, "k", linewidth=0.8)
                axes.plot(0.0, 0.0, "k+")
                axes.set_aspect("equal", adjustable="datalim")
                axes.set_title(f"{title}: {'xyz'[j]} over {'xyz'[i]}, µT")
                # one outline: a patch a bin is slow to lay out
            row[3].hist(np.linalg.norm(points, axis=1), bins=bins, histtype="stepfilled")
            row[3].axvline(found.fit.field_ut, color="k", linewidth=0.8)
            row[3].set_title(f"{title}: strength, µT")
        figure.suptitle(found.name)

    save_png(path, draw, 12.0, 7.0)


def _bars(axes: Axes, place: Array, height: Array, title: str, unit: str) -> None:
    axes.bar(place, height)
    axes.set_title(f"{title}: mean {np.mean(np.abs(height)):.3g}")
    axes.set_ylabel(unit)
