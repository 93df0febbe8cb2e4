"""Calibrations as tables for people."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from common.quaternion import Array
from deploy.calibrate.session import Found, by_words
from master.calibrate.inertial import InertialCalibration
from master.calibrate.magnetic import MagneticCalibration
from master.calibrate.six_position_session import SixPositionCalibration


def inertial_table(found: Mapping[str, InertialCalibration]) -> Table:
    """A row a node and sensor: mean residual before, after and on data held out, and the largest 1σ."""
    table = _table("acc: |‖a‖ - g| at rest, m/s²; gyro: error of gravity after a move, °")
    for name, node in found.items():
        a, g = node.accelerometer, node.gyroscope
        scale = np.cbrt(np.linalg.det(a.gain)), np.cbrt(np.linalg.det(g.gain))
        table.add_row(
            name,
            "acc",
            f"{len(node.still)} rests",
            *(f"{_mean(e):.4f}" for e in (node.acc_before_m_s2, a.residuals_m_s2, a.hold_out_m_s2)),
            f"{100 * a.sigma[:6].max() / scale[0]:.3f} %",
            f"{a.sigma[6:].max() * scale[0]:.4f} m/s²",
        )
        table.add_row(
            "",
            "gyro",
            f"{len(g.errors_rad)} moves",
            *(f"{np.degrees(_mean(e)):.3f}" for e in (node.gyr_before_rad, g.errors_rad, g.hold_out_rad)),
            f"{100 * g.sigma.max() / scale[1]:.3f} %",
            f"{np.degrees(g.bias_sigma.max() * scale[1]):.4f} °/s",
        )
    return table


def six_position_table(found: Mapping[str, SixPositionCalibration]) -> Table:
    """A row a node and sensor: mean residual before and after, and the largest 1σ."""
    table = _table("acc: |‖a‖ - g| at rest, m/s²; gyro: error of a turn's angle, °")
    for name, node in found.items():
        a, g = node.accelerometer, node.gyroscope
        scale = [np.cbrt(abs(np.linalg.det(sensor.affine[:, :3]))) for sensor in (a, g)]
        table.add_row(
            name,
            "acc",
            f"{len(node.still)} rests",
            f"{_mean(a.before_m_s2):.4f}",
            f"{_mean(a.after_m_s2):.4f}",
            "-",
            f"{100 * a.sigma[:, :3].max() / scale[0]:.3f} %",
            f"{a.sigma[:, 3].max():.4f} m/s²",
        )
        table.add_row(
            "",
            "gyro",
            f"{len(g.after_rad)} turns",
            f"{np.degrees(_mean(g.before_rad)):.3f}",
            f"{np.degrees(_mean(g.after_rad)):.3f}",
            "-",
            f"{100 * g.sigma[:, :3].max() / scale[1]:.3f} %",
            f"{np.degrees(g.sigma[:, 3].max()):.4f} °/s",
        )
    return table


def magnetic_table(found: Mapping[str, MagneticCalibration]) -> Table:
    """A row a node: spread of the field's strength before, after and on data held out, and the largest 1σ."""
    table = _table("magnetometer: spread of the strength, % of the field")
    for name, node in found.items():
        spreads = (node.spread_before_ut, node.spread_after_ut, node.hold_out_spread_ut)
        table.add_row(
            name,
            f"{node.fit.field_ut:.1f} µT",
            f"{100 * node.coverage:.0f} % seen",
            *(f"{100 * spread / node.fit.field_ut:.2f}" for spread in spreads),
            f"{100 * node.sigma[:, :3].max():.3f} %",
            f"{node.sigma[:, 3].max():.3f} µT",
        )
    return table


def notes(found: Mapping[str, Found], written: Mapping[str, Path], console: Console) -> None:
    """What a person should know of the nodes, and where their files are."""
    for note, names in by_words((name, note) for name, node in found.items() for note in node.notes).items():
        console.print(Text(f"{', '.join(names)}: {note}", "yellow"))
    for name in found:
        console.print(Text(f"written: {written[name]}", "dim"), soft_wrap=True)


def _table(title: str) -> Table:
    table = Table(
        title=title, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0)
    )
    table.add_column("node", overflow="fold")
    table.add_column("", no_wrap=True)
    table.add_column("from", justify="right", no_wrap=True)
    for head in ("before", "after", "hold-out", "1σ gain", "1σ bias"):
        table.add_column(head, justify="right", no_wrap=True)
    return table


def _mean(errors: Array) -> float:
    return float(np.mean(np.abs(errors)))
