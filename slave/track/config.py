"""`[track]`: which strategy turns 12.5 commands a second into a setpoint for every servo tick."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from common.config.section import Section
from slave.track.hold import Hold
from slave.track.interpolate import Interpolate
from slave.track.predict import Predict
from slave.track.tracker import Tracker

SERVO_LAG_S = 0.031
"""Of the MuJoCo robot behind a ramp that is written at 200 Hz, measured: 26 ms are its servos', 3 ms go by
until the drives take a setpoint in, and for 4 ms (2 on average) it stands."""


class TrackConfig(Section):
    """`[track]` of the slave's TOML."""

    strategy: Literal["hold", "interpolate", "predict"] = "predict"
    """`hold`: the newest sample. `interpolate`: smooth, one period late. `predict`: extrapolated to now."""
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


def make_tracker(config: TrackConfig, bus_lag_s: float = 0.0) -> Tracker:
    """The strategy that the configuration names, for servos whose bus adds some lag to their own."""
    match config.strategy:
        case "hold":
            return Hold()
        case "interpolate":
            return Interpolate(config.blend_s, config.jitter_margin_s)
        case "predict":
            return Predict(config.blend_s, config.servo_lag_s + bus_lag_s, config.max_horizon_s)
