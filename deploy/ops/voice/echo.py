"""Takes the speaker's sound out of the microphone's: WebRTC's processing, by LiveKit's package."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from deploy.ops.voice.opus import FRAME, RATE_HZ, Samples

if TYPE_CHECKING:
    from livekit.rtc import AudioFrame

_PART = RATE_HZ // 100
"""It works in parts of 10 ms."""


class EchoCanceller:
    """Echo, steady noise and rumble; one voice."""

    def __init__(self, delay_ms: int = 20) -> None:
        """`delay_ms`: from a frame handed to the speaker until the microphone hears it, as the card says.

        Raises ModuleNotFoundError without the package.
        """
        from livekit import rtc

        self._frame_of = rtc.AudioFrame
        self._processing = rtc.AudioProcessingModule(
            echo_cancellation=True, noise_suppression=True, high_pass_filter=True, auto_gain_control=False
        )
        self.delay_ms = delay_ms

    def played(self, samples: Samples) -> None:
        """20 ms that go to the speaker."""
        for part in samples.reshape(-1, _PART):
            self._processing.process_reverse_stream(self._frame(part))

    def clean(self, samples: Samples) -> Samples:
        """20 ms of the microphone without them."""
        out = []
        for part in samples.reshape(-1, _PART):
            frame = self._frame(part)
            self._processing.set_stream_delay_ms(self.delay_ms)
            self._processing.process_stream(frame)
            out.append(np.frombuffer(frame.data, np.int16).copy())
        cleaned: Samples = np.concatenate(out)
        assert len(cleaned) == FRAME
        return cleaned

    def _frame(self, part: Samples) -> AudioFrame:
        return self._frame_of(part.tobytes(), RATE_HZ, 1, len(part))
