"""The memory of a tree of objects as plain data, and back into another tree of the same kind.

A replay that begins in the middle needs what filters and counters had learnt until then. Nothing has to be
listed: every attribute that can change is found by walking the objects. What a configuration decides (its
sections, tables, functions) is left out; the tree that is filled was built from the same one. Filling runs no
code of the data's choosing: a file from a stranger can hold wrong numbers, never instructions.
"""

from __future__ import annotations

import sys
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Protocol, TypeGuard, TypeVar

import numpy as np
from pydantic import BaseModel

from common.errors import RecordingError
from common.skeleton import Skeleton
from master.suit.protocol import SuitProtocol

Plain = None | bool | int | float | str | bytes | list["Plain"]
"""What msgpack holds; everything else is a list that begins with its kind."""

Kind = TypeVar("Kind")

_ATOMS = (bool, int, float, str, bytes, type(None))
_SETTLED = (BaseModel, Skeleton, SuitProtocol)
"""Types that a configuration decides: never part of the memory."""
_OWN = ("master.", "common.")
_REMEMBERED: dict[type[object], bool] = {}
_SLOTS: dict[type[object], tuple[str, ...]] = {}
"""Looked up once a type: a snapshot is taken in the control loop."""
_SEQUENCES: dict[str, Callable[[list[object]], object]] = {
    "list": list, "tuple": tuple, "set": set, "frozenset": frozenset,
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class _Kept:
    """What the tree that is filled has in this place already."""


_KEPT = _Kept()


def recall(root: object) -> Plain:
    """The memory of `root` and of all that it reaches."""
    return _Recall().of(root)


def restore(root: object, memory: Plain) -> None:
    """Fill `root`, freshly built from the same configuration, with a memory. Raises RecordingError."""
    try:
        filled = _Restore().value(memory, root)
    except RecordingError:
        raise
    except Exception as error:  # the data may be of any shape
        raise RecordingError(f"a snapshot does not fit this version's pipeline ({error})") from None
    if filled is not root:
        raise RecordingError(f"a snapshot is not the memory of a {type(root).__name__}")


class _Filter(Protocol):
    """A filter of the package `vqf`."""

    state: Mapping[str, Plain]


class _Recall:
    """One walk. What is met twice is written once, so that shared arrays stay shared."""

    def __init__(self) -> None:
        self._seen: dict[int, tuple[int, object]] = {}

    def of(self, value: object) -> Plain:
        if type(value) in _ATOMS:
            return value  # type: ignore[return-value]  # `type(x) in` narrows nothing
        if isinstance(value, Enum):
            return ["enum", _name(type(value)), self.of(value.value)]
        if isinstance(value, np.generic):
            return ["scalar", value.dtype.str, value.tobytes()]
        if not _remembered(type(value)):
            return ["kept"]
        seen = self._seen.get(id(value))
        if seen is not None:
            return ["seen", seen[0]]
        number = len(self._seen)
        self._seen[id(value)] = number, value  # held, so that no other object gets its id
        if isinstance(value, np.ndarray):
            return ["array", number, value.dtype.str, list(value.shape), value.tobytes()]
        if _is_vqf(value):
            parts: list[Plain] = [[key, part] for key, part in value.state.items()]
            return ["vqf", number, parts]
        if isinstance(value, deque):
            return ["deque", number, value.maxlen, [self.of(part) for part in value]]
        if isinstance(value, dict):
            return ["dict", number, [[self.of(key), self.of(part)] for key, part in value.items()]]
        if isinstance(value, tuple) and type(value) is not tuple:
            return ["named", number, _name(type(value)), [self.of(part) for part in value]]
        if isinstance(value, list | tuple | set | frozenset):
            return [type(value).__name__, number, [self.of(part) for part in value]]
        attributes: Plain = [[key, self.of(getattr(value, key))] for key in _attributes(value)]
        return ["object", number, _name(type(value)), attributes]


class _Restore:
    """One filling; `there` is what the tree has in a place now."""

    def __init__(self) -> None:
        self._made: dict[int, object] = {}

    def value(self, plain: Plain, there: object) -> object:
        if not isinstance(plain, list):
            return plain
        kind, *rest = plain
        if kind == "kept":
            return there
        if kind == "seen":
            return self._made[_int(rest[0])]
        if kind == "enum":
            return _class(rest[0], Enum)(rest[1])
        if kind == "scalar":
            return np.frombuffer(_bytes(rest[1]), _dtype(rest[0]))[0]
        number = _int(rest[0])
        made = self._made[number] = self._make(kind, rest[1:], there, number)
        return made

    def _make(self, kind: Plain, rest: list[Plain], there: object, number: int) -> object:
        if kind == "array":
            shape = [_int(size) for size in _list(rest[1])]
            return np.frombuffer(_bytes(rest[2]), _dtype(rest[0])).reshape(shape).copy()
        if kind == "vqf":
            if not _is_vqf(there):
                raise RecordingError("a snapshot has a filter where this configuration has none")
            there.state = {str(key): part for key, part in map(_pair, _list(rest[0]))}
            return there
        if kind == "object":
            return self._object(str(rest[0]), _list(rest[1]), there, number)
        if kind == "named":
            return tuple.__new__(_class(rest[0], tuple), self._parts(_list(rest[1]), there))
        if kind == "deque":
            length = rest[0]
            parts = self._parts(_list(rest[1]), there)
            return deque(parts, None if length is None else _int(length))
        if kind == "dict":
            before = there if isinstance(there, dict) else {}
            pairs = [(self.value(key, _KEPT), part) for key, part in map(_pair, _list(rest[0]))]
            return {key: self.value(part, before.get(key, _KEPT)) for key, part in pairs}
        return _SEQUENCES[str(kind)](self._parts(_list(rest[0]), there))

    def _parts(self, parts: list[Plain], there: object) -> list[object]:
        before = list(there) if isinstance(there, list | tuple | deque) else []
        return [self.value(part, before[i] if i < len(before) else _KEPT) for i, part in enumerate(parts)]

    def _object(self, name: str, attributes: list[Plain], there: object, number: int) -> object:
        kind = _class(name, object)
        made = there if type(there) is kind else object.__new__(kind)
        self._made[number] = made
        for key, part in map(_pair, attributes):
            key = str(key)
            value = self.value(part, getattr(made, key, _KEPT))
            if value is _KEPT:
                raise RecordingError(f"a snapshot has a {name}, of which {key} cannot be filled")
            object.__setattr__(made, key, value)
        return made


def _int(plain: Plain) -> int:
    if type(plain) is not int:
        raise RecordingError(f"a snapshot has {plain!r} where a number is needed")
    return plain


def _bytes(plain: Plain) -> bytes:
    if not isinstance(plain, bytes):
        raise RecordingError("a snapshot lacks the bytes of an array")
    return plain


def _list(plain: Plain) -> list[Plain]:
    if not isinstance(plain, list):
        raise RecordingError("a snapshot lacks a list")
    return plain


def _pair(plain: Plain) -> tuple[Plain, Plain]:
    key, value = _list(plain)
    return key, value


def _dtype(plain: Plain) -> np.dtype[np.generic]:
    return np.dtype(str(plain))


def _remembered(kind: type[object]) -> bool:
    known = _REMEMBERED.get(kind)
    if known is None:
        known = _REMEMBERED[kind] = _can_change(kind)
    return known


def _is_vqf(value: object) -> TypeGuard[_Filter]:
    return _of_vqf(type(value))


def _of_vqf(kind: type[object]) -> bool:
    """By its name: a host whose nodes all have other filters may lack the package."""
    return kind.__module__.partition(".")[0] == "vqf"


def _can_change(kind: type[object]) -> bool:
    """Whether something of this type can change: data, filters, and objects of the project's own classes."""
    if _of_vqf(kind) or issubclass(kind, np.ndarray | deque | dict | list | tuple | set | frozenset):
        return True
    called = any("__call__" in vars(base) for base in kind.__mro__)
    return kind.__module__.startswith(_OWN) and not issubclass(kind, _SETTLED) and not called


def _attributes(value: object) -> list[str]:
    return [*(name for name in _slots(type(value)) if hasattr(value, name)), *getattr(value, "__dict__", ())]


def _slots(kind: type[object]) -> tuple[str, ...]:
    known = _SLOTS.get(kind)
    if known is None:
        names = [name for base in kind.__mro__ for name in getattr(base, "__slots__", ())]
        known = _SLOTS[kind] = tuple(name for name in names if name not in ("__dict__", "__weakref__"))
    return known


def _name(kind: type) -> str:
    return f"{kind.__module__}:{kind.__qualname__}"


def _class(name: object, base: type[Kind]) -> type[Kind]:
    """A class of the project that is loaded already; none other."""
    module, _, path = str(name).partition(":")
    found: object = sys.modules.get(module) if module.startswith(_OWN) else None
    for part in path.split("."):
        found = getattr(found, part, None)
    if not (isinstance(found, type) and issubclass(found, base) and found.__module__.startswith(_OWN)):
        raise RecordingError(f"a snapshot names {name}, which this version does not have")
    return found
