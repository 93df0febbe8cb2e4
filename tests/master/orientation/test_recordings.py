"""The filters on real recordings."""

from collections.abc import Callable

import numpy as np
import pytest
from vqf import VQF

from common.quaternion import Array, angle_between, conjugate, multiply
from master.orientation.ekf import EkfConfig, EkfFilter
from master.orientation.filter import OrientationFilter
from master.orientation.mahony import MahonyConfig, MahonyFilter
from master.orientation.vqf import VqfConfig, VqfFilter

LoadRecording = Callable[[str], dict[str, Array]]

TRIALS = [
    "broad_02_undisturbed_slow_rotation_B",
    "broad_06_undisturbed_fast_rotation_A",
    "broad_15_undisturbed_fast_translation_A",
    "broad_25_disturbed_tapping_B",
    "broad_30_disturbed_stationary_magnet_C",
]
REFERENCE_TOTAL_DEG, REFERENCE_INCLINATION_DEG = 8.18, 3.87
"""A tuned Mahony filter's mean over 30 BROAD trials."""


def test_vqf_gives_what_its_package_gives(recording: LoadRecording) -> None:
    data, reference = recording("vqf_imu_data"), recording("vqf_reference_outputs")
    ticks = len(data["gyr"])
    filter_ = VqfFilter(VqfConfig(), float(data["sampling_rate"]), 2)
    no_field = np.full(3, np.nan)
    found = np.empty((ticks, 2, 4))
    for tick in range(ticks):
        gyr, acc = np.tile(data["gyr"][tick], (2, 1)), np.tile(data["acc"][tick], (2, 1))
        filter_.update(gyr, acc, np.stack([data["mag"][tick], no_field]))
        found[tick] = filter_.q_world_from_sensor()
    # the stored outputs are float32
    for column, key in enumerate(("online9D", "online6D")):
        assert np.max(angle_between(found[:, column], reference[key][:ticks])) < 2e-6, key


def test_vqf_on_broad_is_its_package_alone(recording: LoadRecording) -> None:
    for name in TRIALS:
        trial = recording(name)
        rate_hz, ticks = float(trial["rate_hz"]), 12_000
        readings = [np.ascontiguousarray(trial[key][:ticks]) for key in ("gyr", "acc", "mag")]
        expected = VQF(1.0 / rate_hz).updateBatch(*readings)["quat9D"]
        filter_ = VqfFilter(VqfConfig(), rate_hz, 1)
        found = np.empty((ticks, 4))
        for tick, rows in enumerate(zip(*readings, strict=True)):
            filter_.update(*(row[None] for row in rows))
            found[tick] = filter_.q_world_from_sensor()[0]
        assert np.max(angle_between(found, expected)) < 1e-9


def test_mahony_s_error_on_broad_is_no_worse_than_the_reference(recording: LoadRecording) -> None:
    scores = scores_deg(recording, lambda rate_hz, count: MahonyFilter(MahonyConfig(), rate_hz, count))
    total, inclination = np.mean(scores, axis=0)
    assert total <= REFERENCE_TOTAL_DEG
    assert inclination <= REFERENCE_INCLINATION_DEG
    slow_rotation_total, _ = scores[0]
    assert slow_rotation_total < 3.0


@pytest.mark.long
def test_the_ekf_s_error_is_within_five_degrees_on_each_of_broad(recording: LoadRecording) -> None:
    # the figure is for the whole of the recordings, which takes its time
    scores = scores_deg(recording, lambda rate_hz, count: EkfFilter(EkfConfig(), rate_hz, count))
    assert np.max(scores[:, 0]) <= 5.0
    total, inclination = np.mean(scores, axis=0)
    assert total <= 2.5
    assert inclination <= 1.1


def scores_deg(recording: LoadRecording, make: Callable[[float, int], OrientationFilter]) -> Array:
    """Total and inclination error of each trial, (trials, 2), all of them filtered as one suit's nodes."""
    trials = [recording(name) for name in TRIALS]
    ticks = min(len(trial["gyr"]) for trial in trials)
    gyr, acc, mag = (np.stack([t[key][:ticks] for t in trials], axis=1) for key in ("gyr", "acc", "mag"))
    filter_ = make(float(trials[0]["rate_hz"]), len(trials))
    found = np.empty((ticks, len(trials), 4))
    for tick in range(ticks):
        filter_.update(gyr[tick], acc[tick], mag[tick])
        found[tick] = filter_.q_world_from_sensor()
    return np.array([score_deg(found[:, i], trial) for i, trial in enumerate(trials)])


def score_deg(q: Array, trial: dict[str, Array]) -> tuple[float, float]:
    """BROAD's own score: RMSE of the total and of the inclination error while moving."""
    truth = trial["quat"][: len(q)]
    counts = (trial["movement"][: len(q)] > 0) & np.isfinite(truth[:, 0])
    error = multiply(q[counts], conjugate(truth[counts]))
    total = 2.0 * np.arctan2(np.linalg.norm(error[:, 1:], axis=-1), np.abs(error[:, 0]))
    inclination = 2.0 * np.arctan2(np.hypot(error[:, 1], error[:, 2]), np.hypot(error[:, 0], error[:, 3]))
    rms = [float(np.degrees(np.sqrt(np.mean(e**2)))) for e in (total, inclination)]
    return rms[0], rms[1]
