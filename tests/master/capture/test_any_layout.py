"""Nodes of any DBC are read as cantools reads it: bit order, sign, float, multiplexer, 29-bit identifier."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cantools
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from common.can.frame import EXTENDED
from master.capture.config import LayoutConfig, SensorConfig, StampConfig
from master.capture.free_running import FreeNodes
from master.capture.layout import load_layout
from master.capture.parts import CHANNELS
from master.suit.nodes import NodeConfig

UNITS = {"A": "m/s^2", "G": "deg/s"}
FACTORS = {"A": 1.0, "G": np.pi / 180.0}
NODES = 3
STEP = 0x40


@dataclass(frozen=True)
class Shape:
    """One signal: its bytes in the frame, and where in them it stands."""

    bits: int
    shift: int
    little: bool
    signed: bool
    is_float: bool
    scale: float
    offset: float

    @property
    def room(self) -> int:
        return -(-(self.bits + self.shift) // 8)

    def line(self, name: str, byte: int, unit: str, mux: str) -> str:
        first = 8 * byte + self.shift
        start = first if self.little else 8 * (first // 8) + 7 - first % 8
        kind = f"{start}|{self.bits}@{int(self.little)}{'-' if self.signed or self.is_float else '+'}"
        return f' SG_ {name} {mux}: {kind} ({self.scale!r},{self.offset!r}) [0|0] "{unit}" N'


@st.composite
def shapes(draw: st.DrawFn) -> Shape:
    is_float = draw(st.booleans()) and draw(st.booleans())
    return Shape(
        bits=32 if is_float else draw(st.integers(2, 20)),
        shift=0 if is_float else draw(st.integers(0, 7)),
        little=draw(st.booleans()),
        signed=draw(st.booleans()),
        is_float=is_float,
        scale=draw(st.sampled_from([1.0, 0.001, 0.0078125, 3.0])),
        offset=draw(st.sampled_from([0.0, -10.5])),
    )


@dataclass(frozen=True)
class Described:
    """A DBC of two messages, an accelerometer's and a gyro's; `muxed`: both have one identifier."""

    shapes: list[Shape]
    muxed: bool
    extended: bool

    def text(self) -> str:
        ids = [0x100, 0x100 if self.muxed else 0x101]
        floats, lines = [], ['VERSION ""', "BU_: N"]
        offset = EXTENDED + 0x1234000 if self.extended else 0
        for index, (letter, frame_id) in enumerate(zip("AG", ids, strict=True)):
            if index == 0 or not self.muxed:
                lines.append(f"BO_ {frame_id + offset} M{index}: 64 N")
            if self.muxed and index == 0:
                lines.append(' SG_ MUX M : 0|8@1+ (1,0) [0|0] "" N')
            byte = 1
            for axis, shape in zip("XYZ", self.shapes[3 * index : 3 * index + 3], strict=True):
                mux = f"m{5 + index} " if self.muxed else ""
                lines.append(shape.line(f"{letter}{axis}", byte, UNITS[letter], mux))
                byte += shape.room
                if shape.is_float:
                    floats.append(f"SIG_VALTYPE_ {frame_id + offset} {letter}{axis} : 1;")
        return "\n".join([*lines, "", *floats, ""])

    def message_of(self, letter: str) -> str:
        return "M0" if self.muxed or letter == "A" else "M1"

    def layout(self, dbc: Path) -> LayoutConfig:
        three = {
            letter: SensorConfig(signals=[f"{self.message_of(letter)}.{letter}{axis}" for axis in "XYZ"])
            for letter in "AG"
        }
        return LayoutConfig(
            dbc=dbc, id_step=STEP, dbc_node=1, first="M0", accelerometer=three["A"], gyroscope=three["G"]
        )


@settings(deadline=None, max_examples=60)
@given(
    described=st.builds(
        Described, st.lists(shapes(), min_size=6, max_size=6), muxed=st.booleans(), extended=st.booleans()
    ),
    seed=st.integers(0, 2**32 - 1),
)
def test_samples_are_what_cantools_decodes(
    tmp_path_factory: pytest.TempPathFactory, described: Described, seed: int
) -> None:
    dbc = tmp_path_factory.mktemp("dbc") / "any.dbc"
    dbc.write_text(described.text(), "utf-8")
    layout = load_layout("any", described.layout(dbc), range(1, NODES + 1))
    nodes = {row: NodeConfig(id=row + 1, bus="b", layout="any") for row in range(NODES)}
    free = FreeNodes(nodes, [layout] * NODES, 0, None)
    database = cantools.database.can.Database(strict=False)
    database.add_dbc_string(described.text())
    random = np.random.default_rng(seed)
    expected: dict[int, list[list[float]]] = {row: [] for row in range(NODES)}
    for index in range(4):
        for row in random.permutation(NODES).tolist():
            values = []
            for place, letter in enumerate("AG"):
                message = database.get_message_by_name(described.message_of(letter))
                data = bytearray(random.bytes(64))
                if described.muxed:
                    data[0] = 5 + place
                frame_id = message.frame_id + row * STEP + (EXTENDED if described.extended else 0)
                assert free.routes["b", frame_id].frame(bytes(data), 10 * index + place)
                read = message.decode(bytes(data), decode_choices=False)
                assert isinstance(read, dict)
                values += [float(str(read[f"{letter}{axis}"])) * FACTORS[letter] for axis in "XYZ"]
            expected[row].append(values)
    (decoder,) = free._decoders
    samples = decoder.take()
    assert samples is not None
    assert samples.values.shape == (4 * NODES, CHANNELS)
    for row in range(NODES):
        mine = samples.values[np.array(samples.rows) == row, :6]
        np.testing.assert_allclose(mine, expected[row], rtol=1e-12, atol=1e-12)
    assert (decoder.incomplete == 0).all()


ORDER = st.lists(st.tuples(st.integers(0, 1), st.integers(0, 2), st.booleans()), max_size=40)
"""Frames of two nodes and three parts, and whether a tick ends after each."""


class OneByOne:
    """The rule, frame by frame: a sample is the frames from a first part on, each part once."""

    def __init__(self) -> None:
        self.begun: dict[int, list[tuple[int, int]] | None] = {}
        self.whole: list[tuple[int, list[int]]] = []
        self.incomplete = [0, 0]

    def frame(self, node: int, part: int, number: int) -> None:
        begun = self.begun.get(node)
        if part == 0:
            self.incomplete[node] += begun is not None
            self.begun[node] = [(0, number)]
            return
        if begun is None:
            return
        begun.append((part, number))
        if len(begun) == 3:
            self.begun[node] = None
            if sorted(place for place, _ in begun) == [0, 1, 2]:
                self.whole.append((node, [n for _, n in sorted(begun)]))
            else:
                self.incomplete[node] += 1


THREE = """VERSION ""
BU_: N
BO_ 256 M0: 8 N
 SG_ T : 0|32@1+ (1,0) [0|0] "s" N
