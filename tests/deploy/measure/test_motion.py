from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from common.quaternion import Array
from deploy.measure import MovedSeries, motion
from deploy.measure.motion import MIN_SAMPLES, MOVING_DEG, SETTLE_S, at_shift

COUNT_RAD = 2 * np.pi / 4096


def quantised(position: Array) -> Array:
    return np.round(position / COUNT_RAD) * COUNT_RAD


def test_a_perfect_copy_has_no_lag_no_error_and_roughness_one(run: Any) -> None:
    judged = motion(run.truth(), run.moved(), run.names)
    assert judged is not None
    assert judged.lag_ms == pytest.approx(0.0, abs=1.0)
    assert judged.rmse_deg < 0.01
    assert judged.roughness == pytest.approx(1.0, abs=0.001)


@pytest.mark.parametrize("late_ms", [-60.0, 12.0, 87.3, 240.0, 430.0])
def test_a_known_lag_is_found_to_a_millisecond(run: Any, late_ms: float) -> None:
    judged = motion(run.truth(), run.moved(late_s=late_ms / 1000, change=quantised), run.names)
    assert judged is not None
    assert judged.lag_ms == pytest.approx(late_ms, abs=1.0)
    assert judged.aligned_rmse_deg is not None
    assert judged.aligned_rmse_deg < 0.05 < judged.rmse_deg


@pytest.mark.parametrize("late_ms", [-250.0, 700.0])
def test_a_lag_outside_the_search_is_not_made_up(run: Any, late_ms: float) -> None:
    judged = motion(run.truth(), run.moved(late_s=late_ms / 1000), run.names)
    assert judged is not None
    assert judged.lag_ms is None
    assert judged.aligned_rmse_deg is None
    assert judged.rmse_deg > 5.0


def test_a_bias_survives_alignment(run: Any) -> None:
    judged = motion(run.truth(), run.moved(late_s=0.05, change=lambda p: p + np.radians(2.0)), run.names)
    assert judged is not None
    assert judged.lag_ms == pytest.approx(50.0, abs=1.0)
    assert judged.aligned_rmse_deg == pytest.approx(2.0, abs=0.01)


def test_only_joints_that_move_are_judged(run: Any) -> None:
    moved = run.moved()
    moved.position_rad[:, 3] += 1.0  # the neck stays; its encoder is a radian off
    judged = motion(run.truth(), moved, run.names)
    assert judged is not None
    assert set(judged.joints) == set(run.names[:3])
    assert judged.rmse_deg < 0.01


@pytest.mark.parametrize(("range_deg", "judged"), [(MOVING_DEG + 0.1, True), (MOVING_DEG - 0.1, False)])
def test_moving_means_a_range_of_a_few_degrees(run: Any, range_deg: float, judged: bool) -> None:
    whole = run.at
    run.at = lambda time_s: whole(time_s) * range_deg / 60.0
    found = motion(run.truth(), run.moved(), run.names)
    assert (found is not None) == judged
    if found is not None:
        assert set(found.joints) == {run.names[0]}


def test_only_tracking_counts_and_its_first_second_does_not(run: Any) -> None:
    moved = run.moved()
    begins = 250  # 5 s
    settled = begins + round(SETTLE_S * 50)
    moved.tracking[:begins] = False
    moved.position_rad[:settled] += 1.0
    judged = motion(run.truth(), moved, run.names)
    assert judged is not None
    assert judged.rmse_deg < 0.01
    moved.position_rad[settled] += 1.0
    judged = motion(run.truth(), moved, run.names)
    assert judged is not None
    assert judged.rmse_deg > 0.1


def test_each_hand_over_settles_anew(run: Any) -> None:
    moved = run.moved()
    moved.tracking[400:420] = False
    moved.position_rad[400:470] += 1.0
    judged = motion(run.truth(), moved, run.names)
    assert judged is not None
    assert judged.rmse_deg < 0.01


@pytest.mark.parametrize(("percent", "judged"), [(4.9, True), (5.3, False)])
def test_a_bad_encoder_is_named_and_below_95_percent_nothing_is_judged(
    run: Any, percent: float, judged: bool
) -> None:
    whole = motion(run.truth(), run.moved(), run.names)
    assert whole is not None
    assert set(whole.read.values()) == {1.0}
    moved, missing = run.moved(), round(whole.samples * percent / 100)
    moved.position_rad[300 : 300 + missing, 1] = 9.0
    moved.valid[300 : 300 + missing, 1] = False
    found = motion(run.truth(), moved, run.names)
    assert (found is not None) == judged
    if found is not None:
        assert found.rmse_deg < 0.01
        assert found.read["left_elbow_pitch"] == pytest.approx(0.951, abs=0.001)
        assert found.roughness == pytest.approx(1.0, abs=0.05)


def test_one_reading_that_is_missing_makes_no_error_better(run: Any) -> None:
    noise = np.random.default_rng(3)
    moved = run.moved(late_s=0.03, change=lambda p: p + 0.01 * noise.standard_normal(p.shape))
    whole = motion(run.truth(), moved, run.names)
    assert whole is not None
    for row in (200, 333, 501, 702):
        spoilt = replace(moved, position_rad=moved.position_rad.copy())
        spoilt.position_rad[row, 0] = np.nan
        found = motion(run.truth(), spoilt, run.names)
        assert found is not None
        assert found.rmse_deg >= whole.rmse_deg
        assert found.joints[run.names[0]].rmse_deg >= whole.joints[run.names[0]].rmse_deg


