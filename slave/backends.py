"""`[servos]`: one backend that drives the whole robot, or several and which joints each drives."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from pydantic import ConfigDict, Field, ValidationInfo, field_validator, model_validator

from common.config.section import Section, make_section, one_of
from common.errors import NOT_SET, ConfigError, ConfigMistake, TandemError
from common.skeleton import Skeleton
from slave.encoders.counts import EncoderConfig
from slave.servos.absent.backend import BACKEND as ABSENT
from slave.servos.backend import Backend, BackendConfig, Chosen, LastKnownAngles
from slave.servos.canopen.backend import BACKEND as CANOPEN
from slave.servos.dynamixel.backend import BACKEND as DYNAMIXEL
from slave.servos.entry_points import InstalledBackends
from slave.servos.mixed import MixedServos, ServoPart
from slave.servos.mujoco.backend import BACKEND as MUJOCO
from slave.servos.payload import PayloadConfig, payload_mistakes
from slave.servos.servos import Servos
from slave.servos.shares import part_of, share_mistakes, shares

_SIMULATED = "mujoco"
BACKENDS = InstalledBackends(
    {_SIMULATED: MUJOCO, "canopen": CANOPEN, "dynamixel": DYNAMIXEL, "absent": ABSENT}
)
"""Tandem's own, and those of other packages."""


@dataclass(frozen=True, slots=True)
class BackendShare:
    """One backend that the file uses, and the robot as it sees it."""

    name: str
    section: BackendConfig
    skeleton: Skeleton
    """With the joints that it drives alone."""
    encoders: EncoderConfig


