"""The table of servo backends, and `[servos]`, which chooses one. To add a backend, add its line here."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TypeVar

from pydantic import ConfigDict, Field, ValidationInfo, field_validator, model_validator

from common.config.section import Section, make_section, one_of
from common.errors import NOT_SET, ConfigError, ConfigMistake
from common.skeleton import Skeleton
from slave.encoders.counts import EncoderConfig
from slave.servos.backend import BackendConfig
from slave.servos.canopen.config import CanopenConfig
from slave.servos.dynamixel.config import DynamixelConfig
from slave.servos.mujoco.config import MujocoConfig
from slave.servos.payload import PayloadConfig, payload_mistakes
from slave.servos.servos import Servos

Chosen = TypeVar("Chosen", bound=BackendConfig)


class ServosConfig(Section):
    """`[servos]` of the slave's TOML, with a section `[servos.<name>]` for each backend of the table."""

    model_config = ConfigDict(extra="allow")

    backend: str = "mujoco"
    """A name of the table."""
    payload: dict[str, PayloadConfig] = Field(default_factory=dict)
    """What the robot's segments carry, by segment."""

    @field_validator("backend")
    @classmethod
    def _known(cls, name: str) -> str:
        return one_of(name, BACKENDS)

    @model_validator(mode="before")
    @classmethod
    def _check_sections(cls, table: object, info: ValidationInfo) -> object:
        if not isinstance(table, dict):
            return table
        kinds = {name: (entry.section | None, None) for name, entry in BACKENDS.items()}
        sections = make_section("ServosConfig", kinds)
        given = {key: value for key, value in table.items() if key not in cls.model_fields}
        return {**table, **dict(sections.model_validate(given, context=info.context))}

    @property
    def entry(self) -> Backend:
        """The table's entry of the backend that is chosen."""
        return BACKENDS[self.backend]

    @property
    def chosen(self) -> BackendConfig:
        """The section of the backend that is chosen."""
        return self.section(self.entry.section)

    def section(self, kind: type[Chosen]) -> Chosen:
        """One backend's section; its defaults where the file has none.

        Raises ConfigError where the section has keys without a default and is not in the file.
        """
        for section in (self.model_extra or {}).values():
            if isinstance(section, kind):
                return section
        required = [key for key, field in kind.model_fields.items() if field.is_required()]
        if required:
            (name,) = (name for name, entry in BACKENDS.items() if entry.section is kind)
            expected = f"a section with {' and '.join(required)}"
            raise ConfigError("servos", [ConfigMistake(f"servos.{name}", NOT_SET, expected)])
        return kind()

    def mistakes_for(self, skeleton: Skeleton, encoders: EncoderConfig) -> list[ConfigMistake]:
        """What the chosen backend cannot be built from."""
        try:
            chosen = self.chosen.mistakes_for(skeleton, encoders)
        except ConfigError as error:
            chosen = error.mistakes
        return [*payload_mistakes(self.payload, skeleton), *chosen]

    def open(
        self, skeleton: Skeleton, encoders: EncoderConfig, last_known_rad: LastKnownAngles | None = None
    ) -> Servos:
        """The chosen backend's servos, not started yet. Raises RobotError where they cannot be had."""
        return self.entry.open(self, skeleton, encoders, last_known_rad or {})


LastKnownAngles = Mapping[str, float]
"""The joints' last known angles, rad, by joint."""


@dataclass(frozen=True, slots=True)
class Backend:
    """One kind of servo."""

    section: type[BackendConfig]
    """Its section `[servos.<name>]`."""
    open: Callable[[ServosConfig, Skeleton, EncoderConfig, LastKnownAngles], Servos]
    """Makes the servos. Import the adapter in this function: other robots do not need its library."""
    single_reading: bool = False
    """Whether the servo alone reads a joint's angle, so that no second encoder can contradict it."""
    remembers: bool = True
    """Whether the slave keeps the joints' last angles on disk; not for a simulated robot."""


def _open_mujoco(
    config: ServosConfig, skeleton: Skeleton, encoders: EncoderConfig, last_known_rad: LastKnownAngles
) -> Servos:
    from slave.servos.mujoco.servos import MujocoServos

    return MujocoServos(skeleton, encoders)


def _open_canopen(
    config: ServosConfig, skeleton: Skeleton, encoders: EncoderConfig, last_known_rad: LastKnownAngles
) -> Servos:
    from slave.servos.canopen.servos import CanopenServos

    return CanopenServos(
        config.section(CanopenConfig), skeleton, encoders=encoders, last_known_rad=last_known_rad
    )


def _open_dynamixel(
    config: ServosConfig, skeleton: Skeleton, encoders: EncoderConfig, last_known_rad: LastKnownAngles
) -> Servos:
    from slave.servos.dynamixel.servos import DynamixelServos

    return DynamixelServos(config.section(DynamixelConfig), skeleton, encoders)


BACKENDS: dict[str, Backend] = {
    # the simulated robot, inside the slave's process
    "mujoco": Backend(MujocoConfig, _open_mujoco, remembers=False),
    # CiA 402 drives on CAN buses
    "canopen": Backend(CanopenConfig, _open_canopen),
    # X series servos on a serial bus
    "dynamixel": Backend(DynamixelConfig, _open_dynamixel, single_reading=True),
}
