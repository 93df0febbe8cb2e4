"""A simulated drive's object dictionary and who serves it: SDO and NMT by the `canopen` library.

Its answers leave in the form and with the delay of the drive's maker.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import canopen
from canopen.sdo.exceptions import SdoAbortedError

from deploy.sim.drives.traits import Reformed, Traits
from deploy.sim.drives.wire import Send, Wire, dictionary
from slave.servos.canopen import pdo

_NO_OBJECT, _READ_ONLY = 0x0602_0000, 0x0601_0002
_PRE_OPERATIONAL, _OPERATIONAL = 0x7F, 0x05

OnRead = Callable[[int, int], int | None]
"""(index, subindex): what an entry holds now; None: what was written."""
OnWrite = Callable[[int, int, bytes], None]
"""(index, subindex, data), before it is stored. Raises SdoAbortedError."""


class ObjectServer:
    """The dictionary of one drive, from one start to the next."""

    def __init__(
        self, node_id: int, send: Send, traits: Traits, *, on_read: OnRead, on_write: OnWrite
    ) -> None:
        self._id, self._send, self._traits = node_id, send, traits
        self._on_read, self._on_write = on_read, on_write
        self._reformed = Reformed()
        self._late: list[tuple[int, bytes]] = []
        self._now_ns = 0
        self._node = canopen.LocalNode(node_id, dictionary(traits.wide_period))
        self._network = Wire(self._sent)
        self._node.associate_network(self._network)
        node: Any = self._node  # half of the library is untyped
        node.add_read_callback(self._read)
        node.add_write_callback(self._write)
        for (index, subindex), preset in traits.presets.items():
            self.store(index, subindex, self._entry(index, subindex).encode_raw(preset))
        self._node.nmt._state = _PRE_OPERATIONAL

    @property
    def state(self) -> int:
        """Of NMT, as a heartbeat tells it."""
        return int(self._node.nmt._state)

    @property
    def operational(self) -> bool:
        """Whether PDOs pass."""
        return self.state == _OPERATIONAL

    def on_frame(self, frame_id: int, data: bytes, now_ns: int) -> None:
        """SDO or NMT."""
        self._now_ns = now_ns
        segment = None
        if frame_id == pdo.SDO_REQUEST + self._id and len(data) == 8:
            segment = self._reformed.segment(data)
        if segment is not None:
            self._answer(segment)
        else:
            self._network.notify(frame_id, bytearray(data), 0.0)

    def release(self, now_ns: int) -> None:
        """Send the answers that are due."""
        while self._late and now_ns >= self._late[0][0]:
            self._send(pdo.SDO_ANSWER + self._id, self._late.pop(0)[1])

    def value(self, index: int, subindex: int = 0) -> int:
        """An entry as it is stored."""
        return int(self._entry(index, subindex).decode_raw(self._node.get_data(index, subindex)))

    def store(self, index: int, subindex: int, data: bytes) -> None:
        """Set an entry, whatever its access, unseen by `on_write`."""
        self._node.data_store.setdefault(index, {})[subindex] = bytes(data)

    def _entry(self, index: int, subindex: int) -> Any:
        raw: Any = self._node.object_dictionary[index]
        return raw[subindex] if subindex or not hasattr(raw, "decode_raw") else raw

    def _sent(self, frame_id: int, data: bytes) -> None:
        if frame_id == pdo.SDO_ANSWER + self._id:
            self._answer(self._reformed.answer(data, self._traits.read_form))
        else:
            self._send(frame_id, data)

    def _answer(self, data: bytes) -> None:
        if self._traits.answers_after_ns:
            self._late.append((self._now_ns + self._traits.answers_after_ns, data))
        else:
            self._send(pdo.SDO_ANSWER + self._id, data)

    def _read(self, index: int, subindex: int, **_: object) -> int | None:
        self._must_have(index)
        return self._on_read(index, subindex)

    def _write(self, index: int, subindex: int, data: bytes, **_: object) -> None:
        self._must_have(index)
        fixed = index in self._traits.fixed_ids and subindex == 1
        if fixed or index in self._traits.read_only:
            raise SdoAbortedError(_READ_ONLY)
        self._on_write(index, subindex, data)

    def _must_have(self, index: int) -> None:
        if index in self._traits.lacks:
            raise SdoAbortedError(_NO_OBJECT)
