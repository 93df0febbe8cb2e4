"""From the bus into a recording: what `calibrate record` and `calibrate live` share."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from common.errors import TandemError
from common.quaternion import Array
from common.recording import McapRecorder
from common.recording.sweeps import TOPIC, describe
from master.capture.polling import OnSweep, SuitCapture
from master.capture.source import SuitSource, suit_source
from master.config import MasterConfig
from master.suit.protocol import SuitProtocol
from master.suit.recorded import encode_sweep
from master.suit.sweep import Sweep


def names(config: MasterConfig) -> tuple[str, ...]:
    """The nodes, by segment, in the order of all arrays."""
    return config.skeleton.segment_names


def open_source(config: MasterConfig) -> SuitSource:
    """The suit of a master's file. Opens no bus."""
    capture = config.capture
    fd = {bus.name: bus.fd for bus in capture.buses}
    protocol = SuitProtocol.load(capture.dbc)
    return suit_source(names(config), config.nodes, config.suit, protocol, capture.lost_after, fd)


def open_capture(config: MasterConfig, on_sweep: OnSweep) -> SuitCapture:
    """The suit of a master's file, to be polled as the master does. Opens no bus yet."""
    return SuitCapture(open_source(config), config.capture.buses, config.capture.rate_hz, on_sweep)


def open_recorder(config: MasterConfig, path: Path) -> McapRecorder:
    """A new recording of that suit. Raises RecordingError."""
    return McapRecorder(path, describe(config.profile, names(config), config.capture.rate_hz))


def record(recorder: McapRecorder, sweep: Sweep) -> None:
    """Put one tick."""
    recorder.put(TOPIC, encode_sweep(sweep), sweep.sampled_ns)


def readings(sweep: Sweep) -> Array:
    """(N, 9) of one tick in the order of the wire; NaN where a node did not answer."""
    out = np.concatenate([sweep.acc_m_s2, sweep.gyr_rad_s, sweep.mag_ut], axis=1)
    out[~sweep.fresh] = np.nan
    return out


def check_written(recorder: McapRecorder) -> None:
    """Raise TandemError for a recording that is not whole."""
    counters = recorder.counters
    missing = counters.refused + counters.lost
    if counters.failed:
        raise TandemError(
            f"{recorder.path}: the recording ended early: {counters.failed}; {counters.written} ticks are in "
            "it. Make room and record again"
        )
    if missing:
        raise TandemError(
            f"{recorder.path}: the disk was too slow for {missing} of {counters.put} ticks; they are missing"
        )


def heard(answered: Sequence[int], of: Sequence[str]) -> str:
    """How many nodes answer, and which do not."""
    silent = [name for name, count in zip(of, answered, strict=True) if not count]
    if not silent:
        return f"all {len(of)} nodes answer"
    shown = ", ".join(silent[:4]) + (" …" if len(silent) > 4 else "")
    return f"{len(of) - len(silent)} of {len(of)} nodes answer; silent: {shown}"