class ServosConfig(Section):
    """`[servos]` of the slave's TOML, with a section `[servos.<name>]` for each backend that it uses."""

    model_config = ConfigDict(extra="allow")

    backend: str = _SIMULATED
    """An installed backend, which drives the whole robot."""
    joints: dict[str, list[str]] = Field(default_factory=dict)
    """`[servos.joints]`, in place of `backend`: the joints of each backend, by name or pattern (`left_*`)."""
    payload: dict[str, PayloadConfig] = Field(default_factory=dict)
    """What the robot's segments carry, by segment."""

    @field_validator("backend")
    @classmethod
    def _known(cls, name: str) -> str:
        return one_of(name, _installed())

    @field_validator("joints")
    @classmethod
    def _all_known(cls, joints: dict[str, list[str]]) -> dict[str, list[str]]:
        for name in joints:
            one_of(name, _installed())
        return joints

    @model_validator(mode="before")
    @classmethod
    def _check_sections(cls, table: object, info: ValidationInfo) -> object:
        if not isinstance(table, dict):
            return table
        given = {key: value for key, value in table.items() if key not in cls.model_fields}
        kinds = {name: (_backend(name).section | None, None) for name in given if name in _installed()}
        sections = make_section("ServosConfig", kinds)
        return {**table, **dict(sections.model_validate(given, context=info.context))}

    @property
    def names(self) -> tuple[str, ...]:
        """The backends that the file uses."""
        return tuple(self.joints) or (self.backend,)

    @property
    def remembers(self) -> bool:
        """Whether the slave keeps the joints' last angles on disk."""
        return any(_backend(name).remembers for name in self.names)

    @property
    def simulated(self) -> bool:
        """Whether no joint of a real robot moves."""
        return not self.remembers

    @property
    def sections(self) -> dict[str, BackendConfig]:
        """The section of each backend that the file uses. Raises ConfigError where one is missing."""
        return {name: self._section(name) for name in self.names}

    @property
    def bus_lag_s(self) -> float:
        """Mean delay of a setpoint on its way to the drives, s; of several backends the longest."""
        return max(section.bus_lag_s for section in self.sections.values())

    def section(self, kind: type[Chosen]) -> Chosen:
        """One backend's section, used or not; its defaults where the file has none.

        Raises ConfigError where the section has keys without a default and is not in the file.
        """
        for section in (self.model_extra or {}).values():
            if isinstance(section, kind):
                return section
        required = [key for key, field in kind.model_fields.items() if field.is_required()]
        if required:
            name = next((name for name in self.names if _backend(name).section is kind), kind.__name__)
            expected = f"a section with {' and '.join(required)}"
            raise ConfigError("servos", [ConfigMistake(f"servos.{name}", NOT_SET, expected)])
        return kind()

    def used(self, kind: type[Chosen]) -> Chosen | None:
        """One backend's section; None where the file does not use that backend."""
        found = (section for section in self.sections.values() if isinstance(section, kind))
        return next(found, None)

    def share(self, kind: type[BackendConfig], skeleton: Skeleton, encoders: EncoderConfig) -> BackendShare:
        """The robot as the one backend of a kind sees it; all of it where the file does not use that kind."""
        for share in self.shares(skeleton, encoders):
            if isinstance(share.section, kind):
                return share
        return BackendShare("", self.section(kind), skeleton, encoders)

    def shares(self, skeleton: Skeleton, encoders: EncoderConfig | None = None) -> Iterator[BackendShare]:
        """Each backend that the file uses, and its part of the robot."""
        encoders = encoders or EncoderConfig()
        joints = shares(self.joints, skeleton) if self.joints else {self.backend: skeleton.joint_names}
        for name, own in joints.items():
            yield BackendShare(name, self._section(name), *part_of(skeleton, encoders, own))

    def no_effort(self, skeleton: Skeleton) -> dict[str, str]:
        """Joints whose effort nothing will tell, as far as the file says, and why."""
        return _together(share.section.no_effort(share.skeleton) for share in self.shares(skeleton))

    def not_driven(self, skeleton: Skeleton) -> dict[str, str]:
        """Joints that no servo moves, and what their angle is, in words."""
        return _together(share.section.not_driven(share.skeleton) for share in self.shares(skeleton))

    def single_reading(self, skeleton: Skeleton) -> Collection[str]:
        """Joints whose angle one encoder alone tells, so that no second one can contradict it."""
        each = (share.section.single_reading(share.skeleton) for share in self.shares(skeleton))
        return {name for names in each for name in names}

    def mistakes_for(self, skeleton: Skeleton, encoders: EncoderConfig) -> list[ConfigMistake]:
        """What the chosen backends cannot be built from."""
        mistakes = payload_mistakes(self.payload, skeleton)
        if self.joints and "backend" in self.model_fields_set:
            expected = "either one backend for the whole robot, or [servos.joints] for several"
            mistakes.append(ConfigMistake("servos.backend", self.backend, expected))
        if wrong := share_mistakes(self.joints, skeleton) if self.joints else []:
            return [*mistakes, *wrong]
        try:
            for share in self.shares(skeleton, encoders):
                mistakes += share.section.mistakes_for(share.skeleton, share.encoders)
        except ConfigError as error:
            mistakes += error.mistakes
        return mistakes

    def open(
        self, skeleton: Skeleton, encoders: EncoderConfig, last_known_rad: LastKnownAngles | None = None
    ) -> Servos:
        """The servos of the chosen backends, not started yet. Raises RobotError where they cannot be had."""
        opened = []
        for share in self.shares(skeleton, encoders):
            backend = _backend(share.name)
            servos = backend.open(share.section, share.skeleton, share.encoders, last_known_rad or {})
            own = [skeleton.joint_names.index(name) for name in share.skeleton.joint_names]
            opened.append((backend.ticked, ServoPart(share.name, servos, np.array(own, np.intp))))
        if not self.joints:
            return opened[0][1].servos
        opened.sort(key=lambda each: each[0])
        return MixedServos(skeleton.joint_names, [part for _, part in opened])

    def _section(self, name: str) -> BackendConfig:
        return self.section(_backend(name).section)


def _installed() -> Collection[str]:
    try:
        return list(BACKENDS)
    except TandemError as error:
        raise ValueError(str(error)) from error


def _backend(name: str) -> Backend[BackendConfig]:
    return BACKENDS[name]


def _together(each: Iterator[Mapping[str, str]]) -> dict[str, str]:
    return {joint: words for found in each for joint, words in found.items()}
