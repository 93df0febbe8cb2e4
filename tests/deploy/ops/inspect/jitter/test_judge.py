"""Jitter planted at each stage is found at that stage, and nowhere where none is planted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from common.errors import RecordingError
from common.quaternion import Array
from deploy.ops.inspect.jitter.bands import Signal, bands
from deploy.ops.inspect.jitter.judge import judge
from deploy.ops.inspect.jitter.stages import ORDER

JOINTS = ("elbow", "wrist")
SEGMENTS = ("forearm", "hand")
RATES_HZ = dict.fromkeys(ORDER, 200.0) | {"solved": 12.5, "received": 12.5}
LAG_S = dict(zip(ORDER, (0.0, 0.0, 0.0, 0.0, 0.02, 0.02, 0.06), strict=True))


def motion(time_s: Array) -> Array:
    """(T, 2): a slow reach and a quicker wave, as people do."""
    reach = 0.6 * np.sin(2 * np.pi * 0.4 * time_s)
    wave = 0.2 * np.sin(2 * np.pi * 1.1 * time_s + 1.0) + 0.03 * np.sin(2 * np.pi * 2.3 * time_s)
    return np.stack([reach, wave], axis=-1)


def shake(time_s: Array, hz: float, most_deg: float) -> Array:
    """(T, 2): the second joint trembles."""
    return np.stack([np.zeros_like(time_s), np.radians(most_deg) * np.sin(2 * np.pi * hz * time_s)], axis=-1)


def way(
    planted: str | None, hz: float, stages: tuple[str, ...] = ORDER, seconds: float = 20.0
) -> list[Signal]:
    """The stages of one way; what shakes at a stage shakes at all that follow."""
    # the nodes have nothing before them to be compared with: only what is much beside their motion is seen
    signals, shaking, most_deg = [], False, 16.0 / hz if planted == "nodes" else 0.8
    for stage in ORDER:
        shaking = shaking or stage == planted
        time_s = 100.0 + np.arange(0.0, seconds, 1.0 / RATES_HZ[stage]) + 0.0013
        late_s = time_s - LAG_S[stage]
        angle_rad = motion(late_s) + (shake(late_s, hz, most_deg) if shaking else 0.0)
        of_joints = Signal(stage, JOINTS, time_s, angle_rad)
        of_segments = Signal(stage, SEGMENTS, time_s, angle_rad, replace(of_joints, channels=SEGMENTS))
        between = replace(of_joints, channels=SEGMENTS) if stage == "solved" else None
        signals.append(of_segments if stage in ("nodes", "fused") else replace(of_joints, between=between))
    return [signal for signal in signals if signal.stage in stages]


@pytest.mark.parametrize("hz", [4.5, 8.0, 13.0])
@pytest.mark.parametrize("planted", ORDER)
def test_jitter_is_found_at_the_stage_at_which_it_was_planted(planted: str, hz: float) -> None:
    if RATES_HZ[planted] < 200.0 and hz == 13.0:
        hz = 9.0  # 13 Hz taken at 12.5 Hz is a slow swing of 0.5 Hz: motion, by that stage alone
    found = judge(way(planted, hz)).first
    assert found is not None
    assert found.stage == planted
    assert found.channel in ("wrist", "hand")


def test_a_way_without_jitter_is_not_accused() -> None:
    findings = judge(way(None, 8.0), began_s=90.0)
    assert findings.first is None
    assert findings.words == "no stage adds jitter"
    assert 9.9 < findings.from_s < 10.1


@pytest.mark.parametrize("absent", [("nodes", "fused", "solved"), ("tracked",), ("received", "tracked")])
def test_stages_that_were_not_recorded_are_left_out(absent: tuple[str, ...]) -> None:
    stages = tuple(stage for stage in ORDER if stage not in absent)
    found = judge(way("encoders", 8.0, stages)).first
    assert found is not None
    assert found.stage == "encoders"


def test_only_time_that_all_stages_share_without_a_gap_is_judged() -> None:
    signals = way("limited", 8.0)
    gap = (signals[3].time_s < 105.0) | (signals[3].time_s > 107.0)
    signals[3] = replace(signals[3], time_s=signals[3].time_s[gap], angle_rad=signals[3].angle_rad[gap])
    findings = judge(signals, began_s=100.0)
    assert findings.from_s == pytest.approx(7.0, abs=0.1)
    with pytest.raises(RecordingError, match="share no 4 s"):
        judge(way(None, 8.0, seconds=3.0))
    with pytest.raises(RecordingError, match="no stage"):
        judge([])


def test_the_bands_hold_the_energy_of_what_is_in_them() -> None:
    """A sine of 0.1 rad at 8 Hz: RMS rate 0.1 · 2π · 8 / √2, acceleration the same times 2π · 8."""
    time_s = np.arange(0.0, 20.0, 0.005)
    swing = 0.1 * np.sin(2 * np.pi * 8.0 * time_s) + 0.5 * np.sin(2 * np.pi * 1.0 * time_s)
    found = bands(Signal("encoders", ("elbow",), time_s, swing[:, None]))
    low, jitter, high = found.velocity_rad_s["elbow"]
    assert low == pytest.approx(0.5 * 2 * np.pi / np.sqrt(2), rel=0.02)
    assert jitter == pytest.approx(0.1 * 2 * np.pi * 8.0 / np.sqrt(2), rel=0.02)
    assert high < 0.02 * jitter
    assert found.acceleration_rad_s2["elbow"][1] == pytest.approx(jitter * 2 * np.pi * 8.0, rel=0.02)
