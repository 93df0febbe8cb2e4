"""A layout of the master's file against its DBC: what carries what, or every mistake at once. Pure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from common.errors import ConfigError, ConfigMistake
from common.quaternion import Array
from master.capture.axes import WORLDS, permutation, quaternion_of
from master.capture.bits import wrong_with
from master.capture.config import LayoutConfig, SensorConfig
from master.capture.parts import COUNTER, PLACES, STAMP, TURN, Mapped, NodeLayout, Part
from master.capture.units import FACTORS, known_unit, names
from master.suit.protocol import read_messages

if TYPE_CHECKING:
    from cantools.database.can import Message, Signal


@dataclass(frozen=True, slots=True)
class MappedLayout:
    """A layout whose signals are known."""

    name: str
    config: LayoutConfig
    parts: tuple[Part, ...]
    """As the file names them; with `{id}` those of the first node."""
    by_node: Mapping[int, NodeLayout]
    take: NDArray[np.intp]
    signs: Array
    """(9,) each: the sensor's reading i is signs[i] times the unit's reading take[i]."""
    q_world: Array
    q_unit: Array
    """(4,) each: the orientation is q_world ⊗ q ⊗ conjugate(q_unit)."""
    stamp_wrap_s: float
    """Seconds after which the own time begins anew; inf: never; 0: there is none."""
    counter_wrap: int
    top: Array
    """(6,) the largest accelerometer and gyro reading; inf where the signals are wider than a converter."""
    scale: Array
    """(9,) SI per count; of channels that are not mapped that of tandem's own."""

    @property
    def fused(self) -> bool:
        """Whether the unit gives its orientation."""
        return self.config.orientation is not None


def load_layout(name: str, config: LayoutConfig, numbers: Sequence[int]) -> MappedLayout:
    """Read the DBC, for the nodes with these numbers. Raises ConfigError with every mistake."""
    key = f"suit.layout.{name}"
    try:
        messages = read_messages(config.dbc)
    except ConfigError as error:
        raise ConfigError(
            error.path, [ConfigMistake(f"{key}.dbc", m.value, m.expected) for m in error.mistakes]
        ) from None
    reading = _Reading(key, config, messages)
    by_node: dict[int, NodeLayout] = {}
    for number in dict.fromkeys(numbers) or [1]:
        by_node[number] = reading.node(number)
    if reading.mistakes:
        unique = list({(m.key, str(m.value), m.expected): m for m in reading.mistakes}.values())
        raise ConfigError(config.dbc, unique)
    parts = next(iter(by_node.values())).parts
    signals = {each.channel: each for part in parts for each in part.mapped}
    top, scale = _ranges(signals)
    stamp, counter = signals.get(STAMP), signals.get(COUNTER)
    world = config.orientation.world if config.orientation else "enu"
    frame = _frame(config)
    return MappedLayout(
        name=name,
        config=config,
        parts=parts,
        by_node=by_node,
        take=np.abs(frame).argmax(axis=1),
        signs=frame.sum(axis=1),
        q_world=quaternion_of(permutation(WORLDS.get(world, world))),
        q_unit=quaternion_of(permutation(config.axes)),
        stamp_wrap_s=0.0 if stamp is None else _wrap_s(stamp),
        counter_wrap=0 if counter is None else 1 << counter.signal.length,
        top=top,
        scale=scale,
    )


