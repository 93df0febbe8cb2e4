import numpy as np

from slave.track.latest import Latest

MS = 1_000_000


def test_there_is_no_target_before_a_sample_nor_after_a_reset() -> None:
    latest = Latest()
    assert latest.target(0) is None
    latest.accept(0, 0, np.ones(2), np.ones(2))
    latest.reset()
    assert latest.target(1) is None


def test_the_target_is_a_staircase_at_rest() -> None:
    latest = Latest()
    for k in range(3):
        latest.accept(80 * k * MS, (80 * k + 12) * MS, np.full(2, float(k)), np.ones(2))
        for late in (12, 50, 91):
            target = latest.target((80 * k + late) * MS)
            assert target is not None
            assert (target.position_rad == k).all()
            assert not target.velocity_rad_s.any()


def test_a_sample_that_is_not_newer_is_ignored() -> None:
    latest = Latest()
    latest.accept(80 * MS, 90 * MS, np.ones(2), np.zeros(2))
    for sampled_ns in (80 * MS, 79 * MS):
        latest.accept(sampled_ns, 95 * MS, np.zeros(2), np.zeros(2))
    target = latest.target(96 * MS)
    assert target is not None
    assert (target.position_rad == 1.0).all()


def test_what_the_caller_does_to_its_arrays_does_not_move_the_robot() -> None:
    latest = Latest()
    position = np.ones(2)
    latest.accept(0, 0, position, np.zeros(2))
    position[:] = 9.0
    target = latest.target(1)
    assert target is not None
    assert (target.position_rad == 1.0).all()
