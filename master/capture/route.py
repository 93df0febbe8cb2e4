"""Whose frame an identifier of a bus is. Pure."""

from __future__ import annotations

from master.capture.bits import IntegerField
from master.capture.decode import LayoutDecoder

Destination = tuple[LayoutDecoder, int]
"""A decoder, and the slot of a node's part in it."""


class Route:
    """Whose frame one identifier of one bus is, as far as it takes a look into the frame."""

    def __init__(self) -> None:
        self._ways: list[tuple[tuple[IntegerField, ...], dict[tuple[int, ...], Destination]]] = []
        self._names: list[tuple[str, ...]] = []
        self.only: Destination | None = None
        """Where all its frames go, if no look into them is needed."""

    def add(self, fields: dict[str, IntegerField], values: tuple[int, ...], to: Destination) -> bool:
        """Frames whose fields have these values go `to` a decoder's slot. False: taken already."""
        names = tuple(fields)
        if names not in self._names:
            self._names.append(names)
            self._ways.append((tuple(fields.values()), {}))
        slots = self._ways[self._names.index(names)][1]
        taken = values in slots
        slots.setdefault(values, to)
        self.only = to if len(self._ways) == 1 and not names else None
        return not taken

    def frame(self, data: bytes, now_ns: int) -> bool:
        """Hand one frame on; False where there are far too many. One that is no node's changes nothing."""
        only = self.only
        if only is not None:
            return only[0].frame(only[1], data, now_ns)
        room = True
        for fields, slots in self._ways:
            to = slots.get(tuple([field.read(data) for field in fields]))
            if to is not None:
                room &= to[0].frame(to[1], data, now_ns)
        return room
