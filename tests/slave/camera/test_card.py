"""The card with the time in the simulated scene: read back from the drawn picture."""

from __future__ import annotations

import numpy as np
import pytest
import simplejpeg

from common.errors import RobotError
from common.picture_code import read_codes, resolve_ns
from common.picture_code.cells import cells_of, count_of
from slave.camera.card import white_patches
from slave.camera.drawn import DrawnCamera


@pytest.mark.parametrize("time_ns", [0, 1, 10**9, 987_654_321_012_345, 2**62])
def test_the_patches_are_the_white_cells(time_ns: int) -> None:
    plan = np.zeros((10, 12), np.bool_)
    for column, row, columns, rows in white_patches(time_ns):
        assert not plan[row : row + rows, column : column + columns].any()
        plan[row : row + rows, column : column + columns] = True
    assert (plan[2:-2, 2:-2] == cells_of(count_of(time_ns))).all()
    assert plan.sum() == plan[2:-2, 2:-2].sum()


@pytest.mark.long
@pytest.mark.parametrize(("width", "height"), [(320, 240), (160, 120), (640, 360)])
def test_what_the_camera_sees_says_when_the_posture_was_read(width: int, height: int) -> None:
    try:
        camera = DrawnCamera("nursing", "head", width, height)
    except RobotError as error:
        pytest.skip(str(error))
    rng = np.random.default_rng(3)
    for _ in range(5):
        read_ns, posture = int(rng.integers(0, 10**15)), rng.uniform(-0.3, 0.3, camera.joints)
        seen = simplejpeg.decode_jpeg(simplejpeg.encode_jpeg(camera.draw(posture, read_ns), quality=35))
        assert [resolve_ns(code.count, read_ns) for code in read_codes(seen)] == [
            read_ns // 100_000 * 100_000
        ]
        assert read_codes(camera.draw(posture)) == []
