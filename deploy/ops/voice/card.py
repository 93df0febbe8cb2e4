"""Speaker and microphone: a sound card by PortAudio, or none. Each 20 ms it takes a turn in its thread."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from common.clock import monotonic_ns, to_s
from common.errors import TandemError
from common.link.voice_config import VoiceConfig
from deploy.ops.voice.jitter import FRAME_NS
from deploy.ops.voice.opus import FRAME, RATE_HZ, Samples, silence

if TYPE_CHECKING:
    from types import ModuleType

NULL = "null"
Turn = Callable[[Samples], Samples]
"""20 ms of the microphone in, 20 ms for the speaker out."""


@contextmanager
def sound_card(config: VoiceConfig, turn: Turn, on_delay: Callable[[int], None]) -> Iterator[None]:
    """Both devices while the block lasts; `on_delay` is told from speaker to microphone, ms.

    Raises TandemError where there are none.
    """
    if NULL in (config.microphone, config.speaker):
        with _null_card(turn):
            yield
        return
    library = _load()

    def callback(heard: Samples, played: Samples, *_: object) -> None:
        played[:, 0] = turn(heard[:, 0].copy())

    device = (config.microphone or None, config.speaker or None)
    try:
        stream = library.Stream(
            samplerate=RATE_HZ, blocksize=FRAME, dtype="int16", channels=1, device=device,
            latency="low", callback=callback,
        )  # fmt: skip
    except Exception as error:  # PortAudioError, ValueError: by what fails
        raise TandemError(f"[voice] the sound card cannot be opened: {error}") from None
    on_delay(round(1000 * sum(stream.latency)))
    with stream:
        yield


def _load() -> ModuleType:
    try:
        import sounddevice
    except OSError as error:
        raise TandemError(f"voice needs PortAudio: apt install libportaudio2 ({error})") from None
    module: ModuleType = sounddevice
    return module


@contextmanager
def _null_card(turn: Turn) -> Iterator[None]:
    """No sound: a clock that takes turns with silence. What is late is skipped, as a card does."""
    ended = threading.Event()

    def run() -> None:
        due_ns = monotonic_ns()
        while not ended.wait(max(0.0, to_s(due_ns - monotonic_ns()))):
            turn(silence())
            due_ns = max(due_ns + FRAME_NS, monotonic_ns() - FRAME_NS)

    thread = threading.Thread(target=run, name="null card", daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
