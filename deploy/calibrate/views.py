"""Calibrations as tables for people."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from rich import box
from rich.table import Table

from common.quaternion import Array
from master.calibrate.inertial import InertialCalibration
from master.calibrate.magnetic import MagneticCalibration
from master.calibrate.six_position_session import SixPositionCalibration


def inertial_table(found: Mapping[str, InertialCalibration]) -> Table:
    """A row a node and sensor: mean residual before, after and on data held out, and the largest 1σ."""
    table = _table("acc: |‖a‖ - g| at rest, m/s²; gyro: error of gravity after a move, °")
    for name, node in found.items():
        a, g = node.accelerometer, node.gyroscope
        scale = np.cbrt(np.linalg.det(a.gain)), np.cbrt(np.linalg.det(g.gain))
        _acc_row(
            table,
            (name, f"{len(node.still)} rests"),
            (node.acc_before_m_s2, a.residuals_m_s2, a.hold_out_m_s2),
            (a.sigma[:6].max() / scale[0], a.sigma[6:].max() * scale[0]),
        )
        _gyro_row(
            table,
            f"{len(g.errors_rad)} moves",
            (node.gyr_before_rad, g.errors_rad, g.hold_out_rad),
            (g.sigma.max() / scale[1], g.bias_sigma.max() * scale[1]),
        )
    return table


def six_position_table(found: Mapping[str, SixPositionCalibration]) -> Table:
    """A row a node and sensor: mean residual before and after, and the largest 1σ."""
    table = _table("acc: |‖a‖ - g| at rest, m/s²; gyro: error of a turn's angle, °")
    for name, node in found.items():
        a, g = node.accelerometer, node.gyroscope
        scale = [np.cbrt(abs(np.linalg.det(sensor.affine[:, :3]))) for sensor in (a, g)]
        _acc_row(
            table,
            (name, f"{len(node.still)} rests"),
            (a.before_m_s2, a.after_m_s2, None),
            (a.sigma[:, :3].max() / scale[0], a.sigma[:, 3].max()),
        )
        _gyro_row(
            table,
            f"{len(g.after_rad)} turns",
            (g.before_rad, g.after_rad, None),
            (g.sigma[:, :3].max() / scale[1], g.sigma[:, 3].max()),
        )
    return table


def _acc_row(
    table: Table, head: tuple[str, str], errors: Sequence[Array | None], sigma: tuple[float, float]
) -> None:
    means = ["-" if e is None else f"{_mean(e):.4f}" for e in errors]
    table.add_row(head[0], "acc", head[1], *means, f"{100 * sigma[0]:.3f} %", f"{sigma[1]:.4f} m/s²")


def _gyro_row(table: Table, source: str, errors: Sequence[Array | None], sigma: tuple[float, float]) -> None:
    means = ["-" if e is None else f"{np.degrees(_mean(e)):.3f}" for e in errors]
    bias = f"{np.degrees(sigma[1]):.4f} °/s"
    table.add_row("", "gyro", source, *means, f"{100 * sigma[0]:.3f} %", bias)


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
