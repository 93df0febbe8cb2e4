import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import signal

from common.quaternion import Array
from master.orientation.lowpass import LowPass, butterworth, group_delay_s

RATE_HZ = 200.0

orders = st.sampled_from([2, 4, 6, 8])
cutoffs = st.floats(0.5, 99.0)


def as_scipy(sections: Array) -> Array:
    return np.insert(sections, 3, 1.0, axis=1)


@given(orders, cutoffs)
def test_coefficients_equal_scipy_s(order: int, cutoff_hz: float) -> None:
    ours = butterworth(order, cutoff_hz, RATE_HZ)
    theirs = signal.butter(order, cutoff_hz, fs=RATE_HZ, output="sos")
    # scipy puts the whole gain into the first section and orders by the poles' distance from the circle
    assert np.prod(ours[:, 0]) == pytest.approx(np.prod(theirs[:, 0]), rel=1e-12)
    assert np.allclose(ours[:, 1:3] / ours[:, :1], [2.0, 1.0], atol=1e-12)
    by_a2 = np.argsort(ours[:, 4])
    expected = theirs[np.argsort(theirs[:, 5]), 4:]
    assert np.allclose(ours[by_a2, 3:], expected, atol=1e-12, rtol=0.0)


@given(orders, cutoffs)
def test_gain_is_one_at_dc_and_half_the_power_at_the_cutoff(order: int, cutoff_hz: float) -> None:
    sections = butterworth(order, cutoff_hz, RATE_HZ)
    _, response = signal.sosfreqz(as_scipy(sections), worN=[0.0, cutoff_hz], fs=RATE_HZ)
    assert abs(response[0]) == pytest.approx(1.0, abs=1e-9)
    assert abs(response[1]) == pytest.approx(np.sqrt(0.5), abs=1e-9)


@given(orders, st.floats(5.0, 90.0))
def test_group_delay_is_that_of_a_slow_ramp(order: int, cutoff_hz: float) -> None:
    sections = butterworth(order, cutoff_hz, RATE_HZ)
    ramp = np.arange(2000) / RATE_HZ
    behind_s = ramp - signal.sosfilt(as_scipy(sections), ramp)
    assert group_delay_s(sections, RATE_HZ) == pytest.approx(behind_s[-1], abs=1e-9)


@pytest.mark.parametrize("order", [2, 4, 8])
def test_response_equals_sosfilt_with_its_steady_start(order: int) -> None:
    cutoffs_hz = (30.0, 50.0, 20.0)
    samples = np.random.default_rng(0).normal(size=(400, 3, 5, 3)) + 9.81
    lowpass = LowPass(cutoffs_hz, order, RATE_HZ, 5)
    ours = np.array([lowpass.update(tick).copy() for tick in samples])
    for i, cutoff_hz in enumerate(cutoffs_hz):
        sos = signal.butter(order, cutoff_hz, fs=RATE_HZ, output="sos")
        start = signal.sosfilt_zi(sos)[..., None, None] * samples[0, i]
        theirs, _ = signal.sosfilt(sos, samples[:, i], axis=0, zi=start.transpose(0, 1, 2, 3))
        assert np.allclose(ours[:, i], theirs, atol=1e-12)


def test_a_constant_never_rings() -> None:
    lowpass = LowPass((30.0, 50.0, 20.0), 4, RATE_HZ, 2)
    samples = np.random.default_rng(1).normal(size=(3, 2, 3))
    for _ in range(50):
        assert np.allclose(lowpass.update(samples), samples, atol=1e-13)


def test_a_cutoff_of_zero_passes_everything_at_once() -> None:
    lowpass = LowPass((0.0, 50.0, 0.0), 2, RATE_HZ, 2)
    rng = np.random.default_rng(1)
    for _ in range(5):
        samples = rng.normal(size=(3, 2, 3))
        out = lowpass.update(samples)
        assert np.array_equal(out[[0, 2]], samples[[0, 2]])
    assert lowpass.delays_s[0] == 0.0
    assert lowpass.delays_s[1] == pytest.approx(group_delay_s(butterworth(2, 50.0, RATE_HZ), RATE_HZ))


def test_nan_poisons_no_other_channel_and_its_own_begins_anew() -> None:
    rng = np.random.default_rng(2)
    samples = rng.normal(size=(60, 3, 4, 3))
    clean, hit = LowPass((30.0, 50.0, 20.0), 4, RATE_HZ, 4), LowPass((30.0, 50.0, 20.0), 4, RATE_HZ, 4)
    for tick, sample in enumerate(samples):
        expected = clean.update(sample).copy()
        if tick < 30:
            sample = sample.copy()
            sample[2, 1] = np.nan
        out = hit.update(sample).copy()
        others = np.ones((3, 4), dtype=np.bool_)
        others[2, 1] = False
        assert np.array_equal(out[others], expected[others])
        assert np.isnan(out[2, 1]).all() == (tick < 30)
        if tick == 30:
            assert np.allclose(out[2, 1], sample[2, 1])


def test_restart_forgets_only_the_nodes_named() -> None:
    lowpass = LowPass((30.0,), 2, RATE_HZ, 3)
    lowpass.update(np.zeros((1, 3, 3)))
    lowpass.restart(np.array([False, True, False]))
    out = lowpass.update(np.ones((1, 3, 3)))
    assert np.allclose(out[0, 1], 1.0)
    assert np.all(out[0, [0, 2]] < 0.5)


@pytest.mark.parametrize("order", [0, 1, 3, -2])
def test_an_order_that_is_not_even(order: int) -> None:
    with pytest.raises(ValueError, match="order must be even"):
        butterworth(order, 30.0, RATE_HZ)


@pytest.mark.parametrize("cutoff_hz", [0.0, -1.0, 100.0, float("nan")])
def test_a_cutoff_that_the_rate_cannot_show(cutoff_hz: float) -> None:
    with pytest.raises(ValueError, match="cutoff_hz must lie between 0 and 100"):
        butterworth(2, cutoff_hz, RATE_HZ)
