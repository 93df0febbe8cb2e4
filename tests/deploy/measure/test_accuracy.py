from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from deploy.measure import accuracy
from deploy.measure.accuracy import FAST_FLOOR_DEG, MIN_SAMPLES, fast_periods
from deploy.measure.paper import STEP_TICKS, TABLE_1


def test_perfect_angles_have_no_error(run: Any) -> None:
    judged = accuracy(run.truth(), run.solved(), run.names)
    assert judged.overall is not None
    assert judged.overall.rmse_deg == 0.0
    assert judged.overall.samples == 4 * len(run.ticks[::16])
    assert judged.eta_percent == 0.0
    assert judged.fast_mae_deg == judged.fast_rmse_deg == 0.0


def test_a_constant_bias_is_bias_mae_and_rmse_alike(run: Any) -> None:
    judged = accuracy(run.truth(), run.solved(error_rad=np.radians(-0.5)), run.names)
    for joint in judged.joints.values():
        assert joint is not None
        assert (joint.mae_deg, joint.rmse_deg, joint.bias_deg) == pytest.approx((0.5, 0.5, -0.5))
    row = judged.fast["left_shoulder_pitch"]
    assert row is not None
    assert row.signed_deg == pytest.approx(0.5)
    assert row.ratio == pytest.approx(0.5 / row.change_deg)


def test_noise_gives_its_rms_while_eta_averages_it_away(run: Any) -> None:
    solved = run.solved()
    noise = np.radians(0.4) * np.random.default_rng(1).standard_normal(solved.position_rad.shape)
    judged = accuracy(run.truth(), replace(solved, position_rad=solved.position_rad + noise), run.names)
    assert judged.overall is not None
    assert judged.overall.rmse_deg == pytest.approx(0.4, rel=0.1)
    assert judged.overall.mae_deg == pytest.approx(0.4 * np.sqrt(2 / np.pi), rel=0.1)
    assert judged.fast_mae_deg is not None
    row = judged.fast["left_shoulder_pitch"]
    assert row is not None
    assert row.signed_deg < 0.8 * row.error_deg


def test_rows_are_matched_by_tick_and_nothing_is_shifted(run: Any) -> None:
    judged = accuracy(run.truth(), run.solved(late_s=0.08), run.names)
    row = judged.fast["left_shoulder_pitch"]
    assert row is not None
    # one step late: the error is about the change per step
    assert row.ratio == pytest.approx(1.0, abs=0.15)


def test_eta_is_equation_25_on_one_period_a_joint() -> None:
    # one reach of each joint, each step fast, so that the period is everything
    ticks = np.arange(12) * STEP_TICKS
    true_deg = np.outer(np.arange(12), [4.0, 2.0])
    solved_deg = true_deg + np.outer(np.linspace(-0.2, 0.6, 12), [1.0, -1.0])
    names = ("left_shoulder_pitch", "left_elbow_pitch")
    judged = accuracy(*series(ticks, true_deg, solved_deg), names)
    numerator = np.mean(np.abs(np.mean(true_deg - solved_deg, axis=0)))
    denominator = np.mean(np.mean(np.abs(true_deg - true_deg[0]), axis=0))
    assert judged.eta_percent_by_side["left"] == pytest.approx(100 * numerator / denominator)
    assert judged.eta_percent_by_side["right"] is None
    assert judged.eta_percent == judged.eta_percent_by_side["left"]
    assert judged.eta_joints == {"left": 2, "right": 0}


def test_errors_of_opposite_reaches_do_not_cancel_in_eta(run: Any) -> None:
    # a lag is an error of one sign on the way out and of the other on the way back
    judged = accuracy(run.truth(), run.solved(late_s=0.02), run.names)
    row = judged.fast["left_shoulder_pitch"]
    assert row is not None
    assert row.signed_deg == pytest.approx(row.error_deg)


def test_the_worse_arm_stands_for_both(run: Any) -> None:
    solved = run.solved()
    solved.position_rad[:, 0] += np.radians(0.1)
    solved.position_rad[:, 2] -= np.radians(0.3)
    judged = accuracy(run.truth(), solved, run.names)
    worse = judged.worse("shoulder_pitch")
    assert worse is not None
    assert worse.error_deg == pytest.approx(0.3)
    assert judged.eta_percent == judged.eta_percent_by_side["right"]
    assert judged.worse("shoulder_roll") is None


