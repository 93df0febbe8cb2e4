"""What a recording looks like: joints over time, each guard event, the spectra of the stages."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from common.clock import to_s
from common.quaternion import Array
from deploy.ops.inspect.guard_changes import GuardChange
from deploy.ops.inspect.jitter.bands import JITTER_HZ, MOTION_HZ, Signal, spectrum
from deploy.ops.inspect.jitter.judge import JitterFindings
from deploy.report.output import writing
from deploy.report.plots import INK, LIMIT_COLOUR, PALETTE, colour, save_png

if TYPE_CHECKING:
    from matplotlib.figure import Figure

EVENTS_DRAWN = 20
JOINTS_DRAWN = 4
"""Of an event: those that moved most or were furthest off."""
COLUMNS = 5


def make_folder(folder: Path) -> None:
    """Raises TandemError."""
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)


def draw_events(folder: Path, events: Sequence[GuardChange], joints: Sequence[str]) -> list[Path]:
    """One picture an event that has the seconds around it, of the first 20."""
    paths = []
    for number, event in enumerate([e for e in events if len(e.moments) > 1][:EVENTS_DRAWN], start=1):
        path = folder / f"guard-{number:02}-{event.state}.png"
        save_png(path, partial(_event, event=event, joints=joints), 8.0, 5.0)
        paths.append(path)
    return paths


def _event(figure: Figure, event: GuardChange, joints: Sequence[str]) -> None:
    time_s = np.array([to_s(m.at_ns - event.at_ns) for m in event.moments])
    setpoint = np.degrees([m.setpoint_rad for m in event.moments])
    position = np.degrees([m.position_rad for m in event.moments])
    moved = np.ptp(position, axis=0) + np.abs(setpoint - position).max(axis=0)
    axes = figure.subplots(1, 1)
    for row, joint in enumerate(np.argsort(moved)[::-1][:JOINTS_DRAWN]):
        axes.plot(time_s, position[:, joint], color=colour(row), label=joints[joint])
        axes.plot(time_s, setpoint[:, joint], color=colour(row), linestyle=":", linewidth=1.0)
    axes.axvline(0.0, color=LIMIT_COLOUR, linewidth=1.0)
    axes.set_title(
        f"{event.at_s:.1f} s: {event.before or 'the recording begins'} → {event.state}: {event.reason}"
    )
    axes.set_xlabel("s around the event; solid: encoders, dotted: setpoints")
    axes.set_ylabel("°")
    axes.legend()


def draw_joints(
    path: Path, time_s: Array, position_rad: Array, target_rad: Array, joints: Sequence[str]
) -> None:
    """All joints over the whole recording: encoders, and setpoints dotted. Shapes (T,), (T, J), (T, J)."""
    rows = -(-len(joints) // COLUMNS)

    def draw(figure: Figure) -> None:
        grid = figure.subplots(rows, COLUMNS, sharex=True, squeeze=False)
        for axes in grid.flat[len(joints) :]:
            axes.set_axis_off()
        for joint, name in enumerate(joints):
            axes = grid.flat[joint]
            axes.plot(time_s, np.degrees(position_rad[:, joint]), color=colour(0), linewidth=0.8)
            axes.plot(time_s, np.degrees(target_rad[:, joint]), color=colour(1), linewidth=0.6, linestyle=":")
            axes.set_title(name)
        figure.supxlabel("s since the recording began; solid: encoders °, dotted: setpoints °")

    save_png(path, draw, 2.6 * COLUMNS, 1.5 * rows + 0.4)


def draw_jitter(path: Path, findings: JitterFindings, signals: Sequence[Signal]) -> None:
    """The density of angular velocity of each stage, over all its joints, up to half its rate."""
    began_s = findings.began_s

    def draw(figure: Figure) -> None:
        axes = figure.subplots(1, 1)
        for number, signal in enumerate(signals):
            cut = signal.within(began_s + findings.from_s, began_s + findings.until_s)
            frequency_hz, density = spectrum(cut)
            shown = (frequency_hz > 0.0) & (frequency_hz <= 0.5 * cut.rate_hz)
            first = findings.first is not None and findings.first.stage == signal.stage
            axes.loglog(
                frequency_hz[shown], density.sum(axis=1)[shown], color=(*PALETTE, INK)[number],
                linewidth=2.2 if first else 1.0, label=signal.stage + (" (jumps)" if first else ""),
            )  # fmt: skip
        for edge_hz in (MOTION_HZ, JITTER_HZ):
            axes.axvline(edge_hz, color=INK, linewidth=0.8, linestyle=":")
        axes.set_xlabel("Hz; dotted: the edges of the bands")
        axes.set_ylabel("angular velocity, (rad/s)²/Hz")
        axes.set_title(findings.words)
        axes.legend()

    save_png(path, draw, 8.0, 5.0)
