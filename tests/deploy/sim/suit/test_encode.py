from __future__ import annotations

from pathlib import Path

import cantools
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.random import default_rng

from deploy.sim.suit.encode import BatchEncoder
from master.suit.protocol import SHIPPED_DBC, SuitProtocol

IDS = (1, 5, 64, 127)
EXTREMES = np.array([-32768, 32767, -1, 0, 1, 2047, -2048, 255, 256], dtype=np.int16)


@pytest.mark.parametrize("fd", [True, False])
@settings(deadline=None)
@given(tick=st.integers(0, 2**32 - 1), seed=st.integers(0, 2**16))
def test_a_batch_equals_node_by_node(protocol: SuitProtocol, fd: bool, tick: int, seed: int) -> None:
    random = default_rng(seed)
    counts = random.integers(-32768, 32768, (len(IDS), 9)).astype(np.int16)
    counts[0] = EXTREMES
    status = random.integers(0, 4, len(IDS))
    batch = BatchEncoder(protocol.answer_format(fd), IDS).encode(counts, tick, status)
    for i, node_id in enumerate(IDS):
        assert batch[i] == protocol.encode_sample(node_id, counts[i], tick, int(status[i]), fd)


def test_cantools_reads_what_was_written(protocol: SuitProtocol) -> None:
    database = cantools.database.can.Database()
    database.add_dbc_file(Path(SHIPPED_DBC))
    counts = np.tile(EXTREMES, (len(IDS), 1))
    frames = BatchEncoder(protocol.fd, IDS).encode(counts, 123_456, np.full(len(IDS), 2))
    for (frame,), node_id in zip(frames, IDS, strict=True):
        assert frame.id == 0x100 + node_id
        message = database.get_message_by_name("NODE_SAMPLE")
        signals = message.decode_simple(frame.data, scaling=False, decode_choices=False)
        assert (signals["TICK"], signals["STATUS"]) == (123_456, 2)
        readings = [signals[f"{s}_{a}"] for s in ("ACC", "GYR", "MAG") for a in "XYZ"]
        assert readings == EXTREMES.tolist()


def test_a_bus_without_nodes_sends_nothing(protocol: SuitProtocol) -> None:
    empty = np.empty((0, 9), dtype=np.int16)
    for form in (protocol.fd, protocol.classic):
        assert BatchEncoder(form, []).encode(empty, 1, np.empty(0, dtype=np.int64)) == []
