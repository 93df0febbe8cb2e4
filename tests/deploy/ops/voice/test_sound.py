"""Opus and the echo canceller themselves, on made sounds; no sound card."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from common.link.voice_config import VoiceConfig
from deploy.ops.voice import card
from deploy.ops.voice.opus import FADES, FRAME, RATE_HZ, OpusDecoder, OpusEncoder, Samples, silence


def speech(seconds: float, seed: int = 0) -> Samples:
    """Noise with a voice's spectrum that comes and goes."""
    count = round(seconds * RATE_HZ)
    rough = lfilter([1.0], [1.0, -0.9], np.random.default_rng(seed).normal(0.0, 1.0, count))
    envelope = 0.05 + 0.5 * (np.sin(2 * np.pi * 1.3 * np.arange(count) / RATE_HZ) > 0)
    spoken: Samples = (20_000 * envelope * rough / np.abs(rough).max()).astype(np.int16)
    return spoken


def frames(samples: Samples) -> list[Samples]:
    return list(samples[: len(samples) // FRAME * FRAME].reshape(-1, FRAME))


def test_opus_is_small_and_sounds_alike() -> None:
    pytest.importorskip("av", reason="the extra `voice` is not installed")
    tone = (8000 * np.sin(2 * np.pi * 440 * np.arange(RATE_HZ) / RATE_HZ)).astype(np.int16)
    encoder, decoder = OpusEncoder(), OpusDecoder()
    bodies = [encoder.encode(each) for each in frames(tone)]
    assert 20 < np.mean([len(body) for body in bodies]) < 120
    heard = np.concatenate([decoder.decode(body) for body in bodies])[RATE_HZ // 2 :]
    spectrum = np.abs(np.fft.rfft(heard.astype(float)))
    assert abs(np.argmax(spectrum) * RATE_HZ / len(heard) - 440) < 3
    assert 0.7 < np.sqrt(np.mean(heard.astype(float) ** 2)) / (8000 / np.sqrt(2)) < 1.3
    assert decoder.undecodable == 0


def test_what_is_missing_fades_to_silence_and_damage_is_concealed() -> None:
    pytest.importorskip("av", reason="the extra `voice` is not installed")
    encoder, decoder = OpusEncoder(), OpusDecoder()
    for each in frames(speech(0.5)):
        last = decoder.decode(encoder.encode(each))
    loud = [np.abs(decoder.conceal()).max() for _ in range(len(FADES) + 2)]
    assert loud[0] == pytest.approx(FADES[0] * np.abs(last).max(), rel=0.02)
    assert loud[-2:] == [0, 0]
    assert decoder.decode(b"").shape == (FRAME,)
    assert decoder.undecodable == 1


def test_the_echo_of_the_speaker_is_taken_out_and_the_person_s_voice_is_not() -> None:
    pytest.importorskip("livekit", reason="the extra `voice` is not installed")
    from deploy.ops.voice.echo import EchoCanceller

    far, near = speech(8.0, seed=1), speech(8.0, seed=2)
    near[: 6 * RATE_HZ] = 0  # the person speaks in the last 2 s only, while the speaker is quiet
    far[6 * RATE_HZ :] = 0
    room = np.zeros(2400)
    room[[960, 1300, 2000]] = 0.5, -0.2, 0.1
    echo = np.convolve(far, room)[: len(far)]
    canceller = EchoCanceller(delay_ms=20)
    cleaned = []
    for played, heard in zip(frames(far), frames((echo + near).astype(np.int16)), strict=True):
        canceller.played(played)
        cleaned.append(canceller.clean(heard))
    out = np.concatenate(cleaned).astype(float)

    def power(samples: object, begin_s: float, end_s: float) -> float:
        part = np.asarray(samples, dtype=float)[round(begin_s * RATE_HZ) : round(end_s * RATE_HZ)]
        return float(np.mean(part**2)) + 1e-9

    assert 10 * np.log10(power(echo, 4, 6) / power(out, 4, 6)) > 25.0  # dB
    assert 10 * np.log10(power(out, 6.5, 8) / power(near, 6.5, 8)) > -15.0


def test_without_a_card_turns_are_taken_with_silence() -> None:
    from threading import Event

    taken: list[Samples] = []
    enough = Event()

    def turn(heard: Samples) -> Samples:
        taken.append(heard)
        if len(taken) >= 5:
            enough.set()
        return silence()

    with card.sound_card(VoiceConfig(microphone="null"), turn, lambda delay_ms: None):
        assert enough.wait(20.0)
    count = len(taken)
    assert not any(each.any() for each in taken)
    assert len(taken) == count
