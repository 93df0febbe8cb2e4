"""`[estimation]` of the master's file: how readings become orientations."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, Self

from pydantic import Field, ModelWrapValidatorHandler, PrivateAttr, ValidationInfo, model_validator

from common.config.section import Section
from common.errors import ConfigMistake
from master.orientation.filter import FilterSection
from master.orientation.filters import FILTERS, filter_mistakes, read_sections
from master.orientation.joints.online import OnlineConfig


class EstimationConfig(Section):
    """`[estimation]`: how readings become orientations."""

    filter: str = "vqf"
    """Orientation filter of every node that does not name its own."""
    order: Literal[2, 4, 6, 8] = 2
    """Order of the Butterworth low-passes."""
    # equal cut-offs keep the three sensors in step: on the five BROAD trials at hand vqf's error is 2.51° at
    # 50 Hz for all as with none at all, 3.7° with the accelerometer at 10 Hz, 6.2° with the magnetometer at 5
    accelerometer_cutoff_hz: float = Field(default=50.0, ge=0.0, allow_inf_nan=False)
    """-3 dB; 0 leaves the accelerometer as it is."""
    gyroscope_cutoff_hz: float = Field(default=50.0, ge=0.0, allow_inf_nan=False)
    """-3 dB; 0 leaves the gyroscope as it is. Its delay is made good in the posture."""
    magnetometer_cutoff_hz: float = Field(default=50.0, ge=0.0, allow_inf_nan=False)
    """-3 dB; 0 leaves the magnetometer as it is."""
    settle_s: float = Field(default=1.0, ge=0.0, le=60.0)
    """From a node's first answer, or its return, until its orientation counts as valid."""
    zero_pose_s: float = Field(default=0.0, ge=0.0, le=60.0)
    """How long the operator stands still in the zero pose, s. It gives the nodes' headings, and the alignment
    of nodes whose file does not give it. 0: headings by the magnetometers, alignment as calibrated."""
    zero_pose_heading_deg: float = Field(default=0.0, ge=-360.0, le=360.0)
    """Where the operator faces meanwhile, from east towards north."""
    zero_pose_turn_deg_s: float = Field(default=15.0, gt=0.0, le=360.0)
    """A node that turns faster meanwhile, degrees/s, does not stand still: the pose is asked for again."""
    zero_pose_lean_deg: float = Field(default=15.0, gt=0.0, le=90.0)
    """A segment that leans farther from upright, degrees, is not in the zero pose: it is asked for again.
    Noticed only where the node's file gives its alignment."""
    constraints: Literal["auto", "online", "off"] = "off"
    """`online`: headings by the gyros, corrected by what the joints cannot do and by the magnetometers as far
    as the field is undisturbed. `off`: each node's heading by its own filter alone. `auto`: `online` once
    the files give the alignment of both nodes of a joint that constrains them; only such joints count."""
    online: OnlineConfig = OnlineConfig()
    heading_limit_deg: float = Field(default=5.0, ge=0.0, le=90.0)
    """A node whose heading is off by more against its neighbour's is named, or one that may be off by twice
    as much. 0: no watch. Without calibrated alignments it needs a zero pose."""

    _filter_sections: dict[str, FilterSection] = PrivateAttr(default_factory=dict)

    @model_validator(mode="wrap")
    @classmethod
    def _read_filter_sections(
        cls, data: object, validate: ModelWrapValidatorHandler[Self], info: ValidationInfo
    ) -> Self:
        """The tables that bear a filter's name are that filter's parameters."""
        if not isinstance(data, dict):
            return validate(data)
        config = validate({key: value for key, value in data.items() if key not in FILTERS})
        tables = {key: value for key, value in data.items() if key in FILTERS}
        config._filter_sections = read_sections(tables, info.context)
        return config

    @property
    def filter_sections(self) -> Mapping[str, FilterSection]:
        """The parameters of every filter in the registry, by its name."""
        return self._filter_sections

    @property
    def cutoffs_hz(self) -> tuple[float, float, float]:
        """In the sensors' order: accelerometer, gyroscope, magnetometer."""
        return self.accelerometer_cutoff_hz, self.gyroscope_cutoff_hz, self.magnetometer_cutoff_hz

    def mistakes_at(self, rate_hz: float) -> list[ConfigMistake]:
        """A filter that does not exist, and cut-offs that are not below half the rate."""
        names = ("accelerometer", "gyroscope", "magnetometer")
        return filter_mistakes("estimation.filter", self.filter) + [
            ConfigMistake(
                f"estimation.{name}_cutoff_hz", cutoff, f"less than half the rate of {rate_hz:g} Hz, or 0"
            )
            for name, cutoff in zip(names, self.cutoffs_hz, strict=True)
            if cutoff >= 0.5 * rate_hz
        ]
