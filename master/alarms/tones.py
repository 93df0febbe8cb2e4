"""The sound of each alarm as samples. Pure.

Times, pitches and harmonics lie within what public descriptions of IEC 60601-1-8 give (tables 3 and 4):
pulses of 75 to 200 ms (high) or 125 to 250 ms, 150 to 1000 Hz, four harmonics or more of up to 4000 Hz.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from common.quaternion import Array
from master.alarms.alarm import MELODIES, Alarm, Priority

_PULSE_S = {Priority.HIGH: 0.15, Priority.MEDIUM: 0.2, Priority.LOW: 0.2}
_GAP_S = {Priority.HIGH: 0.1, Priority.MEDIUM: 0.2, Priority.LOW: 0.2}
_HALVES_APART_S = 0.5
_RAMP = 0.2
"""Share of a pulse in which it rises, and in which it falls."""
HARMONICS = (1.0, 0.5, 0.4, 0.3, 0.25)
"""Amplitudes from the pitch itself upwards: the weakest is 12 dB below it."""


def pulses_s(alarm: Alarm) -> list[tuple[float, float]]:
    """(pitch, Hz; begin, s) of each pulse. A high one's fourth of five comes after two gaps and a pulse."""
    melody = MELODIES[alarm]
    pulse_s, gap_s = _PULSE_S[melody.priority], _GAP_S[melody.priority]
    at_s, out = 0.0, []
    for half in range(2 if melody.priority is Priority.HIGH else 1):
        if half:
            at_s += _HALVES_APART_S - gap_s
        for i, pitch_hz in enumerate(melody.pitches_hz):
            at_s += gap_s + pulse_s if i == 3 else 0.0
            out.append((pitch_hz, at_s))
            at_s += pulse_s + gap_s
    return out


def pulse_s(alarm: Alarm) -> float:
    """The length of a pulse."""
    return _PULSE_S[MELODIES[alarm].priority]


@lru_cache
def burst_s(alarm: Alarm) -> float:
    """From the first pulse's begin to the last one's end."""
    return pulses_s(alarm)[-1][1] + pulse_s(alarm)


@lru_cache(maxsize=32)
def burst(alarm: Alarm, rate_hz: int) -> Array:
    """The samples of one burst, within ±1, at a sound card's rate. Begins and ends in silence."""
    out = np.zeros(round(burst_s(alarm) * rate_hz) + 1)
    count = round(pulse_s(alarm) * rate_hz)
    t_s = np.arange(count) / rate_hz
    ramp = min(count // 2, round(_RAMP * count))
    envelope = np.ones(count)
    # a raised cosine: neither its value nor its slope jumps, so nothing clicks
    envelope[:ramp] = 0.5 - 0.5 * np.cos(np.pi * np.arange(ramp) / ramp)
    envelope[-ramp:] = envelope[:ramp][::-1]
    for pitch_hz, begin_s in pulses_s(alarm):
        wave = sum(
            amplitude * np.sin(2.0 * np.pi * k * pitch_hz * t_s)
            for k, amplitude in enumerate(HARMONICS, 1)
            if k * pitch_hz < 0.45 * rate_hz
        )
        begin = round(begin_s * rate_hz)
        out[begin : begin + count] = envelope * wave / sum(HARMONICS)
    out.setflags(write=False)
    return out
