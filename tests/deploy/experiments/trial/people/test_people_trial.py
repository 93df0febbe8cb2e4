"""The people trial on made-up people: its figures, its verdicts, and what they say of each strategy."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from common.skeleton import load_skeleton
from deploy import cli
from deploy.experiments.trial.people import study
from deploy.experiments.trial.people.figures import figures
from deploy.experiments.trial.people.followed import Followed, Line, follow
from deploy.experiments.trial.people.study import Row, shoulders, verdicts
from deploy.measure.verdict import Outcome
from deploy.sim.suit.people import PeopleConfig, load_clips, spline
from tests.deploy.sim.suit.synthetic_people import write

SKELETON = load_skeleton("nursing")
SHOULDERS = shoulders(SKELETON)


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("people") / "made.npz", seconds=7.0)


@pytest.fixture(scope="module")
def done(file: Path) -> list[Row]:
    clips = load_clips(PeopleConfig(file=file), SKELETON)[:1]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study, "ONE_WAY_MS", (25, 80))
        return list(study.rows(clips, SKELETON, ("latest", "predict"), (1.5,)))


def only(done: list[Row], strategy: str, ms: int, rate_hz: float) -> Row:
    (found,) = (
        row for row in done
        if (row.strategy, row.line.rate_hz) == (strategy, rate_hz)
        and row.line.one_way_s == ms / 1e3 and not row.line.loss
    )  # fmt: skip
    return found


def test_latest_is_what_the_others_are_measured_by(done: list[Row]) -> None:
    assert only(done, "latest", 25, 12.5).over_latest == 1.0


def test_predict_is_nearer_than_latest_and_nearer_at_25_hz(done: list[Row]) -> None:
    for ms in (25, 80):
        slow, fast = (only(done, "predict", ms, rate_hz) for rate_hz in (12.5, 25.0))
        assert fast.over_latest < slow.over_latest < 0.95
        assert fast.over_latest < 0.8
        assert fast.found.overshoot_deg < 6.0


def test_what_the_joints_limits_leave_is_told_apart_from_the_prediction(done: list[Row]) -> None:
    floors = [row for row in done if row.strategy == "foreknown"]
    assert [row.line.one_way_s for row in floors] == [0.025, 0.08]
    for floor in floors:
        mine = only(done, "predict", round(1e3 * floor.line.one_way_s), 25.0)
        assert floor.found.unlimited_rmse_deg < 0.2
        assert floor.unlimited_over_latest < floor.over_latest < mine.over_latest
        assert mine.unlimited_over_latest < mine.over_latest
    assert floors[0].found == floors[1].found


def test_while_the_operator_stands_the_robot_stands(done: list[Row]) -> None:
    assert all(row.found.still_deg < 0.15 for row in done)


def test_a_poor_line_costs_little(done: list[Row]) -> None:
    (poor,) = (row for row in done if row.line.loss)
    assert poor.found.rmse_deg < 1.3 * only(done, "predict", 80, 25.0).found.rmse_deg


def test_verdicts_name_what_is_missed_and_what_nobody_did(done: list[Row]) -> None:
    found = {one.name: one for one in verdicts(done, None)}
    assert found["running: RMSE / latest"].outcome is Outcome.NOT_JUDGED
    judged = found["1.5 × slower, 25 ms: RMSE / latest"]
    assert judged.measured == only(done, "predict", 25, 25.0).over_latest
    assert verdicts(done, 1.06)[-1].outcome is Outcome.FAILED
    assert verdicts(done, 1.05)[-1].outcome is Outcome.PASSED


def test_a_figure_beyond_its_limit_fails(done: list[Row]) -> None:
    row = only(done, "predict", 25, 25.0)
    for ratio, outcome in ((0.34, Outcome.PASSED), (0.341, Outcome.FAILED)):
        changed = replace(row, over_latest=ratio)
        (one,) = (v for v in verdicts([changed], None) if v.name.endswith("RMSE / latest") and "ms" in v.name)
        assert one.outcome is outcome


def test_a_perfect_robot_has_no_error_no_overshoot_and_a_roughness_of_one(file: Path) -> None:
    course = spline(load_clips(PeopleConfig(file=file), SKELETON)[0].position_rad, 100.0)
    one = follow(course, 1.0, SKELETON, "latest", Line(0.025), seed=1)
    perfect = figures([Followed(one.truth_rad, one.truth_rad, one.still, one.truth_rad)], SHOULDERS)
    assert perfect.rmse_deg == 0.0
    assert perfect.overshoot_deg == 0.0
    assert perfect.still_deg < 1e-9
    assert perfect.roughness == pytest.approx(1.0)


def test_the_same_seed_gives_the_same_motion(file: Path) -> None:
    course = spline(load_clips(PeopleConfig(file=file), SKELETON)[0].position_rad[:300], 100.0)
    poor = Line(0.08, 25.0, 0.02, 0.1, velocities=False)
    one, two = (follow(course, 1.0, SKELETON, "predict", poor, seed=3).robot_rad for _ in range(2))
    np.testing.assert_array_equal(one, two)


def test_the_command_prints_and_writes_it(
    file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(study, "ONE_WAY_MS", (25,))
    words = ["trial", "--motion", "capture", "--people", str(file), "--strategies", "latest,predict"]
    result = CliRunner().invoke(cli.app, [*words, "--slower", "1.5", "--report", str(tmp_path / "report")])
    assert result.exit_code == 0, result.output
    assert "made1, made2 (held out)" in result.output
    tree = json.loads((tmp_path / "report" / "people.json").read_text())
    assert {row["strategy"] for row in tree["rows"]} == {"latest", "predict", "foreknown"}
    assert any(target["outcome"] == "not judged" for target in tree["targets"])


def test_its_options_without_capture_are_refused() -> None:
    result = CliRunner().invoke(cli.app, ["trial", "--slower", "1.5"])
    assert result.exit_code != 0
    assert "--motion capture" in str(result.exception) + result.output
