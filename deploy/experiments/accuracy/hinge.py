"""`tandem accuracy hinge`: a hinge joint from two units' recording (paper C)."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer
from rich.console import Console

from common.quaternion import Array
from deploy.report.options import AsJson, ReportFile
from deploy.report.output import in_a_folder
from deploy.report.plots import save_png
from deploy.report.tables import plain_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from master.calibrate.evidence import CrossCheck
    from master.calibrate.hinge_pair import HingePair
    from master.calibrate.recording import NodeRecording


@dataclass(frozen=True, slots=True)
class RatesAloneAxes:
    """The axes by the angular rates alone."""

    axis1: list[float]
    axis2: list[float]
    sigma_deg: list[float]
    """Standard deviation of each axis."""
    differs_deg: list[float]
    """How far each axis is from the one that the report gives."""


@dataclass(frozen=True, slots=True)
class HingeAngleRange:
    """The joint's angle over the recording."""

    lowest: float
    median: float
    highest: float
    fastest_deg_s: float


@dataclass(frozen=True, slots=True)
class HingeReport:
    """Everything found, as the JSON has it. Axes are unit vectors (3,) in the frame of their node."""

    file: str
    duration_s: float
    axis1: list[float]
    axis2: list[float]
    sigma_deg: list[float]
    """Standard deviation of each axis."""
    rates_alone: RatesAloneAxes
    evidence: list[CrossCheck]
    condition: float
    misfit_deg_s: float
    bending_deg_s: float
    next_best_answer_cost_ratio: float | None
    """None where there is no other answer."""
    lever1_m: list[float]
    lever2_m: list[float]
    angle_deg: HingeAngleRange