BO_ 257 M1: 8 N
 SG_ X : 0|20@1+ (1,0) [0|0] "m/s^2" N
 SG_ Y : 20|20@1+ (1,0) [0|0] "m/s^2" N
 SG_ Z : 40|20@1+ (1,0) [0|0] "m/s^2" N
BO_ 258 M2: 8 N
 SG_ X : 0|20@1+ (1,0) [0|0] "rad/s" N
 SG_ Y : 20|20@1+ (1,0) [0|0] "rad/s" N
 SG_ Z : 40|20@1+ (1,0) [0|0] "rad/s" N
"""


@settings(deadline=None, max_examples=200)
@given(order=ORDER)
def test_whatever_comes_in_whatever_order_no_two_samples_are_mixed(
    tmp_path_factory: pytest.TempPathFactory, order: list[tuple[int, int, bool]]
) -> None:
    dbc = tmp_path_factory.mktemp("dbc") / "three.dbc"
    dbc.write_text(THREE, "utf-8")
    config = LayoutConfig(
        dbc=dbc, id_step=STEP, dbc_node=1, first="M0", stamp=StampConfig(signal="M0.T"),
        accelerometer=SensorConfig(signals=["M1.X", "M1.Y", "M1.Z"]),
        gyroscope=SensorConfig(signals=["M2.X", "M2.Y", "M2.Z"]),
    )  # fmt: skip
    layout = load_layout("three", config, [1, 2])
    nodes = {row: NodeConfig(id=row + 1, bus="b", layout="three") for row in range(2)}
    free = FreeNodes(nodes, [layout] * 2, 0, None)
    (decoder,) = free._decoders
    # parts in the layout's own order: those of the sensors first, the stamp's last
    parts = [part.message.name for part in layout.parts]
    rule, got = OneByOne(), []
    for number, (node, part, ends) in enumerate(order):
        name = f"M{part}"
        rule.frame(node, part, number)
        slot = node * decoder.parts + parts.index(name)
        decoder.frame(slot, number.to_bytes(8, "little"), number)
        samples = decoder.take() if ends or number == len(order) - 1 else None
        if samples is not None:
            for row, values in zip(samples.rows, samples.values, strict=True):
                got.append((row, [int(values[13]), int(values[0]), int(values[3])]))
    assert sorted(got) == sorted(rule.whole)
    # what never ended may be broken already, and is counted when the node begins anew
    assert all(a <= b for a, b in zip(decoder.incomplete.tolist(), rule.incomplete, strict=True))
