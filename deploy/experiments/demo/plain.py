"""Published metrics as plain values, for a report's tree."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from common.metrics.tree import to_tree

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


def tree_or_none(metrics: DataclassInstance | None) -> dict[str, Any] | None:
    """Plain values; None where the process did not publish them."""
    return None if metrics is None else to_tree(metrics)


def trees(parts: Mapping[str, DataclassInstance]) -> dict[str, Any]:
    """Plain values of each."""
    return {name: to_tree(part) for name, part in parts.items()}
