"""One end of a conversation: what is sent, what is played, and with whom. Pure.

The operator who holds the lease and the person at the robot talk; nobody else is heard, and where nobody
holds the lease nothing is sent. A muted end says so five times a second, so that the other one sees it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from common.clock import NS_PER_S
from common.errors import CodecError
from common.wire.voice import VoicePacket, decode_voice, encode_voice
from deploy.ops.voice.jitter import JitterBuffer
from deploy.ops.voice.opus import Samples, silence

HEARD_NS = NS_PER_S
"""After so long without a state, or a packet of the other end, it counts as gone."""
SAY_EVERY = 10
"""A muted end says so every so many frames."""


class Encoder(Protocol):
    """Opus, or a test's."""

    def encode(self, samples: Samples) -> bytes:
        """20 ms."""
        ...


class Decoder(Protocol):
    """Opus, or a test's."""

    def decode(self, body: bytes) -> Samples:
        """20 ms."""
        ...

    def conceal(self) -> Samples:
        """20 ms in place of a missing packet."""
        ...


@dataclass(frozen=True, slots=True)
class WhoTalks:
    """What both persons see."""

    partner: str
    """`""`: nobody holds the lease, or another operator does."""
    muted: bool
    """This end."""
    other: str
    """`talks`, `muted` or `silent` (nothing comes from there)."""


class VoiceEnd:
    """One end. Its methods are called from one thread at a time; times are ns of this host's clock."""

    def __init__(
        self, operator: str, stream: int, codec: tuple[Encoder, Decoder], muted: bool = True
    ) -> None:
        """`operator`: who sits here; empty at the robot."""
        self.muted = muted
        self.jitter = JitterBuffer()
        self.foreign = 0
        """Packets of somebody who does not hold the lease."""
        self.undecodable = 0
        self.concealed = 0
        self._operator = operator
        self._stream = stream
        self._encoder, self._decoder = codec
        self._sequence = 0
        self._holder, self._holder_ns = "", -HEARD_NS
        self._other_ns, self._other_muted = -HEARD_NS, False

    def on_holder(self, operator: str, now_ns: int) -> None:
        """Who holds the robot's lease, as its newest state says; empty: nobody."""
        if operator != self._holder:
            self.jitter.pause()
            self._other_ns = -HEARD_NS
        self._holder, self._holder_ns = operator, now_ns

    def partner(self, now_ns: int) -> str:
        """The operator of this conversation; empty where there is none now."""
        if now_ns - self._holder_ns >= HEARD_NS or (self._operator and self._holder != self._operator):
            return ""
        return self._holder

    def on_payload(self, payload: bytes, operator: str, now_ns: int) -> None:
        """A packet came. `operator`: whose key it came on; empty: the robot's."""
        partner = self.partner(now_ns)
        if not partner or operator != ("" if self._operator else partner):
            self.foreign += 1
            return
        try:
            packet = decode_voice(payload)
        except CodecError:
            self.undecodable += 1
            return
        self._other_ns, self._other_muted = now_ns, packet.muted
        if packet.body:
            self.jitter.put(packet, now_ns)
        elif packet.muted:
            self.jitter.pause()

    def capture(self, samples: Samples, now_ns: int) -> bytes | None:
        """20 ms of the microphone; the payload to send, or None."""
        self._sequence += 1
        if not self.partner(now_ns):
            return None
        if not self.muted:
            packet = VoicePacket(self._stream, self._sequence, False, self._encoder.encode(samples))
            return encode_voice(packet)
        if self._sequence % SAY_EVERY:
            return None
        return encode_voice(VoicePacket(self._stream, self._sequence, True))

    def play(self, now_ns: int) -> Samples:
        """20 ms for the speaker."""
        if not self.partner(now_ns):
            self.jitter.pause()
            return silence()
        due = self.jitter.speaking
        body = self.jitter.take()
        if body is not None:
            return self._decoder.decode(body)
        if not due:
            return silence()
        self.concealed += 1
        return self._decoder.conceal()

    def shown(self, now_ns: int) -> WhoTalks:
        """For people."""
        silent = now_ns - self._other_ns >= HEARD_NS
        other = "silent" if silent else "muted" if self._other_muted else "talks"
        return WhoTalks(self.partner(now_ns), self.muted, other)
