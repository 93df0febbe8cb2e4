"""Snapshots from a stranger's file: garbage raises RecordingError and nothing else, and none of it runs."""

from __future__ import annotations

import copy
import random
from contextlib import suppress
from importlib import resources
from pathlib import Path
from typing import Any
from unittest.mock import patch

import msgpack
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import deploy.examples
from common.config.load import load_config
from common.errors import RecordingError
from master.config import MasterConfig
from master.journal.memory import recall, restore
from master.pipeline import MasterPipeline
from master.suit.protocol import SuitProtocol

EXAMPLE = Path(str(resources.files(deploy.examples) / "hand" / "master.toml"))
CONFIG = load_config(EXAMPLE, MasterConfig)
PROTOCOL = SuitProtocol.load(CONFIG.capture.dbc)
KINDS = (
    "kept", "seen", "enum", "scalar", "array", "vqf", "deque", "dict", "named", "object", "list", "tuple",
    "set", "frozenset",
)  # fmt: skip
NAMES = (
    "os:system", "builtins:eval", "master.pipeline:MasterPipeline", "common.skeleton.table:Skeleton",
    "master.pipeline:MasterPipeline.__init__", "common.process.runtime:run", "master.suit.sweep:Sweep",
    "common.config.load:load_config", "subprocess:Popen", "common.link.session:LinkSession", "master:", ":",
    "",
    "common.clock:wall_ns", "master.suit.nodes:NodeConfig", "common.process.ticker:os.system",
)  # fmt: skip
atoms = st.one_of(
    st.none(), st.booleans(), st.integers(-(2**63), 2**63 - 1), st.floats(), st.text(max_size=12),
    st.binary(max_size=24), st.sampled_from(KINDS), st.sampled_from(NAMES),
    st.sampled_from(["<f8", "|O", "O8", "<i4", "V8", "S4", "<M8[ns]", "f,f", "(1000000,)f8"]),
)  # fmt: skip
plain = st.recursive(
    atoms,
    lambda parts: (
        st.lists(parts, max_size=5)
        | st.tuples(st.sampled_from(KINDS), st.integers(-1, 4), parts, parts).map(list)
    ),
    max_leaves=25,
)


@pytest.fixture(scope="module")
def memory() -> Any:
    """A real one, to be spoilt."""
    return msgpack.unpackb(msgpack.packb(recall(MasterPipeline(CONFIG, PROTOCOL))), strict_map_key=False)


def never(*_: object, **__: object) -> object:
    """What a file must never reach."""
    raise BaseException("a snapshot ran code")  # an Exception would be taken for data that does not fit


def tried(garbage: Any) -> None:
    """Restored or refused, and nothing else."""
    pipeline = MasterPipeline(CONFIG, PROTOCOL)
    with (
        patch("os.system", never),
        patch("subprocess.Popen", never),
        patch("builtins.eval", never),
        patch("builtins.exec", never),
        patch("builtins.__import__", never),
        suppress(RecordingError),
    ):
        restore(pipeline, garbage)


@settings(max_examples=150, deadline=None)
@given(garbage=plain)
def test_any_data_is_refused_or_taken(garbage: Any) -> None:
    tried(garbage)


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), value=plain)
def test_a_real_snapshot_with_a_part_exchanged(memory: Any, seed: int, value: Any) -> None:
    spoilt, draw = copy.deepcopy(memory), random.Random(seed)
    at = spoilt
    for _ in range(draw.randrange(1, 14)):
        inner = [part for part in at if isinstance(part, list) and part]
        if not inner:
            break
        at = draw.choice(inner)
    at[draw.randrange(len(at))] = value
    tried(spoilt)


@pytest.mark.parametrize("name", NAMES)
def test_no_class_is_made_by_its_constructor(name: str) -> None:
    for kind in ("object", "named"):
        tried([kind, 0, name, []])
    tried(["enum", name, 1])


@pytest.mark.parametrize(
    "garbage",
    [
        ["array", 0, "<f8", [2**40], b""],
        ["array", 0, "|O", [1], b"\x00" * 8],
        ["scalar", "|O", b"\x00" * 8],
        ["scalar", "<f8", b""],
        ["seen", 7],
        ["deque", 0, -3, []],
        ["dict", 0, [[["list", 1, []], 1]]],
        ["set", 0, [["list", 1, []]]],
        "nothing",
        None,
        7,
        [],
        [["object"]],
    ],
)
def test_known_traps_are_refused_in_words(garbage: Any) -> None:
    with pytest.raises(RecordingError):
        restore(MasterPipeline(CONFIG, PROTOCOL), garbage)


def test_a_snapshot_nested_without_end_is_refused() -> None:
    deep: Any = 0
    for _ in range(100_000):
        deep = ["list", 0, [deep]]
    with pytest.raises(RecordingError):
        restore(MasterPipeline(CONFIG, PROTOCOL), deep)
    while isinstance(deep, list):  # taken apart by hand: to delete it whole needs as deep a stack
        deep = deep[2][0]
