"""Each burst, measured in its samples: pulses, spacing, pitch, harmonics, and that nothing clicks."""

import itertools

import numpy as np
import pytest

from common.quaternion import Array
from master.alarms.alarm import MELODIES, Alarm, Priority
from master.alarms.mixer import Mixer
from master.alarms.tones import burst, burst_s

COUNTS = {Priority.HIGH: (10,), Priority.MEDIUM: (3,), Priority.LOW: (1, 2)}
LENGTHS_S = {Priority.HIGH: (0.075, 0.2), Priority.MEDIUM: (0.125, 0.25), Priority.LOW: (0.125, 0.25)}
SPACINGS_S = {Priority.HIGH: (0.05, 0.125), Priority.MEDIUM: (0.125, 0.25), Priority.LOW: (0.125, 0.25)}


def pulses(samples: Array) -> list[tuple[int, int]]:
    """Begin and end of each stretch that sounds; within one the wave is never still for 4 ms."""
    loud = np.flatnonzero(np.abs(samples) > 1e-9)
    breaks = np.flatnonzero(np.diff(loud) > 0.004 * RATE_HZ)
    begins = np.concatenate([loud[:1], loud[breaks + 1]])
    return list(zip(begins.tolist(), np.concatenate([loud[breaks], loud[-1:]]).tolist(), strict=True))


RATE_HZ = 48_000


@pytest.mark.parametrize("alarm", Alarm)
def test_pulses_are_as_many_and_as_far_apart_as_the_priority_has_them(alarm: Alarm) -> None:
    priority = MELODIES[alarm].priority
    found = pulses(burst(alarm, RATE_HZ))
    assert len(found) in COUNTS[priority]
    lengths_s = [(end - begin) / RATE_HZ for begin, end in found]
    gaps_s = [(after[0] - before[1]) / RATE_HZ for before, after in itertools.pairwise(found)]
    low, high = LENGTHS_S[priority]
    assert low <= min(lengths_s) <= max(lengths_s) <= high
    low, high = SPACINGS_S[priority]
    usual = [gap for i, gap in enumerate(gaps_s) if priority is not Priority.HIGH or i not in (2, 4, 7)]
    assert low <= min(usual) <= max(usual) <= high + 0.005
    if priority is Priority.HIGH:
        # the fourth of five waits two gaps and a pulse; between the halves 0.35 to 1.3 s
        assert gaps_s[2] == gaps_s[7] == pytest.approx(2 * usual[0] + lengths_s[0], abs=0.005)
        assert 0.35 <= gaps_s[4] <= 1.3


@pytest.mark.parametrize("rate_hz", [16_000, 44_100, 48_000])
@pytest.mark.parametrize("alarm", Alarm)
def test_each_pulse_has_its_pitch_and_four_harmonics_of_nearly_its_level(alarm: Alarm, rate_hz: int) -> None:
    samples, melody = burst(alarm, rate_hz), MELODIES[alarm]
    begin = 0
    count = round((0.15 if melody.priority is Priority.HIGH else 0.2) * rate_hz)
    spectrum = 20 * np.log10(np.abs(np.fft.rfft(samples[begin : begin + count], 8 * rate_hz)) + 1e-12)
    pitch = melody.pitches_hz[0]
    levels = [spectrum[8 * round(k * pitch) - 40 : 8 * round(k * pitch) + 41].max() for k in range(1, 6)]
    assert 150.0 <= pitch <= 1000.0
    assert 8 * pitch == pytest.approx(np.argmax(spectrum), abs=16)
    heard = [k for k in range(2, 6) if k * pitch <= 4000.0 and abs(levels[k - 1] - levels[0]) <= 15.0]
    assert len(heard) == 4


@pytest.mark.parametrize("alarm", Alarm)
def test_nothing_clicks_and_nothing_is_clipped(alarm: Alarm) -> None:
    samples = burst(alarm, RATE_HZ)
    assert samples[0] == samples[-1] == 0.0
    assert 0.3 < np.abs(samples).max() <= 1.0
    # a click is a step: no two samples are farther apart than within a full pulse
    full = samples[round(0.05 * RATE_HZ) : round(0.09 * RATE_HZ)]
    assert np.abs(np.diff(samples)).max() <= 1.6 * np.abs(np.diff(full)).max()
    for begin, end in pulses(samples):
        assert np.abs(samples[begin : begin + 48]).max() < 0.05
        assert np.abs(samples[end - 48 : end]).max() < 0.05


def test_two_alarms_never_sound_the_same() -> None:
    melodies = [(melody.priority, melody.pitches_hz) for melody in MELODIES.values()]
    assert len(set(melodies)) == len(Alarm)
    assert burst_s(Alarm.ESTOP) == pytest.approx(3.3)
    assert burst_s(Alarm.HOLD) == pytest.approx(1.0)


def rendered(mixer: Mixer, blocks: int, size: int = 480) -> Array:
    return np.concatenate([mixer.render(size) for _ in range(blocks)])


def test_blocks_put_together_are_the_burst_at_its_volume_then_silence() -> None:
    mixer = Mixer(RATE_HZ, 0.5)
    wave = burst(Alarm.HOLD, RATE_HZ)
    assert not rendered(mixer, 2).any()
    mixer.play(wave)
    heard = rendered(mixer, 1 + len(wave) // 480)
    np.testing.assert_allclose(heard[: len(wave)], 0.5 * wave)
    assert not rendered(mixer, 3).any()


def test_a_burst_that_is_cut_off_fades_within_five_milliseconds_without_a_click() -> None:
    mixer = Mixer(RATE_HZ, 1.0)
    low, high = burst(Alarm.CLAMP, RATE_HZ), burst(Alarm.ESTOP, RATE_HZ)
    mixer.play(low)
    # cut off where it is loudest
    before = rendered(mixer, 1, int(np.argmax(np.abs(low))) + 1)
    mixer.play(high)
    after = rendered(mixer, 10)
    fade = round(0.005 * RATE_HZ)
    np.testing.assert_allclose(after[fade : fade + 2000], high[:2000])
    joined = np.concatenate([before, after])
    assert np.abs(np.diff(joined)).max() <= 1.1 * max(np.abs(np.diff(low)).max(), np.abs(np.diff(high)).max())
