"""`[camera]`, or up to three `[[camera]]`: what the operator sees, and how much of the link it may take."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from common.config.load import REST
from common.config.section import Section
from common.errors import ConfigMistake
from common.metrics.lens import Lens
from common.skeleton import Skeleton
from common.wire.topics import VIDEO_NAME
from slave.camera.lens import CalibrationConfig, eye

MOST = 3
"""Cameras of a robot."""


class CameraConfig(Section):
    """One camera of the slave's TOML."""

    source: Literal["off", "robot", "v4l2"] = "off"
    """`robot`: through the eyes of the simulated robot, drawn from the encoders; `v4l2`: a real camera."""
    codec: Literal["jpeg", "h264"] = "jpeg"
    """`h264` shows more over a thin link, and needs PyAV (extra `h264`); `jpeg` takes less CPU time."""
    keyframe_s: float = Field(4.0, ge=0.5, le=60.0)
    """With `h264`: a picture that stands alone at least so often, s: for recordings."""
    name: str = Field("head", pattern=VIDEO_NAME)
    """Names the topic, and with `robot` the model's camera; where it has none the whole robot is shown."""
    device: str = "/dev/video0"
    """The device of a `v4l2` camera."""
    width: int = Field(320, ge=80, le=1920, multiple_of=16)
    """Pixels at best; with `height`. A poor link gets a half or a quarter of each."""
    height: int = Field(240, ge=60, le=1080, multiple_of=4)
    most_rate_hz: float = Field(12.0, gt=0.0, le=60.0)
    """Pictures a second at best."""
    least_rate_hz: float = Field(1.0, gt=0.0, le=10.0)
    """Pictures a second at worst, and while no operator acknowledges any."""
    most_delay_s: float = Field(0.03, gt=0.0, le=1.0)
    """How long a picture may keep the link busy: what is sent beside it waits for no longer."""
    most_kb: float = Field(40.0, ge=4.0, le=1000.0)
    """Size of one picture at best, kB."""
    time_card: bool = False
    """With `robot`: a card before the lens shows the time, by which the latency to the eye is measured."""
    calibration: CalibrationConfig | None = None
    """Of a real camera: where it stands and how it sees, for what is drawn over its picture."""
    relied_on: bool = True
    """Whether the robot holds by `[guard] max_video_age_s` when the operator's picture of it grows old."""

    def lens(self, skeleton: Skeleton) -> Lens | None:
        """How it sees the robot; None where that is not known."""
        if self.calibration is not None:
            return self.calibration.lens
        return eye(skeleton, self.name, self.width, self.height) if self.source == "robot" else None

    def mistakes_of(self, skeleton: Skeleton) -> list[ConfigMistake]:
        """Of its calibration."""
        if self.calibration is None:
            return []
        if self.source == "robot":
            expected = "nothing with source robot: a simulated robot's own eye is known"
            return [ConfigMistake("calibration", "given", expected)]
        found = self.calibration.mistakes_for(skeleton, self.width, self.height)
        return [ConfigMistake(f"calibration.{one.key}", one.value, one.expected) for one in found]


class CamerasConfig(CameraConfig):
    """All cameras: the main one, and those beside it."""

    others: list[CameraConfig] = Field(default_factory=list, max_length=MOST - 1)

    @property
    def all(self) -> list[CameraConfig]:
        """Those that are not off, the main one first."""
        main = CameraConfig.model_validate(self.model_dump(exclude={"others"}))
        return [one for one in (main, *self.others) if one.source != "off"]

    def mistakes_for(self, skeleton: Skeleton) -> list[ConfigMistake]:
        """Each name, and each real camera's device, once; calibrations that fit the robot."""
        found = [
            ConfigMistake(f"camera.{one.key}", one.value, one.expected)
            for camera in self.all
            for one in camera.mistakes_of(skeleton)
        ]
        for key, values in (
            ("name", [one.name for one in self.all]),
            ("device", [one.device for one in self.all if one.source == "v4l2"]),
        ):
            twice = sorted({value for value in values if values.count(value) > 1})
            expected = f"a {key} that no other camera has"
            found += [ConfigMistake(f"camera.{key}", value, expected) for value in twice]
        return found


def _of_list(value: object) -> object:
    """`[[camera]]`: the first is the main one."""
    if isinstance(value, list) and value and isinstance(value[0], dict):
        if len(value) > MOST:
            raise ValueError(f"at most {MOST} cameras, not {len(value)}")
        return {**value[0], REST: value[1:]}
    return value


Cameras = Annotated[CamerasConfig, BeforeValidator(_of_list)]
