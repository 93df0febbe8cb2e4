"""Real people and real units in normal wear are always believed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from common.quaternion import Array
from master.suit.plausibility import PlausibilityWatch
from master.suit.plausibility_config import PlausibilityConfig
from master.suit.protocol import SuitProtocol
from master.suit.sweep import Sweep

SCALE = SuitProtocol.load().fd.scale
BROAD = ("02_undisturbed_slow_rotation_B", "06_undisturbed_fast_rotation_A", "25_disturbed_tapping_B")


def alarms(readings: Array, rate_hz: float) -> dict[int, str]:
    """First words said of each node, of readings (T, N, 9) as the wire would carry them."""
    count = readings.shape[1]
    wire = np.clip(np.rint(readings / SCALE), -32767, 32767) * SCALE
    watch = PlausibilityWatch(PlausibilityConfig(), count, rate_hz, SCALE)
    yes, no = np.ones(count, np.bool_), np.zeros(count, np.bool_)
    said: dict[int, str] = {}
    for tick, v in enumerate(wire):
        sampled_ns = 1 + round(1e9 * tick / rate_hz)
        watch.take(Sweep(tick, sampled_ns, 0, v[:, :3], v[:, 3:6], v[:, 6:], yes, no), v)
        for node, doubt in watch.doubts().items():
            said.setdefault(node, f"{tick / rate_hz:.1f} s: {doubt.words}")
    return said


def load(folder: Path, name: str) -> dict[str, np.ndarray]:
    path = folder / name
    if not path.exists():
        pytest.skip(f"{name} is not there")
    with np.load(path) as file:
        return {key: file[key].astype(np.float64) for key in file}


def test_a_person_who_moves_for_100_s(recordings_folder: Path) -> None:
    data = load(recordings_folder, "human_full_body.npz")
    names = [key[:-4] for key in data if key.endswith("_acc")]
    none = np.full((len(data["t_s"]), 3), np.nan)
    six = [np.concatenate([data[f"{n}_acc"], data[f"{n}_gyr"], none], axis=1) for n in names]
    assert alarms(np.stack(six, axis=1), 100.0) == {}


@pytest.mark.parametrize("name", BROAD)
def test_a_unit_turned_shaken_and_knocked(recordings_folder: Path, name: str) -> None:
    data = load(recordings_folder, f"broad_{name}.npz")
    nine = np.concatenate([data["acc"], data["gyr"], data["mag"]], axis=1)[:, None]
    assert alarms(nine, float(data["rate_hz"])) == {}


def test_a_persons_unit_whose_gyro_is_turned_round_is_found(recordings_folder: Path) -> None:
    data = load(recordings_folder, "human_full_body.npz")
    none = np.full((len(data["t_s"]), 3), np.nan)
    six = np.concatenate([data["forearm_left_acc"], -data["forearm_left_gyr"], none], axis=1)
    assert "contradicts gravity" in alarms(six[:, None], 100.0)[0]
