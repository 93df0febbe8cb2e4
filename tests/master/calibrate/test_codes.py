import os
from pathlib import Path

import numpy as np
import pytest

from common.quaternion import Array
from master.calibrate.codes import clean
from master.calibrate.magnetic import calibrate_magnetic
from master.calibrate.recording import NodeRecording, RecordingError, load_recordings

HARD_IRON: Array = np.array([12.0, -7.0, 20.0])
LSB_UT = 0.0917


def field(noise_ut: float = 0.3, quantised: bool = True, count: int = 9000) -> Array:
    """A unit turned about for 90 s at 100 Hz, whole counts where quantised."""
    t = np.arange(count) / 100.0
    polar, azimuth = np.pi * (0.5 - 0.5 * np.cos(2.0 * np.pi * t / 90.0)), 2.0 * np.pi * t / 7.3
    sine = np.sin(polar)
    out: Array = 49.0 * np.column_stack([sine * np.cos(azimuth), sine * np.sin(azimuth), np.cos(polar)])
    out = (
        out * [1.05, 0.97, 1.0] + HARD_IRON + np.random.default_rng(0).normal(scale=noise_ut, size=out.shape)
    )
    return LSB_UT * np.round(out / LSB_UT) if quantised else out


def centre(readings: Array) -> Array:
    rest = np.full(readings.shape, np.nan)
    return calibrate_magnetic(NodeRecording("unit", 100.0, rest, rest, readings)).fit.centre


@pytest.mark.parametrize("quantised", [True, False])
def test_sound_readings_stay_as_they_are(quantised: bool) -> None:
    kept = clean(field(quantised=quantised))
    assert kept.notes == ()
    assert np.array_equal(kept.readings, field(quantised=quantised))


@pytest.mark.parametrize("share", [0.0005, 0.005, 0.03])
@pytest.mark.parametrize("code", [-4096 * LSB_UT, -4096.0, 32767.0, -32768 * LSB_UT, 4912.0, 0.0, np.inf])
def test_codes_on_one_axis_neither_refuse_nor_move_the_result(code: float, share: float) -> None:
    mag = field()
    rng = np.random.default_rng(5)
    bad = rng.random(len(mag)) < share
    mag[bad, rng.integers(0, 3, bad.sum())] = code
    assert np.linalg.norm(centre(mag) - HARD_IRON) < 0.1


@pytest.mark.parametrize("burst", [1, 20])
def test_zeros_are_dropped_and_counted(burst: int) -> None:
    mag = field()
    first = np.random.default_rng(2).choice(len(mag) // burst, size=270 // burst, replace=False) * burst
    bad = (first[:, None] + np.arange(burst)).ravel()
    mag[bad] = 0.0
    (note,) = clean(mag).notes
    assert f"{len(bad)} readings of zero on all axes dropped, {100 * len(bad) / len(mag):.2g} %" in note
    assert np.linalg.norm(centre(mag) - HARD_IRON) < 0.1


def test_a_code_within_the_fields_range_is_found_where_it_is_declared() -> None:
    mag = field(quantised=False)
    mag[[100, 500, 900], 1] = -40.0
    assert clean(mag).notes == ()
    (note,) = clean(mag, declared=[-40.0]).notes
    assert note.startswith("3 overflow codes as declared (-40) dropped")


def test_spikes_of_any_value_do_not_steer() -> None:
    mag = field()
    rng = np.random.default_rng(8)
    bad = rng.choice(len(mag), 400, replace=False)
    mag[bad] = rng.uniform(-90.0, 90.0, (400, 3))
    assert np.linalg.norm(centre(mag) - HARD_IRON) < 0.15


def test_too_many_codes_are_refused_with_what_to_do() -> None:
    mag = field()
    mag[::8, 2] = -4096 * LSB_UT
    with pytest.raises(RecordingError, match=r"12 % of the magnetometer's readings are none: .*larger range"):
        clean(mag)


@pytest.mark.parametrize("held", [True, False])
@pytest.mark.parametrize("every", [2, 5, 13])
def test_a_magnetometer_slower_than_the_rate_is_not_missing(every: int, held: bool) -> None:
    mag = field(count=18000, quantised=False)
    place = np.arange(len(mag)) // every * every
    slow = mag[place] if held else np.where((place == np.arange(len(mag)))[:, None], mag, np.nan)
    kept = clean(slow)
    assert kept.missing < 0.01
    assert f"a reading every {every} samples" in kept.notes[0]
    assert np.linalg.norm(centre(slow) - HARD_IRON) < 0.15


def test_a_slow_magnetometer_of_which_readings_are_missing_is_refused() -> None:
    slow = np.full((9000, 3), np.nan)
    slow[::4] = field()[::4]
    slow[2000:4500] = np.nan
    assert clean(slow).missing == pytest.approx(0.278, abs=0.01)
    with pytest.raises(RecordingError, match=r"28 % of the magnetometer's readings are missing"):
        centre(slow)


@pytest.fixture
def cases() -> Path:
    folder = os.environ.get("TANDEM_CASES")
    if folder is None:
        pytest.skip("TANDEM_CASES is not set")
    return Path(folder)


@pytest.mark.parametrize("name", ["mag_clean", "mag_overflow_codes"])
def test_the_reported_session(cases: Path, name: str) -> None:
    found = calibrate_magnetic(load_recordings(cases / f"{name}.npz")[name])
    assert np.linalg.norm(found.fit.centre - HARD_IRON) < 0.05


def test_the_reported_half_of_a_sphere(cases: Path) -> None:
    found = calibrate_magnetic(load_recordings(cases / "mag_half_ball.npz")["mag_half_ball"])
    assert np.linalg.norm(found.fit.centre - HARD_IRON) < 0.5