def figures(judged: Any, joint: str) -> dict[str, Any]:
    row, fast = judged.joints[joint], judged.fast[joint]
    return {
        "mae": row.mae_deg, "rmse": row.rmse_deg, "max": row.max_deg, "all": judged.overall.rmse_deg,
        "fast": fast.error_deg, "fast rmse": fast.rmse_deg, "fast all": judged.fast_rmse_deg,
    }  # fmt: skip


@pytest.mark.parametrize("how", ["nan", "infinite", "invalid"])
def test_one_angle_that_is_missing_makes_no_figure_better(run: Any, how: str) -> None:
    solved, truth, joint = run.solved(), run.truth(), "left_elbow_pitch"
    solved.position_rad[:] += np.radians(0.4) * np.random.default_rng(1).standard_normal((250, 4))
    error = np.abs(solved.position_rad[:, 1] - truth.position_rad[::16, 1])
    whole = figures(accuracy(truth, solved, run.names), joint)
    # of the largest itself nobody knows how large it was
    for row in sorted({*range(1, 250, 4)} - {int(np.argmax(error))}):
        position, valid = solved.position_rad.copy(), solved.valid.copy()
        position[row, 1] = {"nan": np.nan, "infinite": np.inf, "invalid": position[row, 1]}[how]
        valid[row, 1] = how != "invalid"
        spoilt = figures(
            accuracy(truth, replace(solved, position_rad=position, valid=valid), run.names), joint
        )
        assert all(spoilt[name] >= before for name, before in whole.items()), row


@pytest.mark.parametrize(("missing", "judged"), [(12, True), (13, False)])
def test_below_95_percent_a_figure_and_all_over_it_are_withheld(run: Any, missing: int, judged: bool) -> None:
    solved = run.solved()
    # of 250, and all of them within the rests: the fast periods are whole
    still = np.flatnonzero(np.mod(solved.tick * 0.005, 3.0) > 2.6)[:missing]
    solved.valid[still, 1] = False
    found = accuracy(run.truth(), solved, run.names)
    assert found.estimated["left_elbow_pitch"] == 1.0 - missing / 250
    assert (found.joints["left_elbow_pitch"] is not None) == judged
    assert (found.overall is not None) == judged
    assert found.withheld == ([] if judged else ["left_elbow_pitch"])
    assert found.joints["left_shoulder_pitch"] is not None
    assert found.fast["left_elbow_pitch"] is not None


