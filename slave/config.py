"""The slave's TOML file: which robot it is, how it guards, tracks and drives."""

from __future__ import annotations

from pydantic import Field

from common.clock_sync.config import ClockConfig
from common.config.console import ConsoleConfig
from common.config.section import Section
from common.errors import ConfigError, ConfigMistake
from common.inputs.config import KeyConfig
from common.link.config import LinkConfig
from common.link.voice_config import VoiceConfig
from common.process.realtime import ProcessConfig
from common.recording.config import RecordingConfig
from common.skeleton import Skeleton, load_skeleton
from common.skeleton.load import ProfileName
from common.tap.config import TapConfig
from slave.attitude.config import BaseConfig
from slave.backends import ServosConfig
from slave.camera.config import Cameras, CamerasConfig
from slave.contact.config import ContactConfig
from slave.encoders.counts import EncoderConfig
from slave.guard.config import GuardConfig
from slave.servos.canopen.config import CanopenConfig
from slave.stop_inputs.config import EstopConfig
from slave.track.config import TrackConfig


class LoopConfig(Section):
    """`[loop]`: rates of the slave's own ticks."""

    rate_hz: int = Field(200, ge=20, le=1000)
    """Encoders read, guard stepped, servos written."""
    state_every: int = Field(4, ge=1, le=100)
    """Ticks from one published state to the next: 200 / 4 = 50 Hz."""


class CallConfig(Section):
    """`[call]`: how somebody at the robot asks for an operator, beside `tandem call`."""

    button: KeyConfig | None = None
    """A key of a Linux input device at the robot. Pressing it again changes nothing."""


class SlaveConfig(Section):
    """The whole file."""

    robot: str = Field(pattern=r"^[A-Za-z0-9_.-]{1,64}$")
    profile: ProfileName = "nursing"
    loop: LoopConfig = LoopConfig()
    guard: GuardConfig = GuardConfig()
    estop: EstopConfig = EstopConfig()
    call: CallConfig = CallConfig()
    contact: ContactConfig = ContactConfig()
    track: TrackConfig = TrackConfig()
    servos: ServosConfig = ServosConfig()
    encoders: EncoderConfig = EncoderConfig()
    base: BaseConfig = BaseConfig()
    camera: Cameras = CamerasConfig()
    link: LinkConfig
    clock: ClockConfig = ClockConfig()
    process: ProcessConfig = ProcessConfig()
    tap: TapConfig = TapConfig()
    console: ConsoleConfig = ConsoleConfig()
    recording: RecordingConfig = RecordingConfig()
    voice: VoiceConfig = VoiceConfig()

    @property
    def skeleton(self) -> Skeleton:
        """The robot's table."""
        return load_skeleton(self.profile)

    def mistakes(self) -> list[ConfigMistake]:
        """Joints named anywhere must be joints of the profile, and limits may only be tightened."""
        try:
            skeleton = self.skeleton
        except ConfigError as error:
            return error.mistakes
        return [
            *self.guard.mistakes_for(skeleton),
            *self._wrong_stops(skeleton),
            *self._unconfirmed(skeleton),
            *self._unfelt_zones(skeleton),
            *self.contact.mistakes_for(skeleton),
            *self.encoders.mistakes_for(skeleton),
            *self.servos.mistakes_for(skeleton, self.encoders),
            *self.base.mistakes(),
            *self._too_fresh_pictures(),
            *self.camera.mistakes_for(skeleton),
            *self.link.mistakes(),
            *self.tap.mistakes(),
            *self.console.mistakes(),
            *self.recording.mistakes_with(self.tap.socket),
        ]

    def _too_fresh_pictures(self) -> list[ConfigMistake]:
        """A camera on a poor link sends rarely: the limit must leave it the time."""
        limit_s, relied_on = self.guard.max_video_age_s, [one for one in self.camera.all if one.relied_on]
        slowest_s = max((1.0 / one.least_rate_hz for one in relied_on), default=0.0)
        if not limit_s or limit_s >= 2.0 * slowest_s:
            return []
        expected = f"0 (never), or at least {2.0 * slowest_s:g}: two pictures at camera.least_rate_hz"
        return [ConfigMistake("guard.max_video_age_s", limit_s, expected)]

    def _unconfirmed(self, skeleton: Skeleton) -> list[ConfigMistake]:
        """A profile that an import guessed moves no real drive before a person has looked at it."""
        if not skeleton.unconfirmed or self.servos.simulated:
            return []
        expected = (
            f"mujoco while {len(skeleton.unconfirmed)} entries of the profile are guesses "
            f"({skeleton.unconfirmed[0]}, …): look at `tandem profile check`, then empty its list unconfirmed"
        )
        return [ConfigMistake("servos.backend", ", ".join(self.servos.names), expected)]

    def _unfelt_zones(self, skeleton: Skeleton) -> list[ConfigMistake]:
        """Force limits of zones that no drive could tell of."""
        try:
            if self.servos.mistakes_for(skeleton, self.encoders):
                return []  # told by the servos
            unknown = self.servos.no_effort(skeleton)
        except ConfigError:  # told by the servos
            return []
        if len(unknown) < len(skeleton.joints):
            return []
        why = next(iter(unknown.values()))
        return [
            ConfigMistake(
                f"guard.zones.{i}.max_force_n", zone.max_force_n, f"drives that tell their effort: {why}"
            )
            for i, zone in enumerate(self.guard.zones)
            if zone.max_force_n is not None
        ]

    def _wrong_stops(self, skeleton: Skeleton) -> list[ConfigMistake]:
        try:
            canopen = self.servos.used(CanopenConfig)
            drives = self.servos.share(CanopenConfig, skeleton, self.encoders).skeleton
        except ConfigError:  # told by the servos
            return []
        return self.estop.mistakes_for(drives.joint_names, None if canopen is None else canopen.tell_inputs)
