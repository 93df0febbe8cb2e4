from datetime import date
from pathlib import Path

import numpy as np
import pytest

from common.config.load import load_config
from common.config.sensor_calibration import Made, NodeCalibration
from common.errors import ConfigError, TandemError
from common.quaternion import Array
from master.calibrate.node_file import write_calibration
from master.orientation.affine import ACC, load_calibration

MADE = Made(date=date(2026, 11, 22), recording="session.npz", unit="m/s²", residual_after=0.00113)
MAP: Array = np.array([[1.1, 0.01, 0.0, 0.2], [0.0, 0.9, 0.02, -0.1], [0.0, 0.0, 1.0, 1.0 / 3.0]])


def test_the_master_reads_back_what_was_written(tmp_path: Path) -> None:
    path = tmp_path / "new" / "node.toml"
    write_calibration(path, {"accelerometer": (MAP, MADE)})
    assert np.allclose(load_calibration([path]).affine[ACC, 0], MAP, rtol=1e-9, atol=0.0)
    read = load_config(path, NodeCalibration).made
    assert read.accelerometer == MADE
    assert read.gyroscope is None
    assert list(path.parent.iterdir()) == [path]


def test_other_parts_and_comments_stay(tmp_path: Path) -> None:
    path = tmp_path / "node.toml"
    path.write_text(
        "# worn by nurse 1\ngyroscope = [[1, 0, 0, 0.5], [0, 1, 0, 0], [0, 0, 1, 0]] # by hand\n"
        '[made.gyroscope]\ndate = 2026-01-02\nrecording = "old.npz"\nunit = "rad"\n'
    )
    write_calibration(path, {"accelerometer": (MAP, MADE)})
    write_calibration(path, {"alignment": (np.array([0.8, 0.6, 0.0, 0.0]), MADE)})
    text = path.read_text()
    assert "# worn by nurse 1" in text
    assert "# by hand" in text
    node = load_config(path, NodeCalibration)
    assert node.gyroscope[0][3] == 0.5
    assert node.made.gyroscope is not None
    assert node.made.gyroscope.recording == "old.npz"
    assert node.made.accelerometer == node.made.alignment == MADE
    assert node.q_sensor_from_segment == [0.8, 0.6, 0.0, 0.0]


def test_a_part_written_again_replaces_the_old_one(tmp_path: Path) -> None:
    path = tmp_path / "node.toml"
    write_calibration(path, {"accelerometer": (MAP, MADE.model_copy(update={"hold_out": 0.002}))})
    write_calibration(path, {"accelerometer": (MAP + 0.01, MADE)})
    assert load_config(path, NodeCalibration).made.accelerometer == MADE
    assert load_config(path, NodeCalibration).accelerometer[0][0] == pytest.approx(1.11)


@pytest.mark.parametrize("old", ["", "gyroscop = 1\n", "made = 3\n", "= nonsense"])
def test_what_is_not_sound_is_not_written(tmp_path: Path, old: str) -> None:
    path = tmp_path / "node.toml"
    path.write_text(old)
    singular = np.zeros((3, 4))
    with pytest.raises(ConfigError, match=r"node\.toml"):
        write_calibration(path, {"accelerometer": (MAP if "gyr" in old or "nons" in old else singular, MADE)})
    assert path.read_text() == old
    assert list(tmp_path.iterdir()) == [path]


def test_a_disk_that_takes_nothing_is_said(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(TandemError, match=r"node\.toml: cannot be written"):
        write_calibration(tmp_path / "file" / "node.toml", {"accelerometer": (MAP, MADE)})
    (tmp_path / "node.toml").mkdir()
    with pytest.raises(ConfigError, match="expected a readable file"):
        write_calibration(tmp_path / "node.toml", {"accelerometer": (MAP, MADE)})


def test_an_alignment_by_its_old_name_is_read_and_then_replaced(tmp_path: Path) -> None:
    path = tmp_path / "node.toml"
    path.write_text(
        "q_sensor_from_segment = [0.6, 0.8, 0.0, 0.0]\n[made.mounting]\n"
        'date = 2026-01-02\nrecording = "old.npz"\nunit = "rad"\n'
    )
    made = load_config(path, NodeCalibration).made.alignment
    assert made is not None
    assert made.recording == "old.npz"
    write_calibration(path, {"alignment": (np.array([0.8, 0.6, 0.0, 0.0]), MADE)})
    assert load_config(path, NodeCalibration).made.alignment == MADE
    assert "mounting" not in path.read_text()
