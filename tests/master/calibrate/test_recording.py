from pathlib import Path

import numpy as np
import pytest

from common.quaternion import Array
from master.calibrate.recording import RecordingError, load_recordings

ROWS = np.arange(300.0).reshape(100, 3)


def saved(tmp_path: Path, **arrays: object) -> Path:
    path = tmp_path / "unit.npz"
    np.savez(path, **arrays)  # type: ignore[arg-type]
    return path


def test_one_unit(tmp_path: Path) -> None:
    nodes = load_recordings(saved(tmp_path, acc=ROWS, gyr=-ROWS, rate_hz=285.7))
    assert list(nodes) == ["unit"]
    node = nodes["unit"]
    assert (node.name, node.rate_hz, node.mag_ut, node.counts) == ("unit", 285.7, None, False)
    assert np.array_equal(node.acc_m_s2, ROWS)
    assert np.array_equal(node.gyr_rad_s, -ROWS)
    assert node.duration_s == pytest.approx(100 / 285.7)


def test_a_suit_one_node_with_a_magnetometer(tmp_path: Path) -> None:
    time = 40.0 + np.arange(100) * 0.01
    path = saved(
        tmp_path, t_s=time, head_acc=ROWS, head_gyr=ROWS, hip_acc=ROWS, hip_gyr=ROWS, hip_mag=2 * ROWS
    )
    nodes = load_recordings(path)
    assert list(nodes) == ["head", "hip"]
    assert nodes["head"].mag_ut is None
    mag = nodes["hip"].mag_ut
    assert mag is not None
    assert np.array_equal(mag, 2 * ROWS)
    assert nodes["hip"].rate_hz == pytest.approx(100.0)


def test_raw_counts_are_marked(tmp_path: Path) -> None:
    counts = ROWS.astype(np.uint16)
    node = load_recordings(saved(tmp_path, t=np.arange(100) * 0.01, acc_raw=counts, gyr_raw=counts))["unit"]
    assert node.counts
    assert np.array_equal(node.acc_m_s2, ROWS)


def test_a_sample_that_is_missing_leaves_its_row_empty(tmp_path: Path) -> None:
    time = np.delete(np.arange(100) * 0.01, [40, 41, 70])
    rows = np.delete(ROWS, [40, 41, 70], axis=0)
    node = load_recordings(saved(tmp_path, t_s=time, n_acc=rows, n_gyr=rows))["n"]
    assert np.flatnonzero(np.isnan(node.gyr_rad_s).any(axis=1)).tolist() == [40, 41, 70]
    assert np.array_equal(node.gyr_rad_s[42:70], ROWS[42:70])
    assert node.rate_hz == pytest.approx(100.0)


def test_the_rate_is_of_the_whole_recording(tmp_path: Path) -> None:
    """Stamps rounded to ms: the median step alone would be 5 % off."""
    time = np.round(np.arange(100) * 0.0095, 3)
    node = load_recordings(saved(tmp_path, t_s=time, n_acc=ROWS, n_gyr=ROWS))["n"]
    assert node.rate_hz == pytest.approx(1 / 0.0095, rel=2e-3)


EVEN: Array = np.arange(100, dtype=np.float64) * 0.01


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"acc": ROWS, "gyr": ROWS}, "neither rate_hz nor t_s"),
        ({"acc": ROWS, "gyr": ROWS, "rate_hz": 0.01}, "a rate of 0.01 Hz"),
        ({"acc": ROWS, "gyr": ROWS, "rate_hz": np.nan}, "a rate of nan Hz"),
        ({"acc": ROWS, "rate_hz": 100.0}, "has no array gyr"),
        ({"acc": ROWS[:, :2], "gyr": ROWS, "rate_hz": 100.0}, "acc is float64 of shape"),
        ({"acc": ROWS[:50], "gyr": ROWS, "rate_hz": 100.0}, "differ in length"),
        ({"quat": ROWS}, "has no gyroscope"),
        ({"n_acc": ROWS, "n_gyr": ROWS}, "has no array t_s"),
        ({"n_acc": ROWS, "n_gyr": ROWS, "t_s": EVEN[::-1]}, "does not rise"),
        ({"n_acc": ROWS, "n_gyr": ROWS, "t_s": EVEN * 1e5}, "are the times in seconds"),
        ({"n_acc": ROWS, "n_gyr": ROWS, "t_s": EVEN**1.5}, "not evenly spaced"),
        ({"n_acc": ROWS, "n_gyr": ROWS, "t_s": EVEN + np.arange(100) // 5 * 0.1}, "more than half"),
        ({"n_acc": ROWS, "n_gyr": ROWS, "t_s": EVEN * np.nan}, "finite times"),
        ({"n_acc": ROWS, "n_gyr": ROWS, "t_s": np.float64(3.0)}, "a row of times"),
        ({"n_acc": ROWS, "n_gyr": ROWS, "t_s": np.full(len(ROWS), "now")}, "a row of times"),
        ({"acc": ROWS, "gyr": ROWS, "rate_hz": "fast"}, "rate_hz is fast; expected one number"),
        ({"acc": ROWS, "gyr": ROWS, "rate_hz": 1j}, "expected one number"),
        ({"../n_acc": ROWS, "../n_gyr": ROWS, "t_s": EVEN}, "cannot be a node's name"),
        ({"_acc": ROWS, "_gyr": ROWS, "t_s": EVEN}, "cannot be a node's name"),
    ],
)
def test_what_cannot_be_read_is_refused(tmp_path: Path, arrays: dict[str, object], message: str) -> None:
    with pytest.raises(RecordingError, match=message) as refused:
        load_recordings(saved(tmp_path, **arrays))
    assert "unit.npz" in str(refused.value)


def test_files_that_are_none(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="no such file"):
        load_recordings(tmp_path / "none.npz")
    with pytest.raises(RecordingError, match=r"cannot read a \.xyz file; expected .*\.npz"):
        load_recordings(tmp_path / "none.xyz")
    bad = tmp_path / "bad.npz"
    bad.write_bytes(b"nonsense")
    with pytest.raises(RecordingError, match="not an npz file"):
        load_recordings(bad)
