"""`[estop]`: the robot's own emergency stop inputs, and how each of them is wired."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from typing import Literal

from pydantic import Field

from common.config.section import Section
from common.errors import NOT_SET, ConfigMistake
from common.inputs.config import KeyName
from common.wire.fields import MAX_NAME

Source = Literal["gpio", "device", "drive", "sto"]
Electric = Literal["low", "high"]
_KEYS: dict[Source, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "gpio": (("line",), ("chip", "bias", "edges", "closed_level")),
    "device": (("device", "key"), ()),
    "drive": (("joint", "bit"), ("closed_level",)),
    "sto": (("joint",), ()),
}
"""Of each source: the keys that it needs, and those that it may have."""
_OF_ALL = {"name", "source", "normally_closed"}
_BIAS_LEVEL: dict[str, Electric] = {"pull_up": "low", "pull_down": "high"}
"""The level that a closed contact makes against a resistor; a broken wire leaves the other one."""


class StopInputConfig(Section):
    """`[[estop.inputs]]`: one button, switch or indication that stops the robot."""

    name: str = Field(min_length=1, max_length=40)
    """What people call it, such as "red button at the left arm"."""
    source: Source
    normally_closed: bool = True
    """True: the contact is closed while nobody presses, so that a broken wire is a stop. False: a broken
    wire is not noticed."""

    line: str = ""
    """gpio: the line's name, or its number on `chip`."""
    chip: str = ""
    """gpio: the chip's label or device path; chips' numbers change from start to start."""
    bias: Literal["pull_up", "pull_down", "external"] = "pull_up"
    """gpio: the resistor that the chip is asked for; external: there is one outside."""
    edges: bool = True
    """gpio: false: only the level is read, every 4 ms. For chips whose driver fails at interrupts."""
    closed_level: Electric | None = None
    """gpio, drive: the line's or bit's level while the contact is closed. gpio: by `bias`; drive: high."""
    device: str = ""
    """device: a Linux input device, by name or path."""
    key: KeyName | Literal[""] = ""
    """device: the key that is down while the contact is closed."""
    joint: str = ""
    """drive, sto: the joint whose drive tells it."""
    bit: int | None = Field(None, ge=0, le=31)
    """drive: bit of the drive's digital inputs (60FDh)."""

    @property
    def on_at_rest(self) -> bool:
        """The level (see `Level.on`) while nobody presses and all wires are sound."""
        closed_on = True
        if self.source == "gpio":
            closed_on = (self.closed_level or _BIAS_LEVEL.get(self.bias)) == "high"
        elif self.source == "drive":
            closed_on = self.closed_level != "low"
        return closed_on is self.normally_closed

    @property
    def where(self) -> str:
        """Where it is connected, for people."""
        match self.source:
            case "gpio":
                return f"gpio line {self.line}" + (f" of {self.chip}" if self.chip else "")
            case "device":
                return f"{self.key} of {self.device}"
            case "drive":
                return f"input bit {self.bit} of the drive of {self.joint}"
            case "sto":
                return f"safe torque off of the drive of {self.joint}"

    def wrong(self) -> Iterator[tuple[str, object, str]]:
        """Contradictions between its keys: key, value, what was expected."""
        needs, may = _KEYS[self.source]
        for key in needs:
            if getattr(self, key) in ("", None):
                yield key, NOT_SET, f'this key to be set for source = "{self.source}"'
        if len(self.name.encode()) > MAX_NAME:
            yield "name", self.name, f"at most {MAX_NAME} bytes of UTF-8"
        for key in sorted(self.model_fields_set - _OF_ALL - {*needs, *may}):
            yield key, getattr(self, key), f'no such key for source = "{self.source}"'
        if self.source == "gpio":
            yield from self._wrong_gpio()
        if self.source == "sto" and not self.normally_closed:
            yield "normally_closed", False, "true: a drive tells by itself whether it has torque"

    def _wrong_gpio(self) -> Iterator[tuple[str, object, str]]:
        if self.line.isdecimal() and not self.chip:
            yield "chip", NOT_SET, "the chip's label, as the line is given by its number: see `gpiodetect`"
        if self.bias == "external" and self.closed_level is None:
            yield "closed_level", NOT_SET, '"low" or "high", as the resistor is outside'
        right = _BIAS_LEVEL.get(self.bias)
        if right and self.closed_level not in (None, right):
            expected = f'"{right}": with {self.bias} a broken wire reads {self.closed_level}, as if closed'
            yield "closed_level", self.closed_level, expected


class EstopConfig(Section):
    """`[estop]`: the inputs, and how their contacts are judged."""

    settle_s: float = Field(0.1, ge=0.0, le=2.0)
    """A contact must have been closed for so long before it counts as closed; opening counts at once."""
    silent_s: float = Field(0.2, ge=0.02, le=1.0)
    """An input that could not be read for so long stops the robot."""
    inputs: list[StopInputConfig] = Field(default_factory=list, max_length=16)

    def mistakes_for(self, joints: Sequence[str], telling: Collection[str] | None) -> list[ConfigMistake]:
        """Contradictions. `telling`: joints whose drives send their inputs; None: not CANopen's drives."""
        mistakes = []
        names: set[str] = set()
        places: dict[tuple[object, ...], str] = {}
        for i, one in enumerate(self.inputs):
            wrong = list(one.wrong())
            if one.name in names:
                wrong.append(("name", one.name, "a name that no other input has"))
            names.add(one.name)
            other = places.setdefault((one.where, one.chip), one.name)
            if other != one.name:
                wrong.append(("source", one.where, f"an input that {other!r} does not read already"))
            wrong += _wrong_drive(one, joints, telling)
            mistakes += [ConfigMistake(f"estop.inputs.{i}.{key}", value, want) for key, value, want in wrong]
        return mistakes


def _wrong_drive(
    one: StopInputConfig, joints: Sequence[str], telling: Collection[str] | None
) -> Iterator[tuple[str, object, str]]:
    if one.source not in ("drive", "sto"):
        return
    if telling is None:
        yield (
            "source",
            one.source,
            '"gpio" or "device": only drives on CANopen tell their inputs',
        )
    elif one.joint and one.joint not in joints:
        yield "joint", one.joint, "a joint of the profile"
    elif one.source == "drive" and one.joint and one.joint not in telling:
        yield "joint", one.joint, "a joint of servos.canopen.tell_inputs, so that its drive sends 60FDh"
