"""What the base's attitude means for the guard: at the boundary, and when the sensor is silent."""

import math

import pytest

from common.wire.messages import BaseAttitude
from slave.guard import GuardConfig
from slave.guard.tilt import base_loss

CONFIG = GuardConfig(max_tilt_deg=8.0, base_timeout_s=0.5)
NOW = 10_000_000_000


def tilted(deg: float, age_ns: int = 0) -> BaseAttitude:
    return BaseAttitude(NOW - age_ns, 1.0, 1.0, 1.0, math.radians(deg))


@pytest.mark.parametrize("deg", [0.0, 7.9, 8.0 - 1e-9, -7.9])
def test_within_the_limit_it_may_move(deg: float) -> None:
    assert base_loss(tilted(deg), NOW, CONFIG) is None


@pytest.mark.parametrize("deg", [8.0 + 1e-6, 90.0, 180.0, -8.1, math.nan, math.inf])
def test_beyond_it_may_not(deg: float) -> None:
    assert "limit 8°" in (base_loss(tilted(deg), NOW, CONFIG) or "")


@pytest.mark.parametrize("sign", [1, -1])
def test_silence_is_doubt_also_where_it_comes_from_the_future(sign: int) -> None:
    assert base_loss(tilted(0.0, sign * 500_000_000), NOW, CONFIG) is None
    assert "silent" in (base_loss(tilted(0.0, sign * 500_000_001), NOW, CONFIG) or "")


def test_a_sensor_that_has_never_answered_is_silent() -> None:
    assert "not answered" in (base_loss(None, NOW, CONFIG) or "")
