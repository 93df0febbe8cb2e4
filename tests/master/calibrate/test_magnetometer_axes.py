import numpy as np
import pytest

from common.quaternion import Array, conjugate, from_rotation_vector, rotate
from master.calibrate.carried import axes_text, signed_permutations
from master.calibrate.magnetic import MagneticOptions, calibrate_magnetic
from master.calibrate.magnetometer_axes import axes_matrix
from master.calibrate.recording import NodeRecording, RecordingError
from tests.master.calibrate.test_carried import RATE_HZ, turning

RATES, Q = turning(90.0, seed=3)
NORTH: Array = 49.0 * np.array([0.0, np.cos(np.radians(62.0)), -np.sin(np.radians(62.0))])
SOUTH: Array = NORTH * [1.0, 1.0, -1.0]
HARD_IRON: Array = np.array([12.0, -7.0, 20.0])


def recorded(axes: Array, earth: Array = NORTH, gyro_axes: Array | None = None) -> NodeRecording:
    """A unit turned about, the readings of its magnetometer `axes` · what they should be."""
    rng = np.random.default_rng(1)
    noise = rng.normal(size=(3, len(Q), 3))
    back = conjugate(Q)
    mag = (rotate(back, earth) * [1.05, 0.97, 1.0] + HARD_IRON + 0.3 * noise[0]) @ axes.T
    acc = rotate(back, np.array([0.0, 0.0, 9.80665])) + 0.05 * noise[1]
    gyr = RATES + 0.02 + 0.005 * noise[2]
    return NodeRecording("unit", RATE_HZ, acc, gyr if gyro_axes is None else gyr @ gyro_axes.T, mag)


@pytest.mark.parametrize("way", range(48))
def test_of_48_ways_one_is_written_23_offered_24_mirrored(way: int) -> None:
    axes = signed_permutations()[way]
    if way == 0:
        found = calibrate_magnetic(recorded(axes))
        assert [e.verdict for e in found.evidence] == ["agrees"] * len(found.evidence)
        assert len(found.evidence) >= 4
    elif np.linalg.det(axes) > 0.0:
        offered = axes_text(axes.T)
        with pytest.raises(RecordingError, match=rf"axes .*accept it with --axes={offered};"):
            calibrate_magnetic(recorded(axes))
        found = calibrate_magnetic(recorded(axes), options=MagneticOptions(axes=axes_matrix(offered)))
        np.testing.assert_allclose(found.affine @ [*axes @ HARD_IRON, 1.0], 0.0, atol=0.3)
        out = recorded(axes).mag_ut @ found.affine[:, :3].T + found.affine[:, 3]  # type: ignore[operator]
        truth = rotate(conjugate(Q), NORTH)
        cosine = np.sum(out * truth, axis=1) / np.linalg.norm(out, axis=1) / 49.0
        assert np.degrees(np.arccos(cosine.clip(-1, 1))).max() < 3.0
    else:
        with pytest.raises(RecordingError, match=r"a mirror image"):
            calibrate_magnetic(recorded(axes))


def test_in_the_south_a_sound_unit_needs_the_word() -> None:
    south = MagneticOptions("south")
    with pytest.raises(RecordingError, match=r"62° above the horizon.*say --hemisphere south"):
        calibrate_magnetic(recorded(np.eye(3), SOUTH))
    calibrate_magnetic(recorded(np.eye(3), SOUTH), options=south)
    with pytest.raises(RecordingError, match=r"its x axis is negated: a mirror image"):
        calibrate_magnetic(recorded(np.diag([-1.0, 1.0, 1.0]), SOUTH), options=south)


def test_at_the_magnetic_equator_what_cannot_be_told_is_not_accepted() -> None:
    level = np.array([0.0, 40.0, -1.0])
    found = calibrate_magnetic(recorded(np.eye(3), level))
    assert any("all three axes may be negated" in note for note in found.notes)
    with pytest.raises(RecordingError, match=r"the field lies level here"):
        calibrate_magnetic(recorded(np.diag([-1.0, 1.0, 1.0]), level))


@pytest.mark.parametrize("axis", range(3))
def test_a_negated_gyroscope_axis_is_not_the_magnetometer_s_fault(axis: int) -> None:
    signs = np.ones(3)
    signs[axis] = -1.0
    with pytest.raises(
        RecordingError, match=rf"gyroscope turns against the field: its {'xyz'[axis]} axis is"
    ):
        calibrate_magnetic(recorded(np.eye(3), gyro_axes=np.diag(signs)))


def test_nor_one_whose_axes_are_turned() -> None:
    axes = axes_matrix("y,-x,z")
    with pytest.raises(RecordingError, match=r"of the gyroscope, its x and y axes are swapped"):
        calibrate_magnetic(recorded(np.eye(3), gyro_axes=axes))


def test_a_magnetometer_mounted_askew_is_refused_at_the_limit() -> None:
    def turned(degrees: float) -> NodeRecording:
        v = np.radians(degrees) * np.array([0.6, 0.0, 0.8])
        matrix: Array = rotate(from_rotation_vector(v), np.eye(3)).T
        sound = recorded(np.eye(3))
        mag = sound.mag_ut @ matrix.T  # type: ignore[operator]
        return NodeRecording("unit", RATE_HZ, sound.acc_m_s2, sound.gyr_rad_s, mag)

    calibrate_magnetic(turned(8.0))
    for degrees in (12.0, 30.0, 52.0):
        with pytest.raises(RecordingError, match=r"turned by \d+° against the gyroscope|--axes="):
            calibrate_magnetic(turned(degrees))


def test_without_a_gyroscope_the_axes_are_not_judged_and_that_is_said() -> None:
    sound = recorded(np.eye(3))
    still = NodeRecording("unit", RATE_HZ, 0.0 * sound.acc_m_s2, 0.0 * sound.gyr_rad_s, sound.mag_ut)
    (note,) = [note for note in calibrate_magnetic(still).notes if "not judged" in note]
    assert "turn the node about each of its axes" in note


@pytest.mark.parametrize("text", ["x,y", "x,x,z", "x,y,w", "-x,y,z", ""])
def test_axes_that_are_none_are_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"expected x, y and z|mirror image"):
        axes_matrix(text)
