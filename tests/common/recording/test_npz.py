"""Every way in which an npz file can be broken is one clear line."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from common.errors import RecordingError
from common.recording.npz import read_arrays


@pytest.fixture
def sound(tmp_path: Path) -> Path:
    path = tmp_path / "sound.npz"
    np.savez_compressed(path, gyr=np.random.default_rng(0).normal(size=(500, 3)), rate_hz=100.0)
    return path


def test_what_was_saved_comes_back(sound: Path) -> None:
    arrays = read_arrays(sound)
    assert arrays["gyr"].shape == (500, 3)
    assert arrays["rate_hz"] == 100.0


def test_a_file_broken_anywhere_is_refused_or_read(sound: Path) -> None:
    whole = sound.read_bytes()
    refused = 0
    for at in range(0, len(whole), max(1, len(whole) // 60)):
        flipped = bytes(byte ^ 0xFF for byte in whole[at : at + 40])
        for broken in (whole[:at], whole[:at] + flipped + whole[at + 40 :]):
            sound.write_bytes(broken)
            with suppress(RecordingError):
                read_arrays(sound)
                continue
            refused += 1
    assert refused > 100


def test_what_is_no_npz_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="no such file"):
        read_arrays(tmp_path / "none.npz")
    with pytest.raises(RecordingError, match="no such file"):
        read_arrays(tmp_path)
    path = tmp_path / "a.npz"
    for content in (b"", b"hello"):
        path.write_bytes(content)
        with pytest.raises(RecordingError, match="not an npz file of plain arrays"):
            read_arrays(path)
    np.savez(path, a=np.array([{}]))
    with pytest.raises(RecordingError, match="not an npz file of plain arrays"):
        read_arrays(path)
    with path.open("wb") as stream:
        np.save(stream, np.zeros(3))
    with pytest.raises(RecordingError, match=r"one array \(npy\)"):
        read_arrays(path)
