from typing import Any

import numpy as np
import pytest
from scipy import signal

from common.quaternion import Array
from deploy.measure import motion
from deploy.measure.roughness import acceleration, low_pass

COUNT_RAD = 2 * np.pi / 4096


def test_a_quantised_copy_is_about_one(run: Any) -> None:
    judged = motion(run.truth(), run.moved(change=lambda p: np.round(p / COUNT_RAD) * COUNT_RAD), run.names)
    assert judged is not None
    assert judged.roughness == pytest.approx(1.0, abs=0.05)


def test_a_staircase_is_rough_and_a_smoothed_one_less(run: Any) -> None:
    moved = run.moved()
    at_s = moved.encoder_ns * 1e-9
    stairs = run.at(np.floor(at_s / 0.08) * 0.08)
    smoothed = np.array([np.convolve(j, np.ones(6) / 6, mode="same") for j in stairs.T]).T
    rough = [judged_roughness(run, moved, position) for position in (stairs, smoothed, run.at(at_s))]
    assert rough[0] > 3.0
    assert rough[0] > 2.0 * rough[1]
    assert rough[2] == pytest.approx(1.0, abs=0.001)


def test_a_short_stretch_gives_no_roughness(run: Any) -> None:
    moved = run.moved()
    # 40 readings tracked and settled at a time: enough of them, but no second unbroken
    moved.tracking[:] = np.arange(len(moved.tracking)) % 100 < 50 + 40
    judged = motion(run.truth(), moved, run.names)
    assert judged is not None
    assert judged.roughness is None
    assert judged.rmse_deg < 0.01


def test_acceleration_of_a_slow_sine_is_its_second_derivative() -> None:
    # readings at 50 Hz with the jitter of a real loop
    rng = np.random.default_rng(3)
    time_s = np.arange(0.0, 6.0, 0.02)
    time_s[1:] += rng.uniform(-0.002, 0.002, len(time_s) - 1)
    sine = np.sin(2 * np.pi * 0.5 * time_s)[:, None]
    out = acceleration(time_s, sine)
    expected = (2 * np.pi * 0.5) ** 2 / np.sqrt(2)
    assert np.sqrt(np.mean(out**2)) == pytest.approx(expected, rel=0.05)


def test_the_low_pass_is_a_butterworth_run_both_ways() -> None:
    rng = np.random.default_rng(4)
    values = np.cumsum(rng.standard_normal((2000, 2)), axis=0)
    # scipy's digital design bends near the Nyquist frequency; at a twentieth of it both agree
    b, a = signal.butter(2, 10.0, fs=2000.0)
    expected = signal.filtfilt(b, a, values, axis=0)
    ours = low_pass(values, 2000.0, 10.0)
    middle = slice(200, -200)
    assert np.abs(ours - expected)[middle].max() < 0.02 * np.ptp(values)


def test_the_low_pass_keeps_a_straight_line() -> None:
    line: Array = np.linspace(0.0, 3.0, 400)[:, None]
    assert low_pass(line, 200.0, 10.0) == pytest.approx(line, abs=1e-9)


def judged_roughness(run: Any, moved: Any, position: Array) -> float:
    moved.position_rad[:] = position
    judged = motion(run.truth(), moved, run.names)
    assert judged is not None
    assert judged.roughness is not None
    return judged.roughness