def test_unestimated_fast_periods_withhold_eta_and_the_worse_side(run: Any) -> None:
    solved, truth = run.solved(error_rad=0.01), run.truth()
    true_deg = np.degrees(truth.position_rad[::16, 2]).astype(np.float64)
    periods = fast_periods(solved.tick, true_deg, np.ones(250, np.bool_))
    rows = np.concatenate([np.arange(p.start, p.stop) for p in periods])
    solved.position_rad[rows[:: len(rows) // 12], 2] = np.nan
    found = accuracy(truth, solved, run.names)
    assert found.estimated_fast["right_shoulder_pitch"] < 0.95
    assert found.fast["right_shoulder_pitch"] is None
    assert found.eta_percent_by_side["left"] is not None
    assert (found.eta_percent, found.eta_percent_by_side["right"]) == (None, None)
    assert found.worse("shoulder_pitch") is None
    assert found.fast_mae_deg is None


@pytest.mark.parametrize(("rows", "counted"), [(10, 0), (63, 0), (64, 1), (76, 13)])
def test_until_a_joint_is_first_valid_it_settles_but_for_5_s_at_most(
    run: Any, rows: int, counted: int
) -> None:
    solved = run.solved()
    solved.valid[:rows] = False
    found = accuracy(run.truth(), solved, run.names)
    assert found.estimated["neck_yaw"] == pytest.approx(1.0 - counted / (250 - rows + counted))


def test_commands_that_never_came_were_not_estimated(run: Any) -> None:
    s, kept = run.solved(), np.r_[0:100, 120:250]
    fewer = replace(s, tick=s.tick[kept], position_rad=s.position_rad[kept], valid=s.valid[kept])
    found = accuracy(run.truth(), fewer, run.names)
    assert found.estimated["neck_yaw"] == pytest.approx(230 / 250)
    assert found.overall is None


def test_commands_without_truth_are_left_out(run: Any) -> None:
    truth = run.truth()
    kept = slice(2000, None)
    truth = replace(truth, tick=truth.tick[kept], position_rad=truth.position_rad[kept])
    judged = accuracy(truth, run.solved(), run.names)
    assert judged.overall is not None
    assert judged.overall.samples == 4 * np.count_nonzero(run.ticks[::16] >= 2000)


def test_fast_periods_are_the_reaches_alone(run: Any) -> None:
    truth = run.truth()
    truth = replace(truth, tick=truth.tick[:3600], position_rad=truth.position_rad[:3600])
    ticks, true_deg = truth.tick[::16], np.degrees(truth.position_rad[::16, 0])
    periods = fast_periods(ticks, true_deg, np.ones(len(ticks), np.bool_))
    assert len(periods) == 12  # 18 s, two reaches every 3 s
    for p in periods:
        assert np.all(np.abs(np.diff(true_deg[p])) >= FAST_FLOOR_DEG)
        assert np.ptp(true_deg[p]) > 30.0


def test_a_lost_command_ends_a_period() -> None:
    ticks = np.delete(np.arange(12) * STEP_TICKS, 6)
    true_deg = 0.25 * ticks.astype(np.float64)
    usable = np.ones(11, np.bool_)
    assert fast_periods(ticks, true_deg, usable) == [slice(0, 6), slice(6, 11)]
    usable[2] = False
    assert fast_periods(ticks, true_deg, usable) == [slice(3, 6), slice(6, 11)]


@pytest.mark.parametrize(("step_deg", "found"), [(FAST_FLOOR_DEG, 1), (FAST_FLOOR_DEG - 0.01, 0)])
def test_a_joint_that_only_trembles_has_no_fast_period(step_deg: float, found: int) -> None:
    ticks = np.arange(12) * STEP_TICKS
    assert len(fast_periods(ticks, step_deg * np.arange(12.0), np.ones(12, np.bool_))) == found


@pytest.mark.parametrize(("count", "known"), [(MIN_SAMPLES, True), (MIN_SAMPLES - 1, False)])
def test_too_few_samples_give_no_figure(count: int, known: bool) -> None:
    true_deg = 4.0 * np.arange(count)[:, None]
    judged = accuracy(*series(np.arange(count) * STEP_TICKS, true_deg, true_deg), ["left_elbow_roll"])
    assert (judged.joints["left_elbow_roll"] is not None) == known
    assert (judged.fast["left_elbow_roll"] is not None) == known
    assert (judged.overall is not None) == known
    assert (judged.eta_percent is not None) == known


@pytest.mark.parametrize("spoil", ["nothing", "no match", "all nan", "all infinite", "all invalid"])
def test_useless_input_gives_no_figure_and_no_error(run: Any, spoil: str) -> None:
    truth, solved = run.truth(), run.solved()
    if spoil == "nothing":
        truth = replace(truth, tick=truth.tick[:0], position_rad=truth.position_rad[:0])
        solved = replace(
            solved, tick=solved.tick[:0], position_rad=solved.position_rad[:0], valid=solved.valid[:0]
        )
    elif spoil == "no match":
        truth = replace(truth, tick=truth.tick + 1_000_000)
    elif spoil == "all invalid":
        solved.valid[:] = False
    else:
        value = np.nan if spoil == "all nan" else np.inf
        truth.position_rad[:] = value
        solved.position_rad[:] = value
    judged = accuracy(truth, solved, run.names)
    assert judged.overall is None
    assert judged.eta_percent is None
    assert judged.fast_mae_deg is None
    assert judged.fast_rmse_deg is None
    assert set(judged.joints.values()) == {None}


def test_the_papers_figures_agree_with_each_other() -> None:
    for row in TABLE_1.values():
        assert row.error_deg / row.change_deg == pytest.approx(row.ratio, abs=1e-3)


def series(ticks: Any, true_deg: Any, solved_deg: Any) -> tuple[Any, Any]:
    from deploy.measure import SolvedSeries, TruthSeries

    truth = TruthSeries(ticks, ticks * 5_000_000, np.radians(true_deg))
    return truth, SolvedSeries(ticks, np.radians(solved_deg), np.ones(solved_deg.shape, np.bool_))
