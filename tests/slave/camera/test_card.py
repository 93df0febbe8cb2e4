"""The card with the time in the simulated scene: read back from the drawn picture."""

from __future__ import annotations

import sys

import numpy as np
import pytest
import simplejpeg

from common.errors import RobotError
from common.picture_code import read_codes, resolve_ns
from common.picture_code.cells import cells_of, count_of
from slave.camera.card import white_patches
from slave.camera.config import CameraConfig
from slave.camera.pipe import PictureRequest
from slave.camera.process import CameraProcess, NeverError

# without the lowest priority, which the machine may not serve while other tests run
SERVE = "import sys; from slave.camera.child import main; main(sys.argv[1])"


@pytest.mark.parametrize("time_ns", [0, 1, 10**9, 987_654_321_012_345, 2**62])
def test_the_patches_are_the_white_cells(time_ns: int) -> None:
    plan = np.zeros((10, 12), np.bool_)
    for column, row, columns, rows in white_patches(time_ns):
        assert not plan[row : row + rows, column : column + columns].any()
        plan[row : row + rows, column : column + columns] = True
    assert (plan[2:-2, 2:-2] == cells_of(count_of(time_ns))).all()
    assert plan.sum() == plan[2:-2, 2:-2].sum()


@pytest.mark.long
@pytest.mark.parametrize("card", [True, False])
def test_what_the_camera_sees_says_when_the_posture_was_read(card: bool) -> None:
    config = CameraConfig(source="robot", time_card=card)
    setting = f"nursing {config.model_dump_json()}"
    camera = CameraProcess("nursing", config, (sys.executable, "-c", SERVE, setting))
    try:
        camera.wait_ready()
        rng = np.random.default_rng(3)
        for _ in range(5):
            read_ns, posture = int(rng.integers(0, 10**15)), rng.uniform(-0.3, 0.3, 25)
            seen = simplejpeg.decode_jpeg(camera.ask(PictureRequest(read_ns, 40_000, posture)).body)
            found = [resolve_ns(code.count, read_ns) for code in read_codes(seen)]
            assert found == ([read_ns // 100_000 * 100_000] if card else [])
    except NeverError as error:
        pytest.skip(str(error))
    except RobotError as error:
        pytest.fail(str(error))
    finally:
        camera.close()
