import numpy as np

from master.orientation.rest import Rest

RATE_HZ = 200.0
LEVEL = np.array([[0.0, 0.0, 9.81]])


def still_after(seconds: float, gyr: object = 0.0, shake: float = 0.0) -> bool:
    rest = Rest()
    state, rng = rest.start(1), np.random.default_rng(0)
    still = np.zeros(1, dtype=np.bool_)
    for _ in range(round(seconds * RATE_HZ)):
        rate = np.full((1, 3), gyr)
        still = rest.update(state, rate, LEVEL + shake * rng.normal(size=(1, 3)), 1.0 / RATE_HZ)
    return bool(still[0])


def test_still_is_who_has_not_moved_for_a_while() -> None:
    assert not still_after(1.4)
    assert still_after(1.6)
    assert still_after(1.6, gyr=0.03, shake=0.05)
    assert not still_after(3.0, shake=0.5)


def test_a_steady_turn_beyond_any_bias_is_no_rest() -> None:
    assert not still_after(3.0, gyr=0.2)


def test_a_moment_s_motion_starts_the_count_again_for_that_node_alone() -> None:
    rest = Rest()
    state = rest.start(2)
    level, quiet = np.tile(LEVEL, (2, 1)), np.zeros((2, 3))
    for _ in range(400):
        still = rest.update(state, quiet, level, 1.0 / RATE_HZ)
    assert still.all()
    moved = quiet.copy()
    moved[1, 0] = 1.0
    assert rest.update(state, moved, level, 1.0 / RATE_HZ).tolist() == [True, False]
    state.forget(np.array([True, False]))
    assert not rest.update(state, quiet, level, 1.0 / RATE_HZ)[0]