def hinge(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="Recording (.npz) of two nodes: gyr1 and gyr2 in rad/s, acc1 and acc2 in "
            "m/s², (T, 3) each, and rate_hz.",
            dir_okay=False,
        ),
    ],
    report: ReportFile = None,
    picture: Annotated[
        Path | None,
        typer.Option(
            help="Draw the angle over time into this PNG file.", dir_okay=False, callback=in_a_folder
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Print a hinge joint's axis in the frames of both nodes, how well it is known, and the joint's angle.

    The nodes may sit in any orientation on the two segments; no magnetometer is used. Angle 0 is the pose at
    the beginning. The sign of the axis is chosen so that the joint bends farther to the positive side.

    Example: `tandem accuracy hinge knee.npz --report knee.json --picture knee.png`
    """
    from deploy.calibrate.session import output_json
    from master.calibrate.hinge_pair import find_hinge_pair, without_gaps
    from master.orientation.hinge_angle import HingeAngleConfig, hinge_angles

    one, two = load_pair(file)
    pair = find_hinge_pair(one, two)
    one, two = without_gaps(one), without_gaps(two)
    track = hinge_angles(
        HingeAngleConfig(), pair.hinge, one.rate_hz, one.gyr_rad_s, one.acc_m_s2, two.gyr_rad_s, two.acc_m_s2
    )
    # the axes' common sign means nothing yet: let the joint bend to the positive side
    sign = 1.0 if track.angle_rad.max() >= -track.angle_rad.min() else -1.0
    angle = sign * track.angle_rad
    found = report_of(pair, angle, sign, file, one.rate_hz)
    output_json(asdict(found), report, to_stdout=as_json)
    if picture is not None:
        draw(angle, track.deviation_rad, one.rate_hz, picture)
    if not as_json:
        _print(found, Console())


def load_pair(path: Path) -> tuple[NodeRecording, NodeRecording]:
    """Two units of one file. Raises RecordingError naming file, array and what was expected."""
    from common.errors import RecordingError
    from common.recording.npz import read_arrays
    from master.calibrate.recording import NodeRecording

    arrays = read_arrays(path)
    missing = [k for k in ("gyr1", "acc1", "gyr2", "acc2", "rate_hz") if k not in arrays]
    if missing:
        there = ", ".join(sorted(arrays)[:8]) or "nothing"
        raise RecordingError(f"{path}: has no {', '.join(missing)}; it has {there}")
    if arrays["rate_hz"].size != 1 or arrays["rate_hz"].dtype.kind not in "fiu":
        raise RecordingError(f"{path}: rate_hz is {arrays['rate_hz']!r}; expected one number, Hz")
    rate_hz = float(arrays["rate_hz"].reshape(()))
    if not 20.0 <= rate_hz <= 10_000.0:
        raise RecordingError(f"{path}: rate_hz = {rate_hz:g}; expected 20 to 10000 Hz")
    shapes = {key: arrays[key].shape for key in ("gyr1", "acc1", "gyr2", "acc2")}
    first = shapes["gyr1"]
    for key, shape in shapes.items():
        if shape != first or shape[1:] != (3,) or not shape[0] or arrays[key].dtype.kind not in "fiu":
            raise RecordingError(
                f"{path}: {key} is {arrays[key].dtype} of shape {shape}; expected numbers (T, 3), all alike"
            )
    gyr1, acc1, gyr2, acc2 = (arrays[key].astype(np.float64) for key in ("gyr1", "acc1", "gyr2", "acc2"))
    return NodeRecording("unit 1", rate_hz, acc1, gyr1), NodeRecording("unit 2", rate_hz, acc2, gyr2)


def report_of(pair: HingePair, angle_rad: Array, sign: float, file: Path, rate_hz: float) -> HingeReport:
    """The report of a hinge whose angle over time is `angle_rad` (T,)."""
    found, fit = pair.found, pair.fit
    assert fit.axes is not None
    rival = min(fit.rival, fit.axis_rival)
    degrees = np.degrees(angle_rad)
    speed = np.degrees(np.gradient(angle_rad, 1.0 / rate_hz))
    apart = [
        math.degrees(math.acos(min(1.0, abs(float(a @ b)))))
        for a, b in zip((found.axis1, found.axis2), fit.axes, strict=True)
    ]
    return HingeReport(
        file=file.name,
        duration_s=len(angle_rad) / rate_hz,
        axis1=(sign * fit.axes[0]).tolist(),
        axis2=(sign * fit.axes[1]).tolist(),
        sigma_deg=[math.degrees(s) for s in fit.axis_sigma_rad],
        rates_alone=RatesAloneAxes(
            axis1=(sign * found.axis1).tolist(),
            axis2=(sign * found.axis2).tolist(),
            sigma_deg=[math.degrees(found.sigma1_rad), math.degrees(found.sigma2_rad)],
            differs_deg=apart,
        ),
        evidence=[pair.rates],
        condition=found.condition,
        misfit_deg_s=math.degrees(found.misfit_rad_s),
        bending_deg_s=math.degrees(found.bending_rad_s),
        next_best_answer_cost_ratio=rival if math.isfinite(rival) else None,
        lever1_m=pair.hinge.lever1_m.tolist(),
        lever2_m=pair.hinge.lever2_m.tolist(),
        angle_deg=HingeAngleRange(
            lowest=float(degrees.min()),
            median=float(np.median(degrees)),
            highest=float(degrees.max()),
            fastest_deg_s=float(np.max(np.abs(speed))),
        ),
    )


def draw(angle_rad: Array, deviation_rad: Array, rate_hz: float, path: Path) -> None:
    """Write the PNG: the angle over time with its standard deviation."""
    time_s = np.arange(len(angle_rad)) / rate_hz
    angle, spread = np.degrees(angle_rad), np.degrees(deviation_rad)

    def draw_angle(figure: Figure) -> None:
        axes = figure.subplots()
        axes.fill_between(time_s, angle - spread, angle + spread, alpha=0.3)
        axes.plot(time_s, angle, linewidth=0.8)
        axes.set(xlabel="s", ylabel="hinge angle, °")

    save_png(path, draw_angle, 10.0, 3.5)


def _print(found: HingeReport, console: Console) -> None:
    heads = ("axis x", "y", "z", "± °", "rates alone differ °")
    table = plain_table("unit", *heads, title=f"hinge, {found.duration_s:.0f} s")
    for i, axis in enumerate((found.axis1, found.axis2)):
        table.add_row(
            str(i + 1),
            *(f"{x:.4f}" for x in axis),
            f"{found.sigma_deg[i]:.2f}",
            f"{found.rates_alone.differs_deg[i]:.2f}",
        )
    console.print(table)
    rival = found.next_best_answer_cost_ratio
    console.print(
        f"conditioning {found.condition:.1f}; misfit {found.misfit_deg_s:.1f}°/s of "
        f"{found.bending_deg_s:.0f}°/s bending; "
        + ("no other answer" if rival is None else f"the next best answer costs {rival:.1f} times as much")
    )
    for one in found.evidence:
        figure = one.advice if one.figure is None else f"{one.figure:.0f} of {one.limit:.0f}°"
        console.print(f"{one.compared}, low-passed: {one.verdict}, {figure}")
    angle = found.angle_deg
    console.print(
        f"angle {angle.lowest:.1f} to {angle.highest:.1f}°, median {angle.median:.1f}°, "
        f"fastest {angle.fastest_deg_s:.0f}°/s"
    )
