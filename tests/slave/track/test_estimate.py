import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slave.track.estimate import RELAX_PER_S, corrected, first, relaxed

spans = st.floats(0.0, 0.5)


@given(spans, spans)
def test_to_go_on_twice_is_to_go_on_once_for_both(a: float, b: float) -> None:
    np.testing.assert_allclose(relaxed(a) @ relaxed(b), relaxed(a + b), atol=1e-9)


@given(st.floats(0.01, 1.0))
def test_each_row_is_the_slope_of_the_one_above_it(span_s: float) -> None:
    h = 1e-6
    slope = (relaxed(span_s + h) - relaxed(span_s - h)) / (2 * h)
    here, rate = relaxed(span_s), RELAX_PER_S
    np.testing.assert_allclose(slope[:2], here[1:], atol=1e-6)
    np.testing.assert_allclose(slope[2], -(rate**2) * here[1] - 2 * rate * here[2], atol=1e-4)


def test_left_to_itself_it_comes_to_rest() -> None:
    far = relaxed(10.0)
    np.testing.assert_allclose(far[1:], 0.0, atol=1e-12)
    assert far[0, 1] == pytest.approx(2.0 / RELAX_PER_S)


gaps_ns = st.lists(st.integers(1, 400_000_000), min_size=1, max_size=40)


@settings(deadline=None)
@given(gaps_ns, st.booleans(), st.integers(0, 2**32 - 1))
def test_however_samples_come_the_covariance_stays_positive(
    gaps: list[int], velocity_known: bool, seed: int
) -> None:
    random = np.random.default_rng(seed)
    estimate = first(0, np.zeros(3), np.ones(3) * velocity_known)
    for gap_ns in gaps:
        velocity = random.normal(0.0, 3.0, 3) * velocity_known
        estimate = corrected(estimate, estimate.sampled_ns + gap_ns, random.normal(0.0, 1.0, 3), velocity)
        assert np.isfinite(estimate.motion).all()
        assert np.linalg.eigvalsh(estimate.covariance).min() > -1e-12


def test_regular_samples_leave_the_covariance_symmetric_and_positive() -> None:
    estimate = first(0, np.zeros(1), np.ones(1))
    for _ in range(1000):
        estimate = corrected(estimate, estimate.sampled_ns + 80_000_000, np.zeros(1), np.ones(1))
    np.testing.assert_allclose(estimate.covariance, estimate.covariance.T, atol=1e-12)
    assert np.linalg.eigvalsh(estimate.covariance).min() > 0.0


@pytest.mark.parametrize(("by_rad", "anew"), [(0.05, False), (1.0, True), (-1.0, True)])
def test_a_joint_that_is_suddenly_elsewhere_begins_anew_alone(by_rad: float, anew: bool) -> None:
    estimate = first(0, np.zeros(2), np.full(2, 0.01))
    for _ in range(10):
        estimate = corrected(estimate, estimate.sampled_ns + 80_000_000, np.zeros(2), np.full(2, 0.01))
    position = np.array([0.0, by_rad])
    after = corrected(estimate, estimate.sampled_ns + 80_000_000, position, np.full(2, 0.01))
    # no acceleration is made of a jump
    assert (after.motion[2, 1] == 0.0) == anew
    assert after.motion[2, 0] != 0.0
    assert abs(after.motion[0, 0]) < 1e-3
