from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from common.config.load import load_config
from common.errors import ConfigError
from common.skeleton import load_skeleton
from deploy.sim.suit.config import SuitConfig
from deploy.sim.suit.disturbance import Disturbance, DisturbanceConfig, dipole_ut
from deploy.sim.suit.motion import load_motion
from deploy.sim.suit.sensors import IdealSensors, earth_field_ut

EARTH_UT = earth_field_ut(50.0, 60.0)
NAMES = ("chest", "head")
SUIT = """
[[buses]]
name = "suit"
interface = "virtual"
channel = "x"
[nodes]
chest = { id = 1, bus = "suit" }
[[disturbance.dipole]]
position_m = [0.6, 0.0, 0.7]
moment_a_m2 = [0.0, 20.0, 0.0]
[[disturbance.local]]
nodes = ["chest"]
turn_deg = 30.0
"""


def local(t_s: float, **keys: object) -> np.ndarray:
    config = DisturbanceConfig.model_validate({"local": [keys]})
    return Disturbance(config, NAMES, EARTH_UT).field_ut(t_s, np.zeros((2, 3)))


def test_a_dipole_s_field_is_the_textbook_s_along_it_and_across() -> None:
    along, across = np.array([[0.0, 0.5, 0.0]]), np.array([[0.5, 0.0, 0.0]])
    moment = np.array([0.0, 20.0, 0.0])
    np.testing.assert_allclose(dipole_ut(along, moment), [[0.0, 32.0, 0.0]], atol=1e-12)
    np.testing.assert_allclose(dipole_ut(across, moment), [[0.0, -16.0, 0.0]], atol=1e-12)


def test_a_dipole_s_field_has_neither_source_nor_curl() -> None:
    """Maxwell, outside of the magnet; by central differences."""
    place, step, moment = np.array([0.3, -0.4, 0.2]), 1e-4, np.array([5.0, 20.0, -7.0])
    there = place + step * np.concatenate([np.eye(3), -np.eye(3)])
    field = dipole_ut(there, moment)
    gradient = (field[:3] - field[3:]) / (2.0 * step)
    assert abs(np.trace(gradient)) < 1e-4 * np.abs(gradient).max()
    np.testing.assert_allclose(gradient, gradient.T, atol=1e-4 * np.abs(gradient).max())


def test_nobody_meets_an_infinite_field() -> None:
    assert np.all(np.isfinite(dipole_ut(np.zeros((1, 3)), np.array([0.0, 20.0, 0.0]))))


def test_a_local_field_comes_and_goes_where_it_is_told() -> None:
    keys = {"nodes": ["head"], "from_s": 2.0, "until_s": 6.0, "ramp_s": 2.0, "field_ut": [20.0, 0.0, 10.0]}
    for t_s, share in ((0.0, 0.0), (2.0, 0.0), (3.0, 0.5), (4.0, 1.0), (6.0, 1.0), (7.5, 0.25), (9.0, 0.0)):
        added = local(t_s, **keys) - EARTH_UT
        np.testing.assert_allclose(added, [[0.0, 0.0, 0.0], [20.0 * share, 0.0, 10.0 * share]], atol=1e-12)
    at_once = local(6.0, until_s=6.0, field_ut=[1.0, 0.0, 0.0]) - EARTH_UT
    assert not at_once.any()


def test_a_turned_field_keeps_strength_and_dip() -> None:
    field = local(100.0, turn_deg=90.0, ramp_s=10.0)
    np.testing.assert_allclose(field, np.tile([-EARTH_UT[1], 0.0, EARTH_UT[2]], (2, 1)), atol=1e-12)
    half = local(5.0, turn_deg=90.0, ramp_s=10.0)
    np.testing.assert_allclose(np.linalg.norm(half, axis=1), 50.0)
    np.testing.assert_allclose(half[:, 2], EARTH_UT[2])


def test_a_bed_rail_disturbs_the_hand_over_it_and_hardly_the_head() -> None:
    skeleton = load_skeleton("nursing")
    config = DisturbanceConfig.model_validate(
        {"dipole": [{"position_m": [0.6, 0.0, 0.7], "moment_a_m2": [0.0, 20.0, 0.0]}]}
    )
    room = Disturbance(config, skeleton.segment_names, EARTH_UT)
    sensors = IdealSensors(skeleton, EARTH_UT, None, room)
    motion = load_motion("bottle", skeleton)
    strength = np.array(
        [
            np.linalg.norm(sensors.read(*motion.state(t_s), t_s)[:, 6:], axis=1)
            for t_s in np.arange(0.0, 16.0, 0.5)
        ]
    )
    change = np.ptp(strength, axis=0)
    assert change[skeleton.segment_names.index("right_hand")] > 10.0
    assert change[skeleton.segment_names.index("head")] < 5.0
    # no reading but the magnetometer's knows of it
    plain = IdealSensors(skeleton, EARTH_UT).read(*motion.state(6.0))
    np.testing.assert_array_equal(sensors.read(*motion.state(6.0), 6.0)[:, :6], plain[:, :6])


def test_the_suit_s_file_says_what_stands_in_the_room(tmp_path: Path) -> None:
    path = tmp_path / "suit.toml"
    path.write_text(SUIT)
    config = load_config(path, SuitConfig)
    assert config.disturbance.dipole[0].moment_a_m2 == [0.0, 20.0, 0.0]
    path.write_text(SUIT.replace('nodes = ["chest"]', 'nodes = ["tail"]'))
    with pytest.raises(ConfigError, match=r"disturbance\.local\.nodes = 'tail': expected a segment"):
        load_config(path, SuitConfig)
