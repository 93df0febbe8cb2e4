import numpy as np

from common.wire.messages import Mask
from master.orientation.liveness import Liveness

YES, NO = np.array([True]), np.array([False])


def test_settles_after_exactly_that_many_ticks() -> None:
    liveness = Liveness(1, 3)
    seen = []
    for _ in range(5):
        changes = liveness.update(YES, NO)
        seen.append((bool(changes.came[0]), bool(changes.settled[0]), bool(liveness.settled[0])))
    assert seen == [
        (True, False, False),
        (False, False, False),
        (False, False, False),
        (False, True, True),
        (False, False, True),
    ]


def test_no_settling_time_is_valid_at_once() -> None:
    liveness = Liveness(1, 0)
    changes = liveness.update(YES, NO)
    assert changes.came[0]
    assert changes.settled[0]


def test_a_node_never_heard_is_not_alive() -> None:
    liveness = Liveness(1, 0)
    for lost in (NO, YES, NO):
        changes = liveness.update(NO, lost)
        assert not changes.came[0]
        assert not changes.went[0]
        assert not liveness.settled[0]


def test_a_late_node_stays_and_a_lost_one_settles_anew() -> None:
    liveness = Liveness(2, 2)
    both, none = np.array([True, True]), np.array([False, False])
    second = np.array([False, True])

    def ticks(count: int, fresh: Mask, lost: Mask) -> None:
        for _ in range(count):
            liveness.update(fresh, lost)

    ticks(5, both, none)
    ticks(5, ~second, none)
    assert liveness.settled.tolist() == [True, True]
    changes = liveness.update(~second, second)
    assert changes.went.tolist() == [False, True]
    assert liveness.settled.tolist() == [True, False]
    ticks(5, ~second, second)
    assert liveness.update(both, none).came.tolist() == [False, True]
    ticks(1, both, none)
    assert liveness.settled.tolist() == [True, False]
    assert liveness.update(both, none).settled.tolist() == [False, True]


def test_lost_wins_over_fresh() -> None:
    liveness = Liveness(1, 0)
    liveness.update(YES, YES)
    assert not liveness.alive[0]
