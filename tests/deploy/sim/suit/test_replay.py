from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from common.errors import ConfigError
from common.skeleton import Skeleton, load_skeleton
from common.skeleton.full_body import RECORDED_AS
from deploy.sim.suit.replay import Replay, load_replay

SAMPLES = 50


def recording() -> dict[str, Any]:
    random = np.random.default_rng(12)
    arrays: dict[str, Any] = {"t_s": 40.0 + 0.01 * np.arange(SAMPLES)}
    for name in RECORDED_AS.values():
        arrays[f"{name}_acc"] = random.standard_normal((SAMPLES, 3)).astype(np.float32)
        arrays[f"{name}_gyr"] = random.standard_normal((SAMPLES, 3)).astype(np.float32)
    return arrays


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "person.npz"


@pytest.fixture
def replay(path: Path, skeleton: Skeleton) -> Replay:
    np.savez(path, **recording())
    return load_replay(path, skeleton, skeleton.segment_names)


def test_at_the_recorded_times_it_reads_what_was_recorded(replay: Replay, skeleton: Skeleton) -> None:
    arrays = recording()
    row = skeleton.segment_names.index("right_forearm")
    for k in range(SAMPLES):
        reading = replay.readings(arrays["t_s"][k] - 40.0)[row]
        np.testing.assert_allclose(reading[0:3], arrays["forearm_right_acc"][k], atol=1e-12)
        np.testing.assert_allclose(reading[3:6], arrays["forearm_right_gyr"][k], atol=1e-12)
        np.testing.assert_array_equal(reading[6:9], 0.0)


def test_between_them_it_is_linear(replay: Replay) -> None:
    here, there = replay.readings(0.10), replay.readings(0.11)
    np.testing.assert_allclose(replay.readings(0.105), 0.5 * (here + there), atol=1e-9)
    np.testing.assert_allclose(replay.readings(0.1075), 0.25 * here + 0.75 * there, atol=1e-9)


def test_after_its_end_it_runs_backwards_with_rates_reversed(replay: Replay) -> None:
    assert replay.length_s == pytest.approx(0.49)
    mirrored = np.repeat([1.0, -1.0, 1.0], 3)
    for t_s in (0.003, 0.1, 0.312):
        back = replay.readings(2.0 * replay.length_s - t_s)
        np.testing.assert_allclose(back, replay.readings(t_s) * mirrored, atol=1e-9)


def test_it_begins_again_when_it_is_back_at_the_beginning(replay: Replay) -> None:
    np.testing.assert_allclose(
        replay.readings(2.0 * replay.length_s + 0.123), replay.readings(0.123), atol=1e-9
    )


def test_its_way_there_and_back_leads_to_where_it_began(replay: Replay) -> None:
    """The rates' integral over a whole cycle is zero: no orientation jumps at a seam."""
    t_s = np.arange(0.0005, 2.0 * replay.length_s, 0.001)
    total = sum(replay.readings(float(t))[:, 3:6] for t in t_s)
    np.testing.assert_allclose(total, 0.0, atol=1e-9)


def test_phalanges_read_what_their_hand_reads(replay: Replay, skeleton: Skeleton) -> None:
    reading = replay.readings(0.2)
    for i, name in enumerate(skeleton.segment_names):
        if name not in RECORDED_AS:
            hand = skeleton.segment_names.index(f"{name.split('_')[0]}_hand")
            np.testing.assert_array_equal(reading[i], reading[hand])


def test_only_the_segments_that_are_asked_for_need_be_there(path: Path, skeleton: Skeleton) -> None:
    arrays = {k: v for k, v in recording().items() if k == "t_s" or k.startswith("head_")}
    np.savez(path, **arrays)
    assert load_replay(path, skeleton, ["head"]).length_s == pytest.approx(0.49)


def drop(name: str) -> Callable[[dict[str, Any]], object]:
    return lambda arrays: arrays.pop(name)


def put(name: str, value: Any) -> Callable[[dict[str, Any]], object]:
    return lambda arrays: arrays.__setitem__(name, value)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (drop("hand_left_gyr"), "hand_left_gyr = None: expected an array of that name"),
        (drop("t_s"), "t_s = None: expected an array"),
        (
            put("head_acc", np.zeros((SAMPLES - 1, 3))),
            r"head_acc = 'float64 \(49, 3\)': expected .*\(50, 3\)",
        ),
        (put("head_acc", np.zeros((SAMPLES, 4))), r"head_acc = 'float64 \(50, 4\)'"),
        (put("head_acc", np.full((SAMPLES, 3), "x")), r"head_acc = '<U1 \(50, 3\)': expected numbers"),
        (put("head_gyr", np.full((SAMPLES, 3), np.nan)), "head_gyr = 'NaN or infinity'"),
        (put("t_s", np.zeros(SAMPLES)), "t_s = .*each later than the one before"),
        (put("t_s", np.zeros(1)), "t_s = .*two or more times"),
        (put("t_s", np.zeros((SAMPLES, 1))), r"t_s = .*shape \(T,\)"),
        (put("t_s", np.array([{}] * SAMPLES)), "npz file of plain arrays"),
    ],
)
def test_a_malformed_recording_is_refused_with_what_was_expected(
    path: Path, skeleton: Skeleton, change: Callable[[dict[str, Any]], object], said: str
) -> None:
    arrays = recording()
    change(arrays)
    np.savez(path, **arrays)
    with pytest.raises(ConfigError, match=said) as refused:
        load_replay(path, skeleton, skeleton.segment_names)
    assert str(refused.value).startswith(str(path))


@pytest.mark.parametrize("content", [b"", b"not an archive", b"PK\x03\x04 truncated"])
def test_a_file_of_another_kind_is_refused(path: Path, skeleton: Skeleton, content: bytes) -> None:
    path.write_bytes(content)
    with pytest.raises(ConfigError, match="expected a readable npz file"):
        load_replay(path, skeleton, skeleton.segment_names)


def test_a_single_array_and_a_missing_file_are_refused(tmp_path: Path, skeleton: Skeleton) -> None:
    np.save(tmp_path / "one.npy", np.zeros(3))
    with pytest.raises(ConfigError, match="one array"):
        load_replay(tmp_path / "one.npy", skeleton, ["head"])
    with pytest.raises(ConfigError, match="a readable npz file"):
        load_replay(tmp_path / "none.npz", skeleton, ["head"])


@pytest.mark.parametrize("profile", ["nursing", "lower_limb"])
def test_the_real_recording_is_resampled_exactly_at_its_knots(profile: str, real_person: Path) -> None:
    skeleton = load_skeleton(profile)
    recorded = {i: RECORDED_AS[s] for i, s in enumerate(skeleton.segment_names) if s in RECORDED_AS}
    assert len(recorded) == {"nursing": 8, "lower_limb": 7}[profile]
    replay = load_replay(real_person, skeleton, skeleton.segment_names)
    assert replay.length_s == pytest.approx(99.99)
    with np.load(real_person) as arrays:
        for k in (0, 1, 777, 5000, 9999):
            reading = replay.readings(arrays["t_s"][k] - arrays["t_s"][0])
            for i, name in recorded.items():
                row = reading[i]
                np.testing.assert_allclose(row[0:3], arrays[f"{name}_acc"][k], atol=1e-6)
                np.testing.assert_allclose(row[3:6], arrays[f"{name}_gyr"][k], atol=1e-6)
