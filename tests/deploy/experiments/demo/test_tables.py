import io
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from common.metrics.parts import Summary
from common.metrics.slave import OffsetMetrics, SlaveMetrics
from deploy.experiments.demo.live_view import Live, live_view
from deploy.experiments.demo.tables import (
    accuracy_table,
    latency_table,
    motion_table,
    strategies_table,
)
from deploy.measure import MovedSeries, SolvedSeries, TruthSeries, accuracy, motion
from deploy.measure.verdict import at_most, verdict_table
from tests.published import slave_metrics

NAMES = [
    *("neck_yaw", "neck_pitch", "waist_pitch"),
    *(f"{s}_{j}" for s in ("left", "right") for j in ("shoulder_pitch", "shoulder_roll", "shoulder_yaw")),
    *(f"{s}_{j}" for s in ("left", "right") for j in ("elbow_pitch", "elbow_roll")),
]


def stage(mean: float, count: int = 100) -> Summary:
    return Summary(count, mean, mean, 2 * mean, 1234.56)


STAGES = {"sampled→frames in": stage(2.25), "put→received": stage(0.5), "servo written→moved": stage(13.0)}


def slave(trusted: bool = True, stages: Mapping[str, Summary] = STAGES) -> SlaveMetrics:
    offset = OffsetMetrics(0.0, 0.071, trusted)
    return slave_metrics(stages_ms=dict(stages), end_to_end_ms=stage(15.0), offset=offset)


def text(renderable: Any, width: int = 80) -> str:
    out = io.StringIO()
    Console(file=out, width=width, color_system=None, legacy_windows=False).print(renderable)
    return out.getvalue()


def series() -> tuple[TruthSeries, SolvedSeries, MovedSeries]:
    ticks = np.arange(2400)
    swing = np.sin(2 * np.pi * 0.5 * ticks * 0.005)[:, None] * np.linspace(0.2, 1.0, len(NAMES))
    everywhere = np.ones(swing.shape, np.bool_)
    truth = TruthSeries(ticks, ticks * 5_000_000, swing)
    solved = SolvedSeries(ticks[::16], swing[::16] + 0.001, everywhere[::16])
    moved = MovedSeries(ticks[40::4] * 5_000_000, swing[30:-10:4], everywhere[40::4], everywhere[40::4, 0])
    return truth, solved, moved


def test_the_latency_budgets_means_add_up_to_its_total() -> None:
    shown = text(latency_table(slave()))
    rows = [line.split() for line in shown.splitlines()]
    total = next(row for row in rows if row and row[0] == "total")
    assert total[1:] == ["15.75", "15.00", "30.00", "1234.56", "100"]
    assert "± 0.071 ms" in shown


def test_an_untrusted_offset_is_said() -> None:
    assert "not trusted" in text(latency_table(slave(trusted=False)))


def test_an_empty_budget_shows_no_figures() -> None:
    empty = replace(slave(stages={"a": Summary(0)}), end_to_end_ms=Summary(0))
    assert "0.00" not in text(latency_table(empty))
    assert "latency budget" in text(latency_table(None))


def test_the_accuracy_table_stands_beside_the_paper() -> None:
    truth, solved, _ = series()
    shown = text(accuracy_table(accuracy(truth, solved, NAMES)))
    for figure in ("0.594", "0.451", "0.722", "0.547", "0.695", "0.127", "1.73"):
        assert figure in shown
    assert "0.057" in shown  # ours: 0.001 rad
    for name in NAMES:
        assert name in shown


def test_the_motion_table_has_the_lag_and_the_moving_joints() -> None:
    truth, _, moved = series()
    shown = text(motion_table(motion(truth, moved, NAMES)))
    assert "motion lag 50 ms" in shown
    assert "all moving joints" in shown


def test_the_run_stands_beside_its_replays() -> None:
    truth, _, moved = series()
    judged = motion(truth, moved, NAMES)
    assert judged is not None
    shown = text(strategies_table(judged, {"latest": judged, "predict": judged}))
    rows = [line.split() for line in shown.splitlines()]
    assert [row[:2] for row in rows if row[-2:-1] == ["0.01"] or row[-3:-2] == ["50"]] == [
        ["this", "run"],
        ["latest,", "replayed"],
        ["predict,", "replayed"],
    ]


def test_no_data_is_said_plainly() -> None:
    truth, solved, moved = series()
    moved.tracking[:] = False
    solved.valid[:] = False
    assert "not enough data" in text(motion_table(motion(truth, moved, NAMES)))
    assert "–" in text(accuracy_table(accuracy(truth, solved, NAMES)))


def test_the_live_view_shows_the_worst_joints_and_what_was_dropped() -> None:
    live = Live(
        elapsed_s=12.34,
        guard="track",
        reason="engaged by nurse",
        rates_hz={"capture": 200.0, "commands": 12.5},
        stages=STAGES,
        joint_error_deg={name: float(i) * (-1) ** i for i, name in enumerate(NAMES)},
        drops={"late": 3, "never": 0},
    )
    shown = text(live_view(live, worst=2))
    for words in ("track", "engaged by nurse", "200.0 Hz", "late 3", NAMES[-1], NAMES[-2], "put→received"):
        assert words in shown
    assert NAMES[-3] not in shown
    assert "never" not in shown
    assert "nothing" in text(live_view(Live(0.0, "", "")))


def test_the_live_view_shows_the_largest_efforts() -> None:
    live = Live(1.0, "track", "", effort_nm={"neck_yaw": 0.2, "waist_pitch": -31.04, "left_thumb": None})
    assert "effort        waist_pitch -31.0   neck_yaw +0.2 N m" in text(live_view(live))


@pytest.mark.parametrize("width", [60, 80, 200])
def test_nothing_is_wider_than_the_terminal_or_cut(width: int) -> None:
    truth, solved, moved = series()
    judged = motion(truth, moved, NAMES)
    assert judged is not None
    live = Live(1.0, "hold", "the operator's deadman was let go and the robot holds " * 2, stages=STAGES)
    shown = [
        text(accuracy_table(accuracy(truth, solved, NAMES)), width),
        text(motion_table(judged), width),
        text(strategies_table(judged, {"interpolate": judged}), width),
        text(latency_table(slave()), width),
        text(verdict_table("bench", [at_most("ticks missed", None, 1.0)]), width),
        text(live_view(live), width),
    ]
    for table in shown:
        assert max(map(len, table.splitlines())) <= width
    if width >= 80:
        assert all("…" not in table for table in shown[:5])