class _Reading:
    """The signals of a layout, and every mistake on the way."""

    def __init__(self, key: str, config: LayoutConfig, messages: Mapping[str, Message]) -> None:
        self._key, self._config, self._messages = key, config, messages
        self.mistakes: list[ConfigMistake] = []
        self._parts: dict[tuple[str, tuple[tuple[str, int], ...]], Part] = {}

    def node(self, number: int) -> NodeLayout:
        """What the node with that number sends."""
        config, key = self._config, self._key
        self._parts = {}
        for name, sensor in config.sensors:
            self._three(f"{key}.{name}", name, sensor, number)
        if config.orientation is not None:
            self._orientation(number)
        if config.stamp is not None:
            signal = self._signal(f"{key}.stamp.signal", config.stamp.signal, number)
            if signal is not None:
                self._put(signal, STAMP, self._factor(f"{key}.stamp", "time", config.stamp.unit, signal[1]))
        if config.counter is not None:
            signal = self._signal(f"{key}.counter", config.counter, number)
            if signal is not None:
                self._put(signal, COUNTER, 1.0)
        parts = tuple(self._parts.values())
        for part in parts:
            self._check_number(part)
        shifted = config.number_in == "identifier"
        return NodeLayout(
            parts, self._first(parts), config.id_step * (number - config.dbc_node) if shifted else 0
        )

    def _three(self, key: str, quantity: str, sensor: SensorConfig, number: int) -> None:
        for place, name in enumerate(sensor.signals):
            signal = self._signal(f"{key}.signals", name, number)
            if signal is not None:
                factor = self._factor(key, quantity, sensor.unit, signal[1])
                self._put(signal, PLACES[quantity] + place, factor, needed=sensor.every_sample)

    def _orientation(self, number: int) -> None:
        orientation, key = self._config.orientation, f"{self._key}.orientation"
        assert orientation is not None
        angles = orientation.euler is not None
        for place, name in enumerate(orientation.signals()):
            signal = self._signal(f"{key}.{'euler' if angles else 'quaternion'}", name, number)
            if signal is not None:
                factor = self._factor(key, "angle", orientation.unit, signal[1]) if angles else 1.0
                self._put(signal, TURN.start + place, factor)

    def _put(self, found: tuple[Message, Signal], channel: int, factor: float, needed: bool = True) -> None:
        message, signal = found
        selects: dict[str, int] = {}
        if signal.multiplexer_ids:
            selects[str(signal.multiplexer_signal)] = int(signal.multiplexer_ids[0])
        place = (message.name, tuple(selects.items()))
        part = self._parts.setdefault(place, Part(message, selects=selects))
        part.mapped.append(Mapped(signal, channel, factor, needed))

    def _signal(self, key: str, name: str, number: int) -> tuple[Message, Signal] | None:
        if self._config.number_in == "names":
            if "{id}" not in name:
                self._wrong(key, name, "the node's number in the name, written {id}")
                return None
            name = name.replace("{id}", str(number))
        elif "{" in name:
            self._wrong(key, name, 'number_in = "names" where a name holds {id}')
            return None
        message_name, _, signal_name = name.partition(".")
        message = self._messages.get(message_name)
        if message is None:
            self._wrong(key, name, f"a message of {self._config.dbc.name}: {_some(self._messages)}")
            return None
        signals = {signal.name: signal for signal in message.signals}
        signal = signals.get(signal_name)
        if signal is None:
            self._wrong(key, name, f"a signal of {message_name}: {_some(signals)}")
            return None
        wrong = wrong_with(signal)
        if wrong is not None:
            self._wrong(key, name, wrong)
            return None
        return message, signal

    def _factor(self, key: str, quantity: str, declared: str | None, signal: Signal) -> float:
        """To SI, by the unit of the file and of the DBC, which must agree."""
        told = (signal.unit or "").strip()
        of_dbc = known_unit(quantity, told) if told else None
        if declared is None:
            if of_dbc is None:
                says = f"the DBC says {told!r}" if told else "the DBC says none"
                self._wrong(f"{key}.unit", None, f"one of {names(quantity)}, as {says} for {signal.name}")
                return 1.0
            return FACTORS[quantity][of_dbc]
        unit = known_unit(quantity, declared)
        if unit is None:
            self._wrong(f"{key}.unit", declared, f"one of {names(quantity)}")
            return 1.0
        if of_dbc is not None and of_dbc != unit:
            expected = f"{of_dbc}, as the DBC says of {signal.name}; mend the one that is wrong"
            self._wrong(f"{key}.unit", declared, expected)
        return FACTORS[quantity][unit]

    def _check_number(self, part: Part) -> None:
        name = self._config.number_signal
        if name is None:
            return
        signals = {signal.name: signal for signal in part.message.signals}
        if name not in signals:
            expected = f"a signal of every message mapped; {part.message.name} has {_some(signals)}"
            self._wrong(f"{self._key}.number_signal", name, expected)

    def _first(self, parts: Sequence[Part]) -> int:
        needed = [place for place, part in enumerate(parts) if part.needed]
        first = self._config.first
        ordered = ", ".join(dict.fromkeys(parts[place].message.name for place in needed))
        if first is None:
            if len(needed) > 1:
                expected = f"the message that a unit sends first of each sample, of {ordered}"
                self._wrong(f"{self._key}.first", None, expected)
            return needed[0] if needed else 0
        for place in needed:
            pattern = parts[place].message.name
            if first == pattern or ("{id}" in first and pattern.startswith(first.partition("{id}")[0])):
                return place
        if not self.mistakes:  # a signal that was not found may be the cause
            self._wrong(f"{self._key}.first", first, f"a message that is mapped and waited for: {ordered}")
        return 0

    def _wrong(self, key: str, value: object, expected: str) -> None:
        self.mistakes.append(ConfigMistake(key, value, expected))


def _frame(config: LayoutConfig) -> Array:
    """(9, 9), block by block; of a gyro of the left-hand rule the signs too."""
    out = np.eye(9)
    for name, sensor in config.sensors:
        matrix = permutation(sensor.axes or config.axes)
        if name == "gyroscope" and (sensor.rotation or config.handedness) == "left":
            matrix = -matrix
        place = PLACES[name]
        out[place : place + 3, place : place + 3] = matrix
    return out


def _ranges(signals: Mapping[int, Mapped]) -> tuple[Array, Array]:
    """The largest readings (6,) and counts (9,), where a signal is as narrow as a converter."""
    top, scale = np.full(6, np.inf), np.full(9, 1e-6)
    for channel, each in signals.items():
        if channel >= 9 or each.signal.is_float:
            continue
        count = abs(float(each.signal.conversion.scale)) * each.factor
        scale[channel] = count
        if channel < 6 and each.signal.length <= 24:
            top[channel] = (2 ** (each.signal.length - 1) - 1) * count
    # the axes may be swapped: the least of each sensor holds for all three
    for sensor in (slice(0, 3), slice(3, 6)):
        top[sensor] = top[sensor].min()
    return top, scale


def _wrap_s(stamp: Mapped) -> float:
    if stamp.signal.is_float:
        return float("inf")
    return float(2.0**stamp.signal.length * float(stamp.signal.conversion.scale) * stamp.factor)


def _some(found: Mapping[str, object]) -> str:
    listed = list(found)
    return ", ".join(listed[:12]) + (" …" if len(listed) > 12 else "")
