import numpy as np

from slave.track.latest import Latest

MS = 1_000_000


def test_the_target_is_a_staircase_at_rest() -> None:
    latest = Latest()
    for k in range(3):
        latest.accept(80 * k * MS, (80 * k + 12) * MS, np.full(2, float(k)), np.ones(2))
        for late in (12, 50, 91):
            target = latest.target((80 * k + late) * MS)
            assert target is not None
            assert (target.position_rad == k).all()
            assert not target.velocity_rad_s.any()
