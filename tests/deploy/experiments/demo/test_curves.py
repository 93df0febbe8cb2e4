"""A run's curves: what is computed, and the picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from common.skeleton import load_skeleton
from deploy.experiments.demo.curves import Curves, curves, groups
from deploy.experiments.demo.draw_curves import as_png
from deploy.measure import MovedSeries, TruthSeries
from deploy.measure.trace import Nanoseconds

HAND = load_skeleton("hand")
J = len(HAND.joints)
SWING_RAD, TURN_RAD_S = 0.6, 2.0 * np.pi * 0.5
BEGIN_NS = 5_000_000_000


def swing(at_ns: Nanoseconds) -> np.ndarray:
    """Each joint with its own amplitude, and its own phase."""
    phase = TURN_RAD_S * at_ns[:, None] / 1e9 + np.arange(J)
    out: np.ndarray = SWING_RAD * np.linspace(0.5, 1.0, J) * np.sin(phase)
    return out


def moved(keep: slice = slice(None), track_from: int = 50) -> MovedSeries:
    """Ten seconds of encoders at 50 Hz, in track after the first."""
    at_ns = BEGIN_NS + 20_000_000 * np.arange(500)
    tracking = np.arange(500) >= track_from
    everything = np.ones((500, J), np.bool_)
    return MovedSeries(at_ns[keep], swing(at_ns[keep]), everything[keep], tracking[keep])


def truth() -> TruthSeries:
    at_ns = BEGIN_NS - 100_000_000 + 5_000_000 * np.arange(2100)
    return TruthSeries(np.arange(2100), at_ns, swing(at_ns))


def known() -> Curves:
    found = curves(truth(), moved(), HAND)
    assert found is not None
    return found


def test_angles_and_velocities_are_those_of_the_motion() -> None:
    found = known()
    at_ns = BEGIN_NS + 1_000_000_000 + np.rint(1e9 * found.time_s).astype(np.int64)
    angle = np.degrees(swing(at_ns))
    rate = np.degrees(np.gradient(swing(at_ns), found.time_s, axis=0))
    inside = slice(60, -60)  # the ends of a filtered series are guesses
    assert found.operator is not None
    for course in (found.robot, found.operator):
        np.testing.assert_allclose(course.angle_deg, angle, atol=0.2)
        np.testing.assert_allclose(course.rate_deg_s[inside], rate[inside], atol=1.0)


def test_a_silence_of_the_encoders_is_a_gap_and_not_a_line() -> None:
    found = curves(truth(), moved(keep=np.r_[0:200, 250:500]), HAND)
    assert found is not None
    silent = (found.time_s > 3.05) & (found.time_s < 3.95)
    assert np.isnan(found.robot.angle_deg[silent]).all()
    assert np.isfinite(found.robot.angle_deg[found.time_s < 2.9]).all()
    assert found.operator is not None
    assert np.isfinite(found.operator.angle_deg).all()


def test_a_recording_s_run_has_no_truth_to_draw() -> None:
    nothing = TruthSeries(np.empty(0, np.int64), np.empty(0, np.int64), np.empty((0, J)))
    found = curves(nothing, moved(), HAND)
    assert found is not None
    assert found.operator is None


@pytest.mark.parametrize("track_from", [480, 500])
def test_a_robot_that_hardly_tracked_has_no_curves(track_from: int) -> None:
    assert curves(truth(), moved(track_from=track_from), HAND) is None


def test_a_finger_s_joints_stand_together() -> None:
    found = groups(HAND)
    assert [g.title for g in found] == [f"right {f}" for f in ("thumb", "index", "middle", "ring", "little")]
    assert found[0].labels == ("mpj", "ipj")
    assert found[1].labels == ("mpj", "pipj", "dipj")
    assert sorted(j for g in found for j in g.joints) == list(range(J))


def test_without_synergies_both_sides_of_a_joint_stand_together() -> None:
    legs, body = groups(load_skeleton("lower_limb")), groups(load_skeleton("nursing"))
    assert [g.title for g in legs][:2] == ["hip flexion", "hip abduction"]
    assert all(g.labels == ("left", "right") for g in legs)
    assert (body[0].title, body[0].labels) == ("neck yaw", ("neck_yaw",))
    assert sum(len(g.joints) for g in body) == 25


@pytest.mark.parametrize("with_truth", [True, False])
def test_the_picture_is_a_png_of_a_row_a_finger(tmp_path: Path, with_truth: bool) -> None:
    from matplotlib.image import imread

    drawn = known()
    operator = drawn.operator if with_truth else None
    as_png(Curves(drawn.time_s, drawn.robot, operator, drawn.groups), tmp_path / "fingers.png")
    picture = imread(tmp_path / "fingers.png")
    assert picture.shape[0] > 1000
    assert picture.shape[1] > 1000
    assert picture.std() > 0.05
