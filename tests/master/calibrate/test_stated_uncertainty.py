"""Seeded sessions with the errors that sites had: what is written is as sure as it says, no fault is written.

`python -m tests.master.calibrate.test_stated_uncertainty 200` runs as many of each and prints the counts.
"""

import sys
from dataclasses import dataclass, field

import numpy as np
import pytest

from common.quaternion import Array, conjugate, rotate
from master.calibrate.carried import signed_permutations
from master.calibrate.inertial import calibrate_inertial
from master.calibrate.magnetic import calibrate_magnetic
from master.calibrate.recording import NodeRecording, RecordingError
from tests.master.calibrate.conftest import make
from tests.master.calibrate.test_carried import RATE_HZ, turning

MAG_FAULTS = (
    "none",
    "none",
    "half",
    "codes",
    "zeros",
    "spikes",
    "swapped",
    "mirrored",
    "gyro negated",
    "room",
)
IMU_FAULTS = ("none", "none", "none", "few", "clipped", "negated", "swapped", "degrees", "zeros")
MUST_BE_REFUSED = {"swapped", "mirrored", "gyro negated", "clipped", "negated", "degrees"}


@dataclass
class Tally:
    """What became of the sessions."""

    offs: list[Array] = field(default_factory=list)
    """Of each written session: real error over stated 1σ of every number of the maps."""
    refused: dict[str, int] = field(default_factory=dict)
    wrongly_written: list[str] = field(default_factory=list)

    @property
    def within(self) -> float:
        """Share of the written numbers whose real error is within the stated 95 %."""
        return float(np.mean(np.abs(np.concatenate([o.ravel() for o in self.offs])) < 1.96))

    def __str__(self) -> str:
        return (
            f"{len(self.offs)} written, {100 * self.within:.1f} % of their numbers within the stated 95 %; "
            f"refused {self.refused}; faults written {self.wrongly_written}"
        )


def magnetic(seed: int) -> tuple[str, NodeRecording, Array]:
    """A unit turned about for a minute, and the map (3, 4) that is true."""
    rng = np.random.default_rng([seed, 7])
    fault = MAG_FAULTS[seed % len(MAG_FAULTS)]
    rates, q = turning(60.0, seed)
    half = rng.uniform(-0.06, 0.06, (3, 3))
    shape = np.eye(3) + half + half.T
    shape /= np.cbrt(np.linalg.det(shape))
    hard = rng.uniform(-40.0, 40.0, 3)
    dip = np.radians(rng.uniform(30.0, 75.0))
    field_ut = rotate(conjugate(q), 48.0 * np.array([0.0, np.cos(dip), -np.sin(dip)]))
    if fault == "room":
        field_ut = field_ut * (1.0 + 0.01 * np.sin(np.arange(len(q)) / 300.0))[:, None]
    mag = field_ut @ np.linalg.inv(shape) + hard + rng.uniform(0.2, 1.5) * rng.normal(size=field_ut.shape)
    acc = rotate(conjugate(q), np.array([0.0, 0.0, 9.80665])) + 0.05 * rng.normal(size=mag.shape)
    gyr = rates + rng.normal(scale=0.02, size=3) + 0.005 * rng.normal(size=mag.shape)
    some = rng.random(len(mag))
    if fault == "half":
        mag[field_ut[:, seed % 3] < 0.0] = np.nan
        keep = np.isfinite(mag[:, 0])
        # as if only that half had been turned through
        none = np.full((int(keep.sum()), 3), np.nan)
        return fault, NodeRecording("unit", RATE_HZ, none, none, mag[keep]), _mapped(shape, hard)
    if fault == "codes":
        mag[some < 0.01, rng.integers(0, 3)] = rng.choice([-4096.0, -375.8, 32767.0, -3276.8])
    if fault == "zeros":
        mag[some < 0.03] = 0.0
    if fault == "spikes":
        mag[some < 0.02] = rng.uniform(-90.0, 90.0, 3)
    turns = [w for w in signed_permutations()[1:] if (np.linalg.det(w) > 0.0) == (fault == "swapped")]
    if fault in ("swapped", "mirrored"):
        mag = mag @ turns[rng.integers(len(turns))].T
    if fault == "gyro negated":
        gyr = gyr * np.where(np.arange(3) == rng.integers(3), -1.0, 1.0)
    return fault, NodeRecording("unit", RATE_HZ, acc, gyr, mag), _mapped(shape, hard)


