import numpy as np
import pytest

from common.errors import RecordingError
from common.quaternion import Array
from common.recording.stamps import Grid, lay_out

COUNT = 12_000
EVEN: Array = 100.0 + np.arange(COUNT, dtype=np.float64) * 0.01
ORDER: Array = np.arange(COUNT, dtype=np.float64)
RNG = np.random.default_rng(0)


def spoilt(at: int, value: float) -> Array:
    out = EVEN.copy()
    out[at] = value
    return out


def only(time: Array) -> Grid:
    """Repaired, with every sample in its place."""
    grid = lay_out("a.npz: t", time)
    assert np.array_equal(grid.slots, ORDER)
    assert grid.rate_hz == pytest.approx(100.0, rel=2e-4)
    return grid


def test_even_stamps_need_no_repair() -> None:
    assert only(EVEN).notes == ()


@pytest.mark.parametrize(
    ("time", "said"),
    [
        (spoilt(5000, EVEN[4999]), "1 repeated"),
        (spoilt(1, EVEN[0]), "1 repeated"),
        (spoilt(5000, EVEN[4990]), "1 going back"),
        (spoilt(5000, 0.0), "1 going back"),
        (spoilt(5000, EVEN[5000] + 5.0), "1 going back"),
        (spoilt(5000, np.nan), "1 without a number"),
        (EVEN[np.minimum(np.arange(COUNT) // 8 * 8 + 7, COUNT - 1)], "1499 bursts, 10500 repeated"),
        (EVEN + np.where(np.arange(COUNT) >= 7000, -40.0, 0.0), "the clock set back 1 times"),
        (spoilt(5000, 1e9), "1 going back"),
    ],
)
def test_what_is_wrong_with_stamps_moves_no_sample_and_is_said(time: Array, said: str) -> None:
    (note,) = only(time).notes
    assert "a.npz: t: stamps repaired" in note
    assert said in note


@pytest.mark.parametrize(
    "time",
    [
        np.append(EVEN[:-1], EVEN[-1] + 500.0),
        np.append(0.0, 1.7e9 + EVEN[1:]),
        EVEN + np.where(np.arange(COUNT) >= 7000, 3600.0, 0.0),
        EVEN + np.where(np.arange(COUNT) >= 7000, 7e4, 0.0) + np.where(np.arange(COUNT) >= 8000, 9e4, 0.0),
    ],
    ids=["last stamp", "first stamp before the clock was set", "clock set", "clock set twice"],
)
def test_a_clock_set_forward_loses_no_session_and_is_said(time: Array) -> None:
    """As a gap it would cost the recording: more than half of its samples would be missing."""
    assert "taken as a clock that was set" in only(time).notes[0]


@pytest.mark.parametrize("share", [0.15, 0.3])
def test_jitter_is_repaired(share: float) -> None:
    (note,) = only(EVEN + 0.01 * share * RNG.normal(size=COUNT)).notes
    assert f"jitter of {100 * share:.0f} %" in note or f"jitter of {100 * share + 1:.0f} %" in note


def test_a_gap_keeps_its_places_empty_whatever_the_jitter() -> None:
    kept = np.concatenate([np.arange(3000), np.arange(3200, COUNT)])
    grid = lay_out("t", (EVEN + 0.0015 * RNG.normal(size=COUNT))[kept])
    assert np.mean(grid.slots != kept) < 1e-3
    assert "200 samples are missing" in grid.notes[1]


def test_single_samples_that_are_missing_are_found_beside_jitter() -> None:
    kept = np.sort(RNG.choice(COUNT, COUNT - 60, replace=False))
    grid = lay_out("t", (EVEN + 0.0015 * RNG.normal(size=COUNT))[kept])
    assert np.abs(grid.slots - (kept - kept[0])).max() <= 1.0


@pytest.mark.parametrize(
    ("time", "message"),
    [
        (EVEN[::-1], "does not rise"),
        ((np.arange(3000) * 0.01) ** 1.5, "not evenly spaced|more than half"),
        (EVEN + 0.2 * RNG.normal(size=COUNT), "does not rise|not evenly spaced"),
        (np.where(RNG.random(COUNT) < 0.2, np.nan, EVEN), "finite times"),
        (EVEN + np.arange(COUNT) // 5 * 0.1, "more than half"),
    ],
)
def test_what_cannot_be_repaired_is_refused(time: Array, message: str) -> None:
    with pytest.raises(RecordingError, match=message):
        lay_out("t", time)
