"""The typed tree that a process publishes about itself, its encoder and its decoder. Pure.

Whatever reads another process's metrics reads an attribute of these classes. A field that is renamed or
missing fails the type checker, and on arrival the decoder: it never becomes a zero.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import Field
from typing import TYPE_CHECKING, ClassVar, TypeVar

from pydantic import ConfigDict, TypeAdapter, ValidationError

from common.errors import CodecError

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

# an unknown field is a renamed one: it is refused, as a missing one is
_STRICT = ConfigDict(extra="forbid", allow_inf_nan=False)


class Metrics:
    """Base of every part of the tree: a dataclass."""

    __slots__ = ()
    __dataclass_fields__: ClassVar[dict[str, Field[object]]]
    __pydantic_config__ = _STRICT


WriteMetrics = Callable[[Metrics], None]
"""Takes what a process counted, when it stops."""
_Part = TypeVar("_Part")


def to_tree(metrics: DataclassInstance) -> dict[str, object]:
    """Plain values, for msgpack and JSON. A number that is not finite becomes None."""
    # not `asdict`, which copies deeply what is copied here again: a third of the time
    return {name: _plain(getattr(metrics, name)) for name in metrics.__dataclass_fields__}


def from_tree(kind: type[_Part], tree: object) -> _Part:
    """The metrics of plain values. CodecError names the first field that is missing, unknown or wrong."""
    try:
        part = _adapter(kind).validate_python(tree)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        where = ".".join(str(part) for part in first["loc"])
        raise CodecError(f"{kind.__name__}: {where}: {first['msg'].lower()}") from None
    assert isinstance(part, kind)
    return part


_ADAPTERS: dict[type, TypeAdapter[object]] = {}
"""Made when first used: each takes some ms."""


def _adapter(kind: type) -> TypeAdapter[object]:
    if kind not in _ADAPTERS:
        _ADAPTERS[kind] = TypeAdapter(kind)
    return _ADAPTERS[kind]


def _plain(value: object) -> object:
    kind = type(value)
    if kind is int or kind is str or kind is bool or value is None:
        return value
    if hasattr(kind, "__dataclass_fields__"):
        return {name: _plain(getattr(value, name)) for name in kind.__dataclass_fields__}
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
