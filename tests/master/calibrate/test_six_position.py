from pathlib import Path

import numpy as np
import pytest

from common.quaternion import Array, conjugate, from_rotation_vector, multiply, rotate
from master.calibrate.inertial import calibrate_inertial
from master.calibrate.recording import NodeRecording, RecordingError
from master.calibrate.six_position_session import SixPositionOptions, calibrate_six_position

RATE_HZ = 100.0
ACC_GAIN: Array = np.array([[1.03, 0.012, -0.008], [0.02, 0.98, 0.015], [-0.01, 0.004, 1.01]])
GYR_GAIN: Array = np.array([[0.97, 0.02, -0.01], [0.01, 1.02, 0.015], [-0.02, 0.005, 1.03]])
ACC_BIAS: Array = np.array([0.3, -0.25, 0.4])
GYR_BIAS: Array = np.array([0.05, -0.03, 0.02])
# from face to face, whatever the order; then rolled over by a whole turn about each axis
FLIPS: tuple[tuple[float, float, float], ...] = (
    (90, 0, 0),
    (180, 0, 0),
    (-90, 0, 0),
    (0, 90, 0),
    (0, 180, 0),
)
WHOLE: tuple[tuple[float, float, float], ...] = ((360, 0, 0), (0, -360, 0), (0, 0, 360))


def session(
    turns: tuple[tuple[float, float, float], ...] = FLIPS + WHOLE,
    seed: int = 0,
    noise: float = 1.0,
    tilt_deg: float = 0.3,
) -> tuple[Array, Array]:
    """True force and rate of a unit that rests between turns (degrees), laid down `tilt_deg` askew."""
    rng = np.random.default_rng(seed)
    x = np.arange(300) / 300.0
    progress, speed = 10 * x**3 - 15 * x**4 + 6 * x**5, 30 * x**2 * (1 - x) ** 2 / 3.0
    q, rows, rates = np.array([1.0, 0.0, 0.0, 0.0]), [], []
    for turn in ((0.0, 0.0, 0.0), *turns):
        v = np.radians(turn)
        rows += [multiply(q, from_rotation_vector(progress[:, None] * v))]
        rates += [speed[:, None] * v]
        q = multiply(q, from_rotation_vector(v))
        rows.append(np.tile(q, (250, 1)))
        rates.append(np.zeros((250, 3)))
    up = np.array([0.0, 0.0, 9.80665])
    table = from_rotation_vector(np.radians(tilt_deg) * rng.normal(size=3))
    acc = rotate(conjugate(multiply(table, np.concatenate(rows))), up)
    return acc, np.concatenate(rates)


def recorded(acc: Array, gyr: Array, noise: float = 1.0, seed: int = 0) -> NodeRecording:
    rng = np.random.default_rng([seed, 1])
    read = acc @ np.linalg.inv(ACC_GAIN).T - ACC_BIAS + noise * 0.03 * rng.normal(size=acc.shape)
    turn = gyr @ np.linalg.inv(GYR_GAIN).T - GYR_BIAS + noise * 2e-3 * rng.normal(size=acc.shape)
    return NodeRecording("unit", RATE_HZ, read, turn)


@pytest.mark.parametrize("seed", range(6))
def test_both_sensors_are_found_within_what_is_stated(seed: int) -> None:
    found = calibrate_six_position(recorded(*session(seed=seed), seed=seed))
    a, g = found.accelerometer, found.gyroscope
    assert np.all(np.abs(a.affine - np.column_stack([ACC_GAIN, ACC_GAIN @ ACC_BIAS])) < 3.5 * a.sigma)
    assert np.all(np.abs(g.affine - np.column_stack([GYR_GAIN, GYR_GAIN @ GYR_BIAS])) < 3.5 * g.sigma)
    assert np.abs(np.diag(a.affine) - np.diag(ACC_GAIN)).max() < 2e-3
    assert np.abs(g.affine[:, :3] - GYR_GAIN).max() < 5e-3
    assert [e.verdict for e in found.evidence] == ["agrees"] * len(found.evidence)


def test_six_faces_are_enough_here_and_too_few_for_many_attitudes() -> None:
    recording = recorded(*session())
    calibrate_six_position(recording)
    with pytest.raises(RecordingError, match="at least 12 are needed"):
        calibrate_inertial(recording)


def test_on_a_turntable_any_angle_about_the_vertical() -> None:
    x, y = (400.0, 0.0, 0.0), (0.0, 400.0, 0.0)
    turns = ((0.0, 0.0, 400.0), FLIPS[0], y, *FLIPS[1:4], x, FLIPS[4])
    found = calibrate_six_position(recorded(*session(turns)), SixPositionOptions(turn_rad=np.radians(400.0)))
    assert np.abs(found.gyroscope.affine[:, :3] - GYR_GAIN).max() < 6e-3


def test_raw_counts_too() -> None:
    raw = recorded(*session())
    acc, gyr = (np.rint(32768 + v) for v in (raw.acc_m_s2 * 417.0, raw.gyr_rad_s * 2000.0))
    found = calibrate_six_position(NodeRecording("unit", RATE_HZ, acc, gyr, counts=True))
    assert np.abs(found.accelerometer.affine[:, :3] * 417.0 - ACC_GAIN).max() < 0.02
    assert np.abs(found.gyroscope.affine[:, :3] * 2000.0 - GYR_GAIN).max() < 8e-3
    zero = found.accelerometer.affine @ [32768.0, 32768.0, 32768.0, 1.0]
    assert np.allclose(zero, ACC_GAIN @ ACC_BIAS, atol=0.15)


def changed(name: str) -> NodeRecording:
    sound = recorded(*session())
    acc, gyr = sound.acc_m_s2, sound.gyr_rad_s
    if name == "one face missing":
        return recorded(*session(FLIPS[:4] + WHOLE))
    if name == "one turn missing":
        return recorded(*session(FLIPS + WHOLE[:2]))
    if name == "negated":
        gyr = gyr * [1.0, 1.0, -1.0]
    if name == "swapped":
        gyr = gyr[:, [1, 0, 2]]
    if name == "degrees":
        gyr = np.degrees(gyr)
    if name == "g":
        acc = acc / 9.80665
    if name == "clipped":
        gyr = np.clip(gyr, -2.0, 2.0)
    return NodeRecording("unit", RATE_HZ, acc, gyr)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("one face missing", r"no rest with gravity along .* was found|rests of"),
        ("one turn missing", r"no turn by 360° about z was found"),
        ("negated", r"does not explain how gravity turns.*z axis is negated"),
        ("swapped", r"does not explain how gravity turns.*x and y axes are swapped"),
        ("degrees", r"in °/s, not rad/s"),
        ("g", r"that is g, not m/s²"),
        ("clipped", r"gyroscope is clipped"),
    ],
)
def test_what_contradicts_itself_is_refused(name: str, message: str) -> None:
    with pytest.raises(RecordingError, match=message):
        calibrate_six_position(changed(name))


def test_a_session_without_ways_between_faces_judges_no_signs(tmp_path: Path) -> None:
    turns = ((0.0, 0.0, 360.0), FLIPS[0], (0.0, 360.0, 0.0), *FLIPS[1:4], (360.0, 0.0, 0.0), FLIPS[4])
    acc, gyr = session(turns)
    flipped = np.abs(gyr).max(axis=1) > 0.0
    flipped &= ~np.isin((np.arange(len(acc)) - 250) // 550, [0, 2, 6])
    found = calibrate_six_position(recorded(acc[~flipped], gyr[~flipped]))
    assert any("not judged: gyroscope's axes" in note for note in found.notes)
