"""The table of tracking strategies, and `[track]`, which chooses one: from 12.5 Hz to the servo rate."""

from __future__ import annotations

from collections.abc import Callable

from pydantic import Field, field_validator

from common.config.section import Section, one_of
from slave.track.interpolate import Interpolate
from slave.track.latest import Latest
from slave.track.predict import Predict
from slave.track.tracker import Tracker

SERVO_LAG_S = 0.031
"""The measured lag of the MuJoCo robot behind a ramp that is written at 200 Hz: 26 ms are its servos', 3 ms
go by until the drives take a setpoint in, and for 4 ms (2 on average) it stands."""


class TrackConfig(Section):
    """`[track]` of the slave's TOML."""

    strategy: str = "predict"
    """A name of `STRATEGIES`."""
    blend_s: float = Field(default=0.06, gt=0.0, le=1.0)
    """Time over which a difference between the old course and a new sample's is worked off."""
    servo_lag_s: float = Field(default=SERVO_LAG_S, ge=0.0, le=0.5)
    """`predict`: how far the servos lag behind a ramp, without their bus; aimed ahead by as much."""
    max_horizon_s: float = Field(default=0.5, gt=0.0, le=2.0)
    """`predict`: age of a sample, servo lag included, at which it moves nothing any more. The horizon itself
    follows the measured delay and jitter; this is the most that it may become, coasting to rest included."""
    jitter_margin_s: float = Field(default=0.005, ge=0.0, le=0.5)
    """`interpolate`: how much later than usual a sample may arrive at least and still find the robot moving;
    with more jitter than this the margin is the jitter, as measured."""

    @field_validator("strategy")
    @classmethod
    def _known(cls, name: str) -> str:
        if name == "hold":
            raise ValueError("expected 'latest', the new name of 'hold'")
        return one_of(name, STRATEGIES)


STRATEGIES: dict[str, Callable[[TrackConfig, float], Tracker]] = {
    # the newest sample
    "latest": lambda config, bus_lag_s: Latest(),
    # smooth, one period late
    "interpolate": lambda config, bus_lag_s: Interpolate(config.blend_s, config.jitter_margin_s),
    # extrapolated to now
    "predict": lambda config, bus_lag_s: Predict(
        config.blend_s, config.servo_lag_s + bus_lag_s, config.max_horizon_s
    ),
}
"""To add a strategy, add its line here: it gets `[track]` and the mean delay of the servos' bus, s."""


def make_tracker(config: TrackConfig, bus_lag_s: float = 0.0) -> Tracker:
    """The strategy that the configuration names, for servos whose bus adds some lag to their own."""
    return STRATEGIES[config.strategy](config, bus_lag_s)
