from pathlib import Path

import numpy as np
import pytest

from common.errors import ConfigError
from master.orientation.affine import ACC, GYR, MAG, apply, identity, load_calibration

NODE = """
accelerometer = [[1.1, 0.01, 0, 0.2], [0, 0.9, 0.02, -0.1], [0, 0, 1.0, 0.3]]
gyroscope = [[1, 0, 0, 0.01], [0, 1, 0, 0.02], [0, 0, 1, -0.03]]
q_sensor_from_segment = [0.8, 0.6, 0, 0]
"""


def write(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "node.toml"
    path.write_text(text)
    return path


def test_identity_leaves_the_readings_as_they_come() -> None:
    samples = np.random.default_rng(0).normal(size=(3, 5, 3))
    calibration = identity(5)
    assert np.array_equal(apply(calibration.affine, samples), samples)
    assert np.array_equal(calibration.q_sensor_from_segment, np.tile([1.0, 0.0, 0.0, 0.0], (5, 1)))


def test_each_sensor_of_each_node_gets_its_own_map(tmp_path: Path) -> None:
    calibration = load_calibration([None, write(tmp_path, NODE)])
    assert calibration.affine.shape == (3, 2, 3, 4)
    samples = np.random.default_rng(0).normal(size=(3, 2, 3))
    out = apply(calibration.affine, samples)
    x, y, z = samples[ACC, 1]
    expected = [1.1 * x + 0.01 * y + 0.2, 0.9 * y + 0.02 * z - 0.1, z + 0.3]
    assert np.allclose(out[ACC, 1], expected, atol=1e-15)
    assert np.allclose(out[GYR, 1], samples[GYR, 1] + [0.01, 0.02, -0.03], atol=1e-15)
    assert np.array_equal(out[MAG], samples[MAG])
    assert np.array_equal(out[:, 0], samples[:, 0])
    assert np.allclose(calibration.q_sensor_from_segment[1], [0.8, 0.6, 0.0, 0.0])


def test_nan_stays_within_its_sensor(tmp_path: Path) -> None:
    calibration = load_calibration([write(tmp_path, NODE)] * 2)
    samples = np.ones((3, 2, 3))
    samples[MAG, 0] = np.nan
    out = apply(calibration.affine, samples)
    assert np.isnan(out[MAG, 0]).all()
    assert np.isfinite(np.delete(out.reshape(6, 3), 2 * MAG, 0)).all()


def test_a_nearly_unit_alignment_is_normalised(tmp_path: Path) -> None:
    path = write(tmp_path, "q_sensor_from_segment = [0.7071, 0.7071, 0, 0]")
    assert np.linalg.norm(load_calibration([path]).q_sensor_from_segment[0]) == pytest.approx(1.0, abs=1e-15)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("gyroscope = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]", r"gyroscope = .*: expected 3 rows of 4 numbers"),
        ("gyroscope = [[1, 0, 0, 0], [0, 1, 0, 0]]", r"gyroscope = .*: expected 3 rows of 4 numbers"),
        ("gyroscope = 1.0", r"gyroscope = 1\.0: expected a valid list"),
        (
            "magnetometer = [[1, 0, 0, nan], [0, 1, 0, 0], [0, 0, 1, 0]]",
            r"magnetometer\.0\.3 = nan: expected a finite number",
        ),
        (
            "magnetometer = [[inf, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]",
            r"magnetometer\.0\.0 = inf: expected a finite number",
        ),
        (
            "accelerometer = [[1, 0, 0, 0], [0, 1, 0, 0], [1, 1, 0, 0]]",
            r"accelerometer = .*: expected three independent rows",
        ),
        (
            "accelerometer = [['a', 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]",
            r"accelerometer\.0\.0 = 'a': expected a valid number",
        ),
        ("q_sensor_from_segment = [1, 1, 0, 0]", r"q_sensor_from_segment = .*: expected a unit quaternion"),
        ("q_sensor_from_segment = [1, 0, 0]", r"q_sensor_from_segment = .*: expected a unit quaternion"),
        (
            "q_sensor_from_segment = [nan, 0, 0, 1]",
            r"q_sensor_from_segment\.0 = nan: expected a finite number",
        ),
        (
            "gyroscope = [[0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0]]",
            r"gyroscope = .*: expected three independent",
        ),
        ("compass = 1", r"compass = 1: expected no such key"),
    ],
)
def test_a_mistake_names_file_key_value_and_expectation(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(ConfigError, match=rf"node\.toml: {message}"):
        load_calibration([None, write(tmp_path, text)])


@pytest.mark.parametrize(("last", "singular"), [("1e-5", False), ("1e-7", True), ("0", True)])
def test_a_map_that_all_but_loses_a_direction_is_singular(tmp_path: Path, last: str, singular: bool) -> None:
    path = write(tmp_path, f"gyroscope = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, {last}, 0]]")
    if singular:
        with pytest.raises(ConfigError, match="three independent rows"):
            load_calibration([path])
    else:
        load_calibration([path])


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"gone\.toml: file = .*: expected a readable file"):
        load_calibration([tmp_path / "gone.toml"])