def test_gaps_of_truth_and_encoders_are_not_filled_in(run: Any) -> None:
    truth, moved = run.truth(), run.moved(late_s=0.03)
    kept = np.r_[0:1000, 1300:2000, 2100:4000]
    truth = replace(
        truth, tick=truth.tick[kept], sampled_ns=truth.sampled_ns[kept], position_rad=truth.position_rad[kept]
    )
    truth.position_rad[500:560] = np.nan
    rows = np.r_[0:600, 640:900]
    moved = replace(
        moved,
        encoder_ns=moved.encoder_ns[rows],
        position_rad=moved.position_rad[rows],
        valid=moved.valid[rows],
        tracking=moved.tracking[rows],
    )
    judged = motion(truth, moved, run.names)
    assert judged is not None
    assert judged.lag_ms == pytest.approx(30.0, abs=1.0)
    assert judged.aligned_rmse_deg is not None
    assert judged.aligned_rmse_deg < 0.02
    # the robot is 30 ms late, so its stretches differ a little from the operator's
    assert judged.roughness == pytest.approx(1.0, abs=0.1)


def test_rows_out_of_order_or_twice_change_nothing(run: Any) -> None:
    moved = run.moved(late_s=0.04)
    rows = np.random.default_rng(0).permutation(np.r_[np.arange(len(moved.encoder_ns)), 5, 6, 7])
    shuffled = replace(
        moved,
        encoder_ns=moved.encoder_ns[rows],
        position_rad=moved.position_rad[rows],
        valid=moved.valid[rows],
        tracking=moved.tracking[rows],
    )
    assert motion(run.truth(), shuffled, run.names) == motion(run.truth(), moved, run.names)


@pytest.mark.parametrize("spoil", ["nothing", "still", "never tracked", "nan", "no truth", "other time"])
def test_useless_input_gives_none(run: Any, spoil: str) -> None:
    truth, moved = run.truth(), run.moved()
    if spoil == "nothing":
        moved = replace(
            moved,
            encoder_ns=moved.encoder_ns[:0],
            position_rad=moved.position_rad[:0],
            valid=moved.valid[:0],
            tracking=moved.tracking[:0],
        )
    elif spoil == "still":
        truth.position_rad[:] = 0.3
    elif spoil == "never tracked":
        moved.tracking[:] = False
    elif spoil == "nan":
        moved.position_rad[:] = np.nan
    elif spoil == "no truth":
        truth = replace(
            truth, tick=truth.tick[:0], sampled_ns=truth.sampled_ns[:0], position_rad=truth.position_rad[:0]
        )
    else:
        truth = replace(truth, sampled_ns=truth.sampled_ns + 10**12)
    assert motion(truth, moved, run.names) is None


@pytest.mark.parametrize(("spare", "known"), [(0, True), (-1, False)])
def test_too_few_readings_give_none(run: Any, spare: int, known: bool) -> None:
    moved = run.moved()
    settled = round(SETTLE_S * 50)
    moved.tracking[300 + settled + MIN_SAMPLES + spare :] = False
    moved.tracking[:300] = False
    assert (motion(run.truth(), moved, run.names) is not None) == known


def test_a_silence_of_the_encoders_settles_anew(run: Any) -> None:
    # what the guard did meanwhile is not known
    moved = run.moved()
    moved.position_rad[450:500] += 1.0
    rows = np.r_[0:440, 450:900]
    assert motion(run.truth(), rows_of(moved, rows), run.names).rmse_deg < 0.01  # type: ignore[union-attr]
    rows = np.r_[0:446, 450:900]  # 80 ms, no gap yet
    assert motion(run.truth(), rows_of(moved, rows), run.names).rmse_deg > 1.0  # type: ignore[union-attr]


def test_no_shift_may_land_in_a_gap_of_the_truth(run: Any) -> None:
    truth, moved = run.truth(), run.moved()
    whole = motion(truth, moved, run.names)
    kept = np.r_[0:2000, 2030:4000]  # 150 ms
    holed = replace(
        truth, tick=truth.tick[kept], sampled_ns=truth.sampled_ns[kept], position_rad=truth.position_rad[kept]
    )
    judged = motion(holed, moved, run.names)
    assert whole is not None
    assert judged is not None
    # the hole, 500 ms after it and 100 ms before: every row there could meet it at some shift
    assert whole.samples - judged.samples == pytest.approx((0.155 + 0.6) * 50, abs=1)


def test_the_truth_is_not_interpolated_over_a_gap_nor_beyond_its_ends(run: Any) -> None:
    truth = run.truth()
    kept = np.r_[0:2000, 2021:4000]  # 110 ms
    holed = replace(
        truth, tick=truth.tick[kept], sampled_ns=truth.sampled_ns[kept], position_rad=truth.position_rad[kept]
    )
    at_ns = np.array([-1, 0, 9_995_000_000, 10_050_000_000, 10_105_000_000, 19_995_000_000, 19_995_000_001])
    known = np.isfinite(at_shift(holed, at_ns, 0)).all(axis=1)
    assert known.tolist() == [False, True, False, False, True, True, False]


def rows_of(moved: MovedSeries, rows: Any) -> MovedSeries:
    return MovedSeries(
        moved.encoder_ns[rows], moved.position_rad[rows], moved.valid[rows], moved.tracking[rows]
    )
