"""`[suit]` of the master's file: layouts of other makers' nodes, as maps of a DBC's signals.

`layout.py` reads a layout against its DBC.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from common.config.section import RelativePath, Section
from common.errors import ConfigMistake
from master.capture.axes import WORLDS, is_left_handed, permutation

SignalName = Annotated[str, Field(pattern=r"^[A-Za-z0-9_{}]+\.[A-Za-z0-9_{}]+$")]
"""MESSAGE.SIGNAL of the DBC; where `number_in = "names"`, `{id}` stands for the node's number."""
Three = Annotated[list[SignalName], Field(min_length=3, max_length=3)]
Four = Annotated[list[SignalName], Field(min_length=4, max_length=4)]
Hand = Literal["right", "left"]


def _axes(text: str) -> str:
    permutation(text)
    return text


def _world(text: str) -> str:
    if text not in WORLDS:
        permutation(text)
    return text


Axes = Annotated[str, AfterValidator(_axes)]


class SensorConfig(Section):
    """Three signals that are an accelerometer, a gyroscope or a magnetometer."""

    signals: Three
    """x, y and z, in the unit's axes."""
    unit: str | None = None
    """Their unit; None takes it from the DBC. Where both say it, both must say the same."""
    axes: Axes | None = None
    """Its own axes; None takes those of the layout."""
    every_sample: bool = True
    """False: its message comes more seldom than the others, and its last reading is held meanwhile."""
    rotation: Hand | None = None
    """Of a gyroscope: which hand's rule its signs follow; None: that of the layout's `handedness`."""


class OrientationConfig(Section):
    """An orientation that the unit has fused: four signals of a quaternion, or three Euler angles."""

    quaternion: Four | None = None
    """w, x, y, z."""
    euler: Three | None = None
    """Three angles, in the order of `sequence`."""
    sequence: str = Field(default="ZYX", pattern=r"^([XYZ]{3}|[xyz]{3})$")
    """Axes of the angles: upper case turns about the unit's own axes, one after the other (intrinsic); lower
    case about the world's (extrinsic). Yaw, pitch and roll of most makers are "ZYX"."""
    unit: str | None = None
    """Of the angles; None takes it from the DBC."""
    world: Annotated[str, AfterValidator(_world)] = "enu"
    """The world's axes: `enu`, `ned`, `nwu`, or its east, north and up as in "y x -z"."""
    inverse: bool = False
    """True: it turns the world's coordinates into the unit's, as some makers have it."""

    def signals(self) -> list[str]:
        """Those that are mapped."""
        return list(self.quaternion or self.euler or ())

    def mistakes_in(self, key: str) -> list[ConfigMistake]:
        """Neither or both; an angle about one axis twice in a row."""
        out = []
        if (self.quaternion is None) == (self.euler is None):
            out.append(ConfigMistake(key, self.signals(), "either quaternion or euler"))
        if any(a == b for a, b in zip(self.sequence, self.sequence[1:], strict=False)):
            out.append(ConfigMistake(f"{key}.sequence", self.sequence, "no axis twice in a row, as in ZYX"))
        return out


class StampConfig(Section):
    """The unit's own time of each sample."""

    signal: SignalName
    unit: str | None = None
    """s, ms, us or ns; None takes it from the DBC."""


