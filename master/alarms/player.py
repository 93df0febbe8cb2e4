"""Plays bursts on a sound card, in a thread of its own: nothing that a card does holds up the master.

`sounddevice` calls `_fill` on PortAudio's thread. A card that is pulled out just stops calling, and what was
plugged in since is found only once the library has been started anew.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from typing import Any

from common.clock import Clock, monotonic_ns, to_ns
from common.process.extras import missing_extra
from master.alarms.alarm import Alarm
from master.alarms.config import AlarmsConfig
from master.alarms.mixer import Mixer
from master.alarms.tones import burst

log = logging.getLogger(__name__)

_RATE_HZ = 48_000
_DEAF_NS = to_ns(2.0)
"""A card that has asked for nothing for so long is gone: its blocks are some hundredths of a second."""
_LOOK_S = 0.5
_RETRY_S = 5.0
_JOIN_S = 2.0


def load_sounddevice() -> Any:
    """The library. Raises OSError where PortAudio is missing, ModuleNotFoundError where the package is."""
    # imported here: a master without tones does not need it
    import sounddevice

    return sounddevice


class TonePlayer:
    """`play` returns at once, whatever the card does. Without a card the reason is logged once."""

    def __init__(
        self, config: AlarmsConfig, load: Callable[[], Any] = load_sounddevice, clock: Clock = monotonic_ns
    ) -> None:
        self._config = config
        self._load = load
        self._clock = clock
        self._mixer: Mixer | None = None
        self._rate_hz = _RATE_HZ
        self._stream: Any = None
        self._library: Any = None
        self._filled_ns = 0
        self._not_installed = False
        self._ended = threading.Event()
        self._thread: threading.Thread | None = None
        self.silent_because = ""
        """Why nothing is heard; empty while a card plays."""
        self.underruns = 0
        """Blocks that came too late for the card: the tone stutters."""

    def start(self) -> None:
        """Open the card, and again whenever it has gone, in the background."""
        self._thread = threading.Thread(target=self._run, name="alarms", daemon=True)
        self._thread.start()

    def play(self, alarm: Alarm) -> None:
        """Begin a burst now; what sounds is cut off."""
        mixer = self._mixer
        if mixer is not None:
            mixer.play(burst(alarm, self._rate_hz))

    def stop(self) -> None:
        """Close the card. A card that hangs keeps its thread; nothing waits for it."""
        self._ended.set()
        if self._thread is not None:
            self._thread.join(_JOIN_S)
            self._thread = None

    def _run(self) -> None:
        while not self._ended.is_set():
            waits_s = _LOOK_S if self.look() else _RETRY_S
            if self._not_installed:
                break
            self._ended.wait(waits_s)
        self.close()

    def look(self) -> bool:
        """Open the card where it is not open, close it where it has gone; whether it plays."""
        if self._stream is not None:
            if self._stream.active and self._clock() - self._filled_ns <= _DEAF_NS:
                return True
            self.close()
            self._say("the sound card has gone")
            return False
        try:
            self._open()
        except Exception as error:
            # PortAudioError, OSError, ValueError: whatever a card or its library does, the master goes on
            self.close()
            missing = missing_extra(error) if isinstance(error, ModuleNotFoundError) else None
            self._not_installed = missing is not None
            self._say(missing or f"no sound card can be opened: {error}")
            return False
        if self.silent_because:
            log.info("alarms are heard again")
            self.silent_because = ""
        return True

    def _open(self) -> None:
        if self._library is None:
            self._library = self._load()
        else:
            # its list of devices is as old as its start
            self._library._terminate()
            self._library._initialize()
        try:
            self._start(_RATE_HZ)
        except self._library.PortAudioError:
            # not every card resamples
            found = self._library.query_devices(self._config.device, "output")
            own_hz = round(found["default_samplerate"])
            if own_hz == _RATE_HZ:
                raise
            self._start(own_hz)

    def _start(self, rate_hz: int) -> None:
        self._rate_hz, self._mixer = rate_hz, Mixer(rate_hz, self._config.volume)
        self._filled_ns = self._clock()
        self._stream = self._library.OutputStream(
            samplerate=rate_hz, channels=1, dtype="float32", device=self._config.device, callback=self._fill
        )
        self._stream.start()

    def _fill(self, out: Any, frames: int, _: object, status: Any) -> None:
        self._filled_ns = self._clock()
        self.underruns += bool(status.output_underflow)
        mixer = self._mixer
        out[:, 0] = 0.0 if mixer is None else mixer.render(frames)

    def close(self) -> None:
        """Close the card. Safe to call twice."""
        stream, self._stream, self._mixer = self._stream, None, None
        if stream is not None:
            try:
                stream.abort()
                stream.close()
            except Exception as error:
                log.debug("sound card: %s", error)

    def _say(self, why: str) -> None:
        if not self.silent_because:
            # a site that has not installed it has not asked for tones
            level = logging.INFO if self._not_installed else logging.WARNING
            log.log(level, "alarms are not heard: %s; the master goes on", why)
        self.silent_because = why
