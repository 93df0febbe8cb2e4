"""`[base]`: the sensor of the base's attitude."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from common.config.section import RelativePath, Section
from common.errors import ConfigMistake
from slave.attitude.base import Axis


class BaseConfig(Section):
    """`[base]` of the slave's TOML."""

    source: Literal["none", "serial", "simulated"] = "none"
    """`none`: the base carries no sensor, and its tilt is not watched. `serial`: an instrument that sends the
    7-byte frame. `simulated`: an ADXL330 and an HMC5843 that do not exist."""
    port: str = ""
    """For `serial`: the port, such as /dev/ttyUSB0, or any URL that pyserial knows."""
    baud: int = Field(9600, ge=300, le=4_000_000)
    axis: Axis = "ahead"
    """Where the instrument's axis points on the base."""
    declination_deg: float = Field(0.0, ge=-180.0, le=180.0)
    """The field's declination at this place, positive where the needle points east of true north."""
    level_tool_face_deg: float = Field(0.0, ge=0.0, lt=360.0)
    """The tool-face that the instrument shows when the base stands level."""
    most_deg_s: float = Field(500.0, gt=0.0, le=5000.0)
    """For `serial`: the base cannot lean over faster. A base of 1 m that tips over lands at 310°/s."""
    calibration: RelativePath | None = None
    """For `simulated`: the file of the two sensors' maps, as a suit's node has one."""
    time_constant_s: float = Field(3.0, ge=0.0, le=30.0)
    """For `simulated`: smoothing of the readings. Another instrument smooths by itself."""
    lean_deg: float = Field(0.0, ge=-180.0, le=180.0)
    """For `simulated`: how far the base leans to its right …"""
    lean_after_s: float = Field(0.0, ge=0.0)
    """… from so long after the start."""

    def mistakes(self) -> list[ConfigMistake]:
        """A serial source needs its port."""
        if self.source == "serial" and not self.port:
            expected = "the instrument's serial port, such as /dev/ttyUSB0"
            return [ConfigMistake("base.port", self.port, expected)]
        return []
