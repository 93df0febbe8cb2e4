import numpy as np
import pytest

from common.quaternion import Array
from slave.track.confidence import Confidence
from slave.track.continuation import Continuation
from slave.track.estimate import Estimate, corrected, first

MS = 1_000_000


def foretold(estimate: Estimate) -> Continuation:
    return Continuation.of(estimate, np.array(0.2))


def learnt(position: Array, velocity: Array, horizon_s: float) -> float:
    """Share after samples (T,) every 80 ms."""
    confidence = Confidence()
    estimate = first(0, position[:1], velocity[:1])
    confidence.note(estimate.sampled_ns, foretold(estimate))
    for k in range(1, len(position)):
        confidence.prove(80 * k * MS, position[k : k + 1], horizon_s)
        estimate = corrected(estimate, 80 * k * MS, position[k : k + 1], velocity[k : k + 1])
        confidence.note(estimate.sampled_ns, foretold(estimate))
    return float(np.broadcast_to(confidence.share, 1)[0])


def swing(rate_hz: float, by_rad: float = 0.5) -> tuple[Array, Array]:
    time_s = 0.08 * np.arange(60)
    omega = 2 * np.pi * rate_hz
    return by_rad * np.sin(omega * time_s), by_rad * omega * np.cos(omega * time_s)


def test_before_anything_is_proved_confidence_is_full() -> None:
    assert Confidence().share == 1.0


@pytest.mark.parametrize(("rate_hz", "least", "most"), [(0.3, 0.95, 1.0), (0.6, 0.85, 1.0), (2.2, 0.0, 0.4)])
def test_a_motion_that_turns_back_within_the_horizon_is_not_believed(
    rate_hz: float, least: float, most: float
) -> None:
    assert least <= learnt(*swing(rate_hz), horizon_s=0.25) <= most


def test_small_movements_prove_nothing() -> None:
    assert learnt(*swing(2.2, by_rad=0.0005), horizon_s=0.25) > 0.95


def test_the_share_is_of_each_joint_and_forgotten_at_a_reset() -> None:
    confidence = Confidence()
    confidence.note(0, foretold(first(0, np.zeros(2), np.array([2.0, 2.0]))))
    confidence.prove(80 * MS, np.array([0.15, -0.15]), 0.08)
    share = np.broadcast_to(confidence.share, 2)
    assert share[0] > 0.9
    assert share[1] == 0.0
    confidence.reset()
    assert confidence.share == 1.0


def test_each_old_estimate_is_proved_with_its_own_time() -> None:
    """What was foretold to last long counts as that, however short the joint's movements last by now."""
    confidence = Confidence()
    start = first(0, np.zeros(1), np.array([2.0]))
    long = Continuation.of(start, np.array(0.25))
    confidence.note(0, long)
    went = long.way(0.2)
    confidence.note(80 * MS, Continuation.of(start, np.array(0.03)))
    confidence.prove(200 * MS, went, 0.2)
    assert confidence.share == pytest.approx(1.0)
    confidence.reset()
    confidence.note(0, long)
    confidence.prove(200 * MS, 0.5 * went, 0.2)
    assert float(np.max(confidence.share)) < 0.6
