from collections.abc import Callable
from datetime import date
from pathlib import Path

import numpy as np
import pytest

from common.quaternion import Array
from master.calibrate.accelerometer import norm_errors, solve, start
from master.calibrate.inertial import InertialCalibration, InertialOptions, calibrate_inertial
from master.calibrate.recording import NodeRecording, RecordingError, load_recordings

ACC_GAIN: Array = np.array([[1.03, 0.012, -0.008], [0.0, 0.98, 0.015], [0.0, 0.0, 1.01]])
GYR_GAIN: Array = np.array([[0.97, 0.02, -0.01], [0.01, 1.02, 0.015], [-0.02, 0.005, 1.03]])
ACC_BIAS: Array = np.array([0.3, -0.25, 0.4])
GYR_BIAS: Array = np.array([0.15, -0.1, 0.05])

Worn = Callable[..., NodeRecording]


@pytest.fixture(scope="module")
def worn(session) -> Worn:  # type: ignore[no-untyped-def]
    """The recording of a unit with known errors, noise as of an MPU-6050."""

    def record(noise: float = 1.0, **options: object) -> NodeRecording:
        true = session(**options)
        rng = np.random.default_rng(99)
        acc = (
            true.acc @ np.linalg.inv(ACC_GAIN).T - ACC_BIAS + noise * 0.038 * rng.normal(size=true.acc.shape)
        )
        gyr = true.gyr @ np.linalg.inv(GYR_GAIN).T - GYR_BIAS + noise * 9e-4 * rng.normal(size=true.acc.shape)
        return NodeRecording("unit", true.rate_hz, acc, gyr)

    return record


@pytest.fixture(scope="module")
def calibrated(worn: Worn) -> InertialCalibration:
    return calibrate_inertial(worn())


def test_known_errors_are_found_within_the_stated_uncertainty(calibrated: InertialCalibration) -> None:
    a, g = calibrated.accelerometer, calibrated.gyroscope
    # 24 rests leave the accelerometer 15 degrees of freedom: 5σ of a t-distribution that wide
    assert np.all(np.abs(a.theta - np.r_[ACC_GAIN[np.triu_indices(3)], ACC_BIAS]) < 5 * a.sigma)
    assert np.all(np.abs(g.gain - GYR_GAIN) < 5 * g.sigma)
    assert np.all(np.abs(g.bias - GYR_BIAS) < 5 * g.bias_sigma)
    assert a.sigma.max() < 0.02
    assert g.sigma.max() < 2e-3


def test_all_rests_and_moves_are_found(calibrated: InertialCalibration) -> None:
    assert len(calibrated.still) == 24
    assert len(calibrated.gyroscope.errors_rad) == 23
    assert calibrated.attitudes > 15


def test_readings_come_out_as_they_should(calibrated: InertialCalibration, session) -> None:  # type: ignore[no-untyped-def]
    """On another session than the one fitted to."""
    true = session(seed=7)
    for sensor, gain, bias, truth, limit in (
        ("accelerometer", ACC_GAIN, ACC_BIAS, true.acc, 0.03),
        ("gyroscope", GYR_GAIN, GYR_BIAS, true.gyr, 0.01),
    ):
        affine, made = calibrated.parts(date(2026, 1, 2), "s.npz")[sensor]  # type: ignore[index]
        raw = truth @ np.linalg.inv(gain).T - bias
        assert np.abs(raw @ affine[:, :3].T + affine[:, 3] - truth).max() < limit
        assert made.residual_before is not None
        assert made.residual_after is not None
        assert made.hold_out is not None
        assert made.residual_after < made.hold_out < 0.2 * made.residual_before


def test_a_few_missing_samples_do_no_harm(worn: Worn, calibrated: InertialCalibration) -> None:
    recording = worn()
    recording.gyr_rad_s[350:353] = np.nan
    recording.acc_m_s2[350:353] = np.nan
    recording.gyr_rad_s[800:840] = np.nan
    found = calibrate_inertial(recording)
    assert np.allclose(found.gyroscope.gain, calibrated.gyroscope.gain, atol=3e-3)
    assert len(found.gyroscope.errors_rad) == 22
    assert any("1 of 23 moves left out" in note for note in found.notes)


def test_raw_counts_need_no_nominal_scale(worn: Worn, calibrated: InertialCalibration) -> None:
    raw = worn()
    acc, gyr = (np.rint(32768 + v) for v in (raw.acc_m_s2 * 417.0, raw.gyr_rad_s * 6258.0))
    found = calibrate_inertial(NodeRecording("unit", raw.rate_hz, acc, gyr, counts=True))
    assert np.allclose(found.gyroscope.gain * 6258.0, calibrated.gyroscope.gain, atol=1e-3)
    assert np.allclose(found.accelerometer.gain * 417.0, calibrated.accelerometer.gain, atol=1e-3)
    expected = calibrated.accelerometer.affine[:, 3]
    offset = found.accelerometer.affine @ np.r_[32768.0, 32768.0, 32768.0, 1.0]
    assert np.allclose(offset, expected, atol=5e-3)
    assert any("raw counts" in note for note in found.notes)


