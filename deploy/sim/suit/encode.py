"""All nodes' answers of one tick at once; byte for byte what `SuitProtocol.encode_sample` gives."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from common.can.frame import CanFrame
from deploy.sim.suit.imperfections import Counts
from master.suit.layout import AnswerLayout
from master.suit.protocol import AnswerFormat


class BatchEncoder:
    """Encodes the answers of given nodes, all on buses of one kind."""

    def __init__(self, form: AnswerFormat, node_ids: Sequence[int]) -> None:
        self._form = form
        self._parts = [_PartEncoder(part, node_ids) for part in form.parts]

    def encode(self, counts: Counts, tick: int, status: NDArray[np.integer]) -> list[list[CanFrame]]:
        """Each node's frames, for counts (n, 9), and status (n,), in the order of the nodes."""
        step = self._form.readings_a_part
        fd = self._form.fd
        columns = []
        for place, part in enumerate(self._parts):
            data = part.encode(counts[:, step * place : step * (place + 1)], tick, status)
            columns.append([CanFrame(id_, d, fd) for id_, d in zip(part.frame_ids, data, strict=True)])
        return [list(frames) for frames in zip(*columns, strict=True)]


class _PartEncoder:
    """One message of each node; on CAN FD there is one, on classic CAN there are three."""

    def __init__(self, layout: AnswerLayout, node_ids: Sequence[int]) -> None:
        self.frame_ids = [layout.base_id + node_id for node_id in node_ids]
        self._layout = layout
        self._blank = np.array([layout.crc.blank(frame_id) for frame_id in self.frame_ids], dtype=np.uint8)
        self._length = layout.length

    def encode(self, raw: Counts, tick: int, status: NDArray[np.integer]) -> list[bytes]:
        layout = self._layout
        frames = np.zeros(len(raw), dtype=layout.dtype)
        frames["raw"] = raw
        # tick and status may share a word, so each adds its own bits
        frames["tick"] |= np.array((tick & layout.tick.mask) << layout.tick.shift, layout.tick.dtype)
        frames["status"] |= ((status & layout.status.mask) << layout.status.shift).astype(layout.status.dtype)
        table = frames.view(np.uint8).reshape(-1, self._length)
        # with a CRC of 0 the fold lacks just the CRC
        table[:, -1] = layout.crc.folded(table) ^ self._blank
        out = table.tobytes()
        return [out[i : i + self._length] for i in range(0, len(out), self._length)]
