import numpy as np

from slave.track.hold import Hold

MS = 1_000_000


def test_there_is_no_target_before_a_sample_nor_after_a_reset() -> None:
    hold = Hold()
    assert hold.target(0) is None
    hold.accept(0, 0, np.ones(2), np.ones(2))
    hold.reset()
    assert hold.target(1) is None


def test_the_target_is_a_staircase_at_rest() -> None:
    hold = Hold()
    for k in range(3):
        hold.accept(80 * k * MS, (80 * k + 12) * MS, np.full(2, float(k)), np.ones(2))
        for late in (12, 50, 91):
            target = hold.target((80 * k + late) * MS)
            assert target is not None
            assert (target.position_rad == k).all()
            assert not target.velocity_rad_s.any()


def test_a_sample_that_is_not_newer_is_ignored() -> None:
    hold = Hold()
    hold.accept(80 * MS, 90 * MS, np.ones(2), np.zeros(2))
    for sampled_ns in (80 * MS, 79 * MS):
        hold.accept(sampled_ns, 95 * MS, np.zeros(2), np.zeros(2))
    target = hold.target(96 * MS)
    assert target is not None
    assert (target.position_rad == 1.0).all()


def test_what_the_caller_does_to_its_arrays_does_not_move_the_robot() -> None:
    hold = Hold()
    position = np.ones(2)
    hold.accept(0, 0, position, np.zeros(2))
    position[:] = 9.0
    target = hold.target(1)
    assert target is not None
    assert (target.position_rad == 1.0).all()