class LayoutConfig(Section):
    """`[suit.layout.NAME]`: what the signals of a DBC are, for all nodes with `layout = "NAME"`."""

    dbc: RelativePath
    number_in: Literal["identifier", "names", "signal"] = "identifier"
    """Where a frame tells its node: in its identifier, in the names of messages or signals (with `{id}`), or
    in a signal of each message (`number_signal`)."""
    dbc_node: int = Field(default=0, ge=0, le=0x7FF)
    """The node of which the DBC gives the identifiers; the others' differ by `id_step` a number."""
    id_step: int = Field(default=1, ge=1, le=0x100000)
    number_signal: str | None = None
    """Name of the signal that holds the node's number, in every message mapped."""
    first: str | None = None
    """The message that a unit sends first of each sample; needed where a sample has several."""
    axes: Axes = "x y z"
    """The sensor's x, y and z, as axes of the unit: "y -x z". The sensor is right-handed."""
    handedness: Hand = "right"
    """Of the unit's axes. A left-handed unit needs an odd number of swaps and signs in `axes`."""
    accelerometer: SensorConfig | None = None
    gyroscope: SensorConfig | None = None
    magnetometer: SensorConfig | None = None
    orientation: OrientationConfig | None = None
    stamp: StampConfig | None = None
    counter: SignalName | None = None
    """A signal that counts the samples up by one and wraps."""
    rate_hz: float | None = Field(default=None, ge=20.0, le=2000.0)
    """Samples a second, if known; None learns it from the first ones."""
    latency_ms: float = Field(default=0.0, ge=0.0, le=50.0)
    """From a unit's sample to the arrival of its first frame, as far as the maker states it."""

    @property
    def sensors(self) -> Iterator[tuple[str, SensorConfig]]:
        """Those that are mapped, by quantity."""
        for name in ("accelerometer", "gyroscope", "magnetometer"):
            sensor = getattr(self, name)
            if sensor is not None:
                yield name, sensor

    def mistakes_in(self, key: str) -> list[ConfigMistake]:
        """What is wrong whatever the DBC says."""
        out = []
        fused = self.orientation is not None
        if not fused and (self.accelerometer is None or self.gyroscope is None):
            out.append(
                ConfigMistake(key, [name for name, _ in self.sensors],
                              "an accelerometer and a gyroscope, or an orientation")
            )  # fmt: skip
        for name, axes in [("axes", self.axes), *((f"{n}.axes", s.axes) for n, s in self.sensors if s.axes)]:
            left = is_left_handed(permutation(axes))
            if left and self.handedness == "right":
                expected = (
                    "a right-handed frame: these axes mirror it; change one sign, or say "
                    'handedness = "left" if the unit itself is left-handed'
                )
                out.append(ConfigMistake(f"{key}.{name}", axes, expected))
            elif not left and self.handedness == "left":
                expected = "an odd number of swaps and signs, as the unit is left-handed and a sensor is not"
                out.append(ConfigMistake(f"{key}.{name}", axes, expected))
        for name, sensor in self.sensors:
            if sensor.rotation is not None and name != "gyroscope":
                out.append(
                    ConfigMistake(f"{key}.{name}.rotation", sensor.rotation, "it for a gyroscope only")
                )
        if self.orientation is not None:
            out += self.orientation.mistakes_in(f"{key}.orientation")
            world = permutation(WORLDS.get(self.orientation.world, self.orientation.world))
            if is_left_handed(world) != (self.handedness == "left"):
                expected = f"a {self.handedness}-handed world, as the unit is {self.handedness}-handed"
                out.append(ConfigMistake(f"{key}.orientation.world", self.orientation.world, expected))
        if (self.number_in == "signal") != (self.number_signal is not None):
            expected = 'the name of a signal where number_in = "signal", and only there'
            out.append(ConfigMistake(f"{key}.number_signal", self.number_signal, expected))
        return out


WithoutNode = Literal["parent", "neutral"]


class SuitSection(Section):
    """`[suit]`: nodes that are not tandem's own, and segments that have none."""

    layout: dict[str, LayoutConfig] = Field(default_factory=dict)
    default: str | None = None
    """The layout of nodes that name none; None: tandem's own protocol."""
    without_node: dict[str, WithoutNode] = Field(default_factory=dict)
    """Segments without a node: `parent` moves with the segment that bears it, `neutral` keeps its joints at
    zero, or at the limit nearest to it."""
    delay_ms: float | None = Field(default=None, ge=1.0, le=60.0)
    """How far back free-running nodes are sampled, so that each has a sample after that instant; None: the
    period of the slowest and 2 ms."""

    def mistakes(self) -> list[ConfigMistake]:
        """Those of each layout, and a default that is none of them."""
        out = [m for name, layout in self.layout.items() for m in layout.mistakes_in(f"suit.layout.{name}")]
        if self.default is not None and self.default not in self.layout:
            known = ", ".join(self.layout) or "no [suit.layout.NAME] yet"
            out.append(ConfigMistake("suit.default", self.default, f"one of the layouts: {known}"))
        return out