def test_a_perfect_unit_gets_the_identity(session) -> None:  # type: ignore[no-untyped-def]
    true = session(attitudes=14)
    found = calibrate_inertial(NodeRecording("unit", true.rate_hz, true.acc, true.gyr))
    assert np.allclose(found.accelerometer.affine, np.eye(3, 4), atol=1e-9)
    assert np.allclose(found.gyroscope.affine, np.eye(3, 4), atol=1e-4)


def clipped_gyro(r: NodeRecording) -> NodeRecording:
    limit = 0.6 * np.abs(r.gyr_rad_s).max()
    return NodeRecording("unit", r.rate_hz, r.acc_m_s2, np.clip(r.gyr_rad_s, -limit, limit))


def clipped_acc(r: NodeRecording) -> NodeRecording:
    return NodeRecording("unit", r.rate_hz, np.clip(r.acc_m_s2, -6.0, 6.0), r.gyr_rad_s)


def mostly_clipped_acc(r: NodeRecording) -> NodeRecording:
    """At rest too: in most attitudes some axis stands still at the end of its range."""
    return NodeRecording("unit", r.rate_hz, np.clip(r.acc_m_s2, -4.0, 4.0), r.gyr_rad_s)


def constant(r: NodeRecording) -> NodeRecording:
    acc = r.acc_m_s2.copy()
    acc[:, 1] = 3.0
    return NodeRecording("unit", r.rate_hz, acc, r.gyr_rad_s)


def gaps(r: NodeRecording) -> NodeRecording:
    gyr = r.gyr_rad_s.copy()
    gyr[::5] = np.nan
    return NodeRecording("unit", r.rate_hz, r.acc_m_s2, gyr)


def other_rate(r: NodeRecording) -> NodeRecording:
    return NodeRecording("unit", 0.5 * r.rate_hz, r.acc_m_s2, r.gyr_rad_s)


def slightly_other_rate(r: NodeRecording) -> NodeRecording:
    return NodeRecording("unit", 0.87 * r.rate_hz, r.acc_m_s2, r.gyr_rad_s)


def in_g(r: NodeRecording) -> NodeRecording:
    return NodeRecording("unit", r.rate_hz, r.acc_m_s2 / 9.81, r.gyr_rad_s)


def in_degrees(r: NodeRecording) -> NodeRecording:
    return NodeRecording("unit", r.rate_hz, r.acc_m_s2, np.degrees(r.gyr_rad_s))


def swapped(r: NodeRecording) -> NodeRecording:
    return NodeRecording("unit", r.rate_hz, r.acc_m_s2, r.gyr_rad_s[:, [1, 0, 2]])


def in_degrees_and_swapped(r: NodeRecording) -> NodeRecording:
    return NodeRecording("unit", r.rate_hz, r.acc_m_s2, np.degrees(r.gyr_rad_s[:, [1, 0, 2]]))


def negated(r: NodeRecording) -> NodeRecording:
    return NodeRecording("unit", r.rate_hz, r.acc_m_s2, r.gyr_rad_s * [1.0, 1.0, -1.0])


def mirrored_acc(r: NodeRecording) -> NodeRecording:
    return NodeRecording("unit", r.rate_hz, r.acc_m_s2 * [-1.0, 1.0, 1.0], r.gyr_rad_s)


def briefly_clipped_gyro(r: NodeRecording) -> NodeRecording:
    limit = 0.93 * np.abs(r.gyr_rad_s).max()
    return NodeRecording("unit", r.rate_hz, r.acc_m_s2, np.clip(r.gyr_rad_s, -limit, limit))


def few_in_g(r: NodeRecording) -> NodeRecording:
    return NodeRecording("unit", r.rate_hz, r.acc_m_s2[:3000] / 9.81, r.gyr_rad_s[:3000])


def in_milli_g(r: NodeRecording) -> NodeRecording:
    return NodeRecording("unit", r.rate_hz, r.acc_m_s2 / 9.81e-3, r.gyr_rad_s)


def counts_negated(r: NodeRecording) -> NodeRecording:
    acc, gyr = np.rint(r.acc_m_s2 * 417.0), np.rint(r.gyr_rad_s * [-1.0, 1.0, 1.0] * 6258.0)
    return NodeRecording("unit", r.rate_hz, acc, gyr, counts=True)


