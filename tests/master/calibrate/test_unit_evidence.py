"""A unit whose own readings contradict each other is told, by the likeliest cause; a sound one never is."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from common.quaternion import Array, from_axis_angle, normalise, rotate
from master.calibrate.evidence import first_contradiction
from master.calibrate.gyro_gravity import describe
from master.calibrate.recording import NodeRecording, load_recordings
from master.calibrate.soundness import clipped
from master.calibrate.unit_evidence import unit_evidence
from tests.master.calibrate.worn import wear

Spoil = Callable[[Array, Array], tuple[Array, Array]]


@pytest.fixture(scope="module")
def units() -> dict[str, NodeRecording]:
    """Arms and legs of simulated persons; a pelvis that never moves is left out."""
    nodes = {**wear("nursing", 3).nodes, **wear("lower_limb", 4).nodes}
    return {name: unit for name, unit in nodes.items() if name != "pelvis"}


def said(unit: NodeRecording, spoil: Spoil = lambda acc, gyr: (acc, gyr)) -> str | None:
    acc, gyr = spoil(unit.acc_m_s2, unit.gyr_rad_s)
    wrong = first_contradiction(unit_evidence(replace(unit, acc_m_s2=acc, gyr_rad_s=gyr)))
    return None if wrong is None else wrong.advice


def test_sound_units_are_believed(units: dict[str, NodeRecording]) -> None:
    assert {name: said(unit) for name, unit in units.items()} == dict.fromkeys(units)


@pytest.mark.long
def test_a_real_person_s_units_are_believed(real_person: Path) -> None:
    units = load_recordings(real_person)
    assert {name: said(unit) for name, unit in units.items()} == dict.fromkeys(units)


def limited(deg_s: float) -> Spoil:
    return lambda acc, gyr: (acc, np.clip(gyr, -np.radians(deg_s), np.radians(deg_s)))


SPOILT: list[tuple[str, Spoil, str]] = [
    ("acc in g", lambda acc, gyr: (acc / 9.80665, gyr), "accelerometer reads .* these seem to be g"),
    ("acc in mg", lambda acc, gyr: (acc / 9.80665e-3, gyr), "these seem to be thousandths of g"),
    ("acc 10 % off", lambda acc, gyr: (1.1 * acc, gyr), "Calibrate it first"),
    ("acc dead", lambda acc, gyr: (0.0 * acc, gyr), "broken"),
    ("gyro in deg/s", lambda acc, gyr: (acc, np.degrees(gyr)), "gyroscope seems to read °/s"),
    ("gyro converted twice", lambda acc, gyr: (acc, np.radians(gyr)), "converted twice"),
    ("gyro dead", lambda acc, gyr: (acc, 0.0 * gyr), "reads the same value all the time on x, y, z"),
    ("gyro y stuck", lambda acc, gyr: (acc, gyr * [1, 0, 1]), "reads the same value all the time on y;"),
    ("gyro x negated", lambda acc, gyr: (acc, gyr * [-1, 1, 1]), "its x axis is negated"),
    ("gyro z negated", lambda acc, gyr: (acc, gyr * [1, 1, -1]), "its z axis is negated"),
    ("gyro yz exchanged", lambda acc, gyr: (acc, gyr[:, [0, 2, 1]]), "its y and z axes are swapped"),
    ("mirrored", lambda acc, gyr: (acc * [1, -1, 1], gyr * [1, -1, 1]), "left-handed frame"),
    ("gyro clipped", limited(100.0), "gyroscope is clipped for"),
]


@pytest.mark.parametrize(("spoil", "expected"), [s[1:] for s in SPOILT], ids=[s[0] for s in SPOILT])
def test_each_fault_is_told_by_its_likeliest_cause(
    units: dict[str, NodeRecording], spoil: Spoil, expected: str
) -> None:
    """Of a chest or head that hardly turned a fault may go unnoticed; never of a limb."""
    for name, unit in units.items():
        text = said(unit, spoil)
        if text is None and name in ("chest", "head"):
            continue
        assert text is not None, name
        assert re.search(expected, text), (name, text)


def test_clipping_is_judged_on_the_readings_before_their_calibration(units: dict[str, NodeRecording]) -> None:
    unit = units["left_forearm"]
    cut = replace(unit, gyr_rad_s=np.clip(unit.gyr_rad_s, -2.0, 2.0))
    mixed = np.eye(3) + 0.01 * np.ones((3, 3))
    mapped = replace(cut, gyr_rad_s=cut.gyr_rad_s @ mixed, as_read=cut)
    assert "is clipped" in str(said_as_is(mapped))
    assert "is clipped" not in str(said_as_is(replace(mapped, as_read=None)))


def said_as_is(unit: NodeRecording) -> str | None:
    wrong = first_contradiction(unit_evidence(unit))
    return None if wrong is None else wrong.advice


def test_only_flat_tops_are_clipped() -> None:
    t = np.arange(400)[:, None] / 100.0
    wave = 5.0 * np.sin(6.0 * t * [1.0, 1.3, 1.7])
    assert not clipped(wave, 1.0).any()
    assert clipped(np.clip(wave, -4.0, None), 1.0).sum() > 20
    assert not clipped(np.clip(wave, -4.0, 4.0), 4.5).any()
    assert not clipped(np.full((10, 3), np.nan), 1.0).any()


def test_the_words_name_the_axes() -> None:
    assert describe(np.diag([1.0, -1.0, 1.0])) == "its y axis is negated"
    assert describe(np.eye(3)[[1, 0, 2]]) == "its x and y axes are swapped"
    assert "left-handed" in describe(-np.eye(3))


@pytest.mark.parametrize(("deg", "told"), [(0.0, False), (5.0, False), (30.0, True)])
def test_a_unit_that_slips_between_two_samples_is_told(
    units: dict[str, NodeRecording], deg: float, told: bool
) -> None:
    """About a level axis; a slip about the vertical is for its neighbours to tell."""
    unit = units["left_upper_arm"]
    up = unit.acc_m_s2[1200] / np.linalg.norm(unit.acc_m_s2[1200])
    turn = from_axis_angle(normalise(np.cross(up, [0.3, 0.5, 0.8])), np.radians(deg))
    acc, gyr = unit.acc_m_s2.copy(), unit.gyr_rad_s.copy()
    acc[1200:], gyr[1200:] = rotate(turn, acc[1200:]), rotate(turn, gyr[1200:])
    text = said_as_is(replace(unit, acc_m_s2=acc, gyr_rad_s=gyr))
    assert (text is not None) == told
    assert text is None or "at about 12 s gravity jumps" in text
