"""One typed tree: whatever is renamed, missing or unknown is refused on arrival, never read as zero."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import pytest

from common.errors import CodecError
from common.metrics.master import MasterMetrics
from common.metrics.parts import Summary
from common.metrics.slave import CameraMetrics, SlaveMetrics
from common.metrics.tree import from_tree, to_tree
from tests.published import guard_metrics, master_metrics, slave_metrics

CAMERA = CameraMetrics(1, 2.0, 3.0, 4.0, 5, 6.0, 7, 8, 9, Summary(0), Summary(0), Summary(0), "")
WHOLE: dict[type, Any] = {
    MasterMetrics: master_metrics(stages_ms={"joint angles→put": Summary(3, 1.0, 1.0, 2.0, 2.0)}),
    SlaveMetrics: slave_metrics(guard=guard_metrics(dropped={"age": 2}), video=CAMERA),
}


def paths(tree: object, path: tuple[str, ...] = ()) -> list[tuple[str, ...]]:
    """Every key of the tree."""
    if not isinstance(tree, dict):
        return []
    return [found for key, item in tree.items() for found in ((*path, key), *paths(item, (*path, key)))]


@pytest.mark.parametrize("kind", WHOLE, ids=lambda kind: kind.__name__)
def test_what_is_sent_is_what_is_read(kind: type) -> None:
    assert from_tree(kind, to_tree(WHOLE[kind])) == WHOLE[kind]


@pytest.mark.parametrize("kind", WHOLE, ids=lambda kind: kind.__name__)
def test_each_renamed_field_is_refused_by_name(kind: type) -> None:
    for path in paths(to_tree(WHOLE[kind])):
        if path[-2:-1] in {("dropped",), ("stages_ms",), ("switches",), ("robots",), ("link",)}:
            continue  # names of gates, stages, switches, robots and topics are data
        tree: Any = to_tree(WHOLE[kind])
        part = tree
        for key in path[:-1]:
            part = part[key]
        part[f"{path[-1]}_renamed"] = part.pop(path[-1])
        with pytest.raises(CodecError, match=rf"{kind.__name__}: .*{path[-1]}"):
            from_tree(kind, tree)


def test_a_number_that_is_not_finite_is_unknown_and_not_zero() -> None:
    assert to_tree(Summary(1, math.nan, math.inf))["mean"] is None
    with pytest.raises(CodecError):
        from_tree(Summary, {"count": 1, "mean": math.nan})


def test_a_summary_of_nothing_has_no_figures() -> None:
    assert dataclasses.astuple(Summary(0)) == (0, None, None, None, None, None)
    assert Summary(0).total == 0.0