def few(r: NodeRecording) -> NodeRecording:
    return NodeRecording("unit", r.rate_hz, r.acc_m_s2[:3000], r.gyr_rad_s[:3000])


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (clipped_gyro, r"gyroscope is clipped on [xyz]: .*turn the node more slowly"),
        (clipped_acc, r"accelerometer is clipped on [xyz]: "),
        (mostly_clipped_acc, r"accelerometer is clipped on [xyz]: "),
        (constant, r"accelerometer reads the same all along on y"),
        (gaps, r"20 % of the gyroscope's readings are missing"),
        (other_rate, r"gravity turns 0.5 times .* is the rate of the recording right"),
        (slightly_other_rate, r"off together by a factor of 0\.88, .*is the rate of the recording right"),
        (in_g, r"that is g, not m/s²"),
        (in_degrees, r"in °/s, not rad/s"),
        (swapped, r"gravity turns|does not explain how gravity turns"),
        (in_degrees_and_swapped, r"gyroscope's x and y axes are swapped.*in °/s, not rad/s"),
        (
            negated,
            r"does not explain how gravity turns .*the gyroscope's z axis is negated \(a mirror image\)",
        ),
        (mirrored_acc, r"the accelerometer's x axis is negated \(a mirror image\)"),
        (counts_negated, r"the gyroscope's x axis is negated"),
        (briefly_clipped_gyro, r"gyroscope is clipped"),
        (few_in_g, r"that is g, not m/s²"),
        (in_milli_g, r"thousandths of g"),
        (few, r"too few attitudes: 7 rests"),
    ],
)
def test_what_cannot_be_calibrated_from_is_refused(
    worn: Worn, spoil: Callable[[NodeRecording], NodeRecording], message: str
) -> None:
    with pytest.raises(RecordingError, match=message):
        calibrate_inertial(spoil(worn()))


def test_many_attitudes_in_one_plane_are_refused(worn: Worn, session) -> None:  # type: ignore[no-untyped-def]
    level_axis = np.cross(session(attitudes=1).acc[0], [1.0, 0.0, 0.0])
    with pytest.raises(RecordingError, match=r"attitudes are too similar"):
        calibrate_inertial(worn(axis=level_axis))


def test_moves_about_one_axis_only_are_refused(worn: Worn) -> None:
    """Attitudes enough for the accelerometer, but of all moves only those about z have no gap."""
    free, about_z = worn(attitudes=16), worn(attitudes=12, seed=3, axis=np.array([0.0, 0.0, 1.0]))
    for move in range(16):
        free.gyr_rad_s[450 * move + 370 : 450 * move + 380] = np.nan
    acc, gyr = (
        np.concatenate(pair)
        for pair in ((free.acc_m_s2, about_z.acc_m_s2), (free.gyr_rad_s, about_z.gyr_rad_s))
    )
    with pytest.raises(RecordingError, match=r"moves do not determine the gyroscope's matrix"):
        calibrate_inertial(NodeRecording("unit", 100.0, acc, gyr))


def test_a_node_that_is_never_still_is_refused() -> None:
    rng = np.random.default_rng(0)
    gyr = np.cumsum(rng.normal(size=(6000, 3)), axis=0) * 0.02
    with pytest.raises(RecordingError, match="too few attitudes"):
        calibrate_inertial(NodeRecording("unit", 100.0, rng.normal(size=(6000, 3)) + 9.0, gyr))


def imutk(folder: Path) -> NodeRecording:
    path = folder / "imutk_xsens.npz"
    if not path.exists():
        pytest.skip(f"{path.name} is not in TANDEM_DATA")
    return load_recordings(path)["imutk_xsens"]


def test_on_imu_tks_own_samples_the_solver_reaches_its_cost(recordings_folder: Path) -> None:
    """Tedaldi et al.'s detector, and ½ Σ (g - ‖a‖)² over the first hundred samples of each of its rests."""
    counts = imutk(recordings_folder).acc_m_s2
    nominal = (counts - 32768.0) / 415.0
    level = np.linalg.norm(
        np.lib.stride_tricks.sliding_window_view(nominal, 101, axis=0).var(axis=-1), axis=1
    )
    still = level < 6.0 * np.linalg.norm(nominal[:3000].var(axis=0))
    edges = np.flatnonzero(np.diff(np.r_[0, still.astype(int), 0])).reshape(-1, 2) + 50
    first = [a for a, b in edges if b - a >= 100]
    assert len(first) == 38
    samples = np.concatenate([counts[a : a + 100] for a in first])
    theta = solve(samples, 9.81744, start(samples, 9.81744, counts=True))
    assert 0.5 * np.sum(norm_errors(theta, samples, 9.81744) ** 2) <= 0.1203


def test_the_figures_on_a_real_session(recordings_folder: Path) -> None:
    raw = imutk(recordings_folder)
    found = calibrate_inertial(raw, InertialOptions(gravity_m_s2=9.81744))
    assert len(found.still) == 38
    assert found.accelerometer.cost <= 0.02
    assert np.mean(np.abs(found.accelerometer.residuals_m_s2)) <= 0.00113
    assert np.mean(np.abs(found.accelerometer.hold_out_m_s2)) <= 0.0017
    assert np.degrees(np.mean(found.gyroscope.errors_rad)) <= 0.52
    assert np.degrees(np.mean(found.gyroscope.hold_out_rad)) <= 0.78
