"""Raw readings of all nodes, tick by tick, as they lie in a recording: what is put, and what is read back.

One message of the topic `suit/readings` a tick, a msgpack array: version, tick, one byte a node that is 1
where it answered this tick soundly, and N × 9 float32 (little-endian) in the order of the wire: accelerometer
m/s², gyro rad/s, magnetometer µT, raw, in the sensor's frame. The stamp is that of the tick's SYNC.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

import msgpack
import numpy as np
from mcap.writer import Writer
from numpy.typing import NDArray

from common.clock import to_ns
from common.errors import RecordingError
from common.quaternion import Array
from common.recording.reader import read_recording
from common.recording.recorder import ENCODING, METADATA, create
from common.wire.messages import Mask

TOPIC = "suit/readings"
VERSION = 1
_CHANNELS = 9
_F4 = np.dtype("<f4")
_LONGEST_TICKS = 1000 * 3600 * 24
"""A day at the highest rate; ticks further apart are no recording's."""

_pack = msgpack.Packer(autoreset=True).pack


def describe(profile: str, nodes: Sequence[str], rate_hz: float) -> dict[str, str]:
    """The metadata of a recording of these nodes, named by segment, in the order of the arrays."""
    return {
        "profile": profile,
        "nodes": json.dumps(list(nodes)),
        "rate_hz": f"{rate_hz:g}",
        "tandem": metadata.version("tandem"),
    }


def encode_readings(tick: int, fresh: Mask, readings: Array) -> bytes:
    """One tick's message: which nodes answered (N,), and readings (N, 9)."""
    values = np.ascontiguousarray(readings, dtype=_F4)
    out: bytes = _pack((VERSION, tick, fresh.tobytes(), values.tobytes()))
    return out


def write_sweeps(path: Path, profile: str, nodes: Sequence[str], rate_hz: float, readings: Array) -> None:
    """A new recording of readings (T, N, 9) on an even grid; NaN where a node has none.

    Raises RecordingError where the file is there already or cannot be written.
    """
    fresh: Mask = np.all(np.isfinite(readings[..., 3:6]), axis=-1)
    with create(path) as stream:
        writer = Writer(stream)
        writer.start(library="tandem")
        writer.add_metadata(METADATA, describe(profile, nodes, rate_hz))
        channel = writer.register_channel(TOPIC, ENCODING, 0)
        for tick in range(len(readings)):
            at_ns = to_ns(tick / rate_hz)
            payload = encode_readings(tick, fresh[tick], readings[tick])
            writer.add_message(channel, at_ns, payload, at_ns, tick)
        writer.finish()


@dataclass(frozen=True, slots=True)
class Sweeps:
    """A suit's recording on the even grid of its ticks; NaN where a node did not answer."""

    nodes: tuple[str, ...]
    rate_hz: float
    readings: NDArray[np.float32]
    """(T, N, 9)."""
    cut: str
    """How the file ends too early; empty where it was closed in order."""

    @property
    def duration_s(self) -> float:
        """Length of the recording."""
        return len(self.readings) / self.rate_hz


def read_sweeps(path: Path) -> Sweeps:
    """The suit's readings of a recording. Raises RecordingError."""
    recording = read_recording(path)
    nodes, rate_hz = _described(path, recording.metadata)
    payloads = [entry.payload for entry in recording.entries if entry.topic == TOPIC]
    if not payloads:
        raise RecordingError(f"{path}: holds no readings of a suit; record again")
    decoded = [_decode(path, payload, len(nodes)) for payload in payloads]
    ticks = np.array([tick for tick, _, _ in decoded])
    slots = ticks - ticks[0]
    if (np.diff(ticks) <= 0).any() or slots[-1] > min(_LONGEST_TICKS, 20 * len(slots) + 1000):
        raise RecordingError(f"{path}: its ticks do not follow one another; record again")
    readings = np.full((slots[-1] + 1, len(nodes), _CHANNELS), np.nan, np.float32)
    for slot, (_, fresh, values) in zip(slots, decoded, strict=True):
        readings[slot, fresh] = values[fresh]
    return Sweeps(nodes, rate_hz, readings, recording.cut)


def _described(path: Path, entries: dict[str, str]) -> tuple[tuple[str, ...], float]:
    try:
        nodes = json.loads(entries["nodes"])
        rate_hz = float(entries["rate_hz"])
        if not nodes or not all(isinstance(name, str) for name in nodes) or not 0.0 < rate_hz < 1e5:
            raise ValueError
    except (KeyError, ValueError, TypeError):
        raise RecordingError(f"{path}: does not name its nodes and their rate") from None
    return tuple(nodes), rate_hz


def _decode(path: Path, payload: bytes, count: int) -> tuple[int, Mask, NDArray[np.float32]]:
    try:
        version, tick, fresh, readings = msgpack.unpackb(payload, use_list=False)
        if version != VERSION or len(fresh) != count or type(tick) is not int:
            raise ValueError
        values = np.frombuffer(readings, _F4).reshape(count, _CHANNELS)
        return tick, np.frombuffer(fresh, np.bool_), values
    except Exception:  # msgpack raises its own family, and the shape may be wrong too
        raise RecordingError(f"{path}: a message of {TOPIC} is not of version {VERSION}") from None


def is_suit_recording(path: Path) -> bool:
    """Whether a file is an MCAP of tandem, or no readable MCAP at all: the reader then says why."""
    from mcap.records import Metadata, Schema
    from mcap.stream_reader import StreamReader

    try:
        with path.open("rb") as stream:
            for record in StreamReader(stream).records:
                if isinstance(record, Metadata) and record.name == METADATA:
                    return True
                if isinstance(record, Schema):
                    return False
    except Exception:  # what is no MCAP raises anything
        return True
    return False