def _mapped(shape: Array, hard: Array) -> Array:
    return np.column_stack([shape, -shape @ hard])


def inertial(seed: int) -> tuple[str, NodeRecording, Array, Array]:
    """A session of many attitudes, and both maps (3, 4) that are true."""
    rng = np.random.default_rng([seed, 8])
    fault = IMU_FAULTS[seed % len(IMU_FAULTS)]
    true = make(attitudes=15 if fault == "few" else 22, seed=seed, rate_hz=50.0, rest_s=2.6)
    acc_gain = np.eye(3) + np.triu(rng.normal(scale=0.015, size=(3, 3)))
    gyr_gain = np.eye(3) + rng.normal(scale=0.015, size=(3, 3))
    acc_bias, gyr_bias = rng.normal(scale=0.2, size=3), rng.normal(scale=0.05, size=3)
    noise = rng.uniform(0.3, 1.5)
    acc = true.acc @ np.linalg.inv(acc_gain).T - acc_bias + 0.03 * noise * rng.normal(size=true.acc.shape)
    gyr = true.gyr @ np.linalg.inv(gyr_gain).T - gyr_bias + 2e-3 * noise * rng.normal(size=acc.shape)
    if fault == "clipped":
        limit = rng.uniform(0.4, 0.85) * np.abs(gyr).max()
        gyr = np.clip(gyr, -limit, limit)
    if fault == "negated":
        gyr = gyr * np.where(np.arange(3) == rng.integers(3), -1.0, 1.0)
    if fault == "swapped":
        gyr = gyr @ signed_permutations()[rng.integers(1, 48)].T
    if fault == "degrees":
        gyr = np.degrees(gyr)
    if fault == "zeros":
        acc[rng.random(len(acc)) < 0.02] = 0.0
    acc_map = np.column_stack([acc_gain, acc_gain @ acc_bias])
    gyr_map = np.column_stack([gyr_gain, gyr_gain @ gyr_bias])
    return fault, NodeRecording("unit", 50.0, acc, gyr), acc_map, gyr_map


def magnetic_tally(count: int) -> Tally:
    tally = Tally()
    for seed in range(count):
        fault, recording, truth = magnetic(seed)
        try:
            found = calibrate_magnetic(recording)
        except RecordingError:
            tally.refused[fault] = tally.refused.get(fault, 0) + 1
            continue
        if fault in MUST_BE_REFUSED:
            tally.wrongly_written.append(fault)
        tally.offs.append((found.affine - truth) / found.sigma)
    return tally


def inertial_tally(count: int) -> Tally:
    tally = Tally()
    for seed in range(count):
        fault, recording, acc, gyr = inertial(seed)
        try:
            found = calibrate_inertial(recording)
        except RecordingError:
            tally.refused[fault] = tally.refused.get(fault, 0) + 1
            continue
        if fault in MUST_BE_REFUSED:
            tally.wrongly_written.append(fault)
        a, g = found.accelerometer, found.gyroscope
        upper = (
            np.triu(np.ones((3, 4))) > 0.0
        )  # below the diagonal the accelerometer's is 0 by choice of axes
        tally.offs.append(((a.affine - acc) / np.where(upper, a.affine_sigma, 1.0))[upper])
        tally.offs.append((g.affine - gyr) / g.affine_sigma)
    return tally


@pytest.mark.long
def test_magnetometers_are_as_sure_as_is_written() -> None:
    tally = magnetic_tally(40)
    sys.stdout.write(f"{tally}\n")
    assert len(tally.offs) >= 20
    assert tally.within >= 0.9
    assert tally.wrongly_written == []


@pytest.mark.long
def test_inertial_sensors_are_as_sure_as_is_written() -> None:
    tally = inertial_tally(27)
    sys.stdout.write(f"{tally}\n")
    assert len(tally.offs) >= 20
    assert tally.within >= 0.9
    assert tally.wrongly_written == []


if __name__ == "__main__":
    how_many = int(sys.argv[1])
    sys.stdout.write(f"magnetic: {magnetic_tally(how_many)}\n")
    sys.stdout.write(f"inertial: {inertial_tally(how_many)}\n")
