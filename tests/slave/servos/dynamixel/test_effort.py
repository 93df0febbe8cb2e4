"""The torque of servos from the current that they tell, over the whole wire."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from slave.servos.dynamixel.config import DynamixelConfig
from slave.servos.dynamixel.registers import MODEL
from tests.slave.servos.dynamixel.conftest import Rig

CONSTANT = 1.78


def loaded(make_rig: Callable[..., Rig], **models: int) -> Rig:
    """All joints but the last have a constant; servos hold 0.1, 0.2, … N m."""
    rig = make_rig()
    names = rig.names
    rig.driver.close()
    rig = make_rig(torque_nm_a=dict.fromkeys(names[:-1], CONSTANT))
    for j, servo in enumerate(rig.servos):
        servo.load_nm = 0.1 * (j + 1)
    for name, model in models.items():
        rig.servos[names.index(name)].put(MODEL, model)
    rig.driver.start()
    rig.cycles(2)
    return rig


def test_each_joint_s_torque_is_told_in_its_own_direction(make_rig: Callable[..., Rig]) -> None:
    rig = loaded(make_rig)
    effort = rig.driver.reading.effort_nm
    assert effort is not None
    sign = np.ones(len(effort))
    sign[[3, 7]] = -1.0  # reversed
    expected = 0.1 * np.arange(1, len(effort) + 1) * sign
    half_a_step = 0.5 * 2.69e-3 * CONSTANT
    assert (np.abs(effort - expected)[:-1] <= half_a_step + 1e-12).all()
    assert np.isnan(effort[-1])
    assert rig.driver.efforts.missing == {
        rig.names[-1]: "its torque constant is not in servos.dynamixel.torque_nm_a"
    }
    np.testing.assert_allclose(rig.measured_rad, rig.start_rad, atol=2e-3)


def test_the_unit_and_what_is_measured_depend_on_the_model(make_rig: Callable[..., Rig]) -> None:
    names = make_rig().names
    rig = loaded(make_rig, **{names[1]: 1200, names[2]: 1060})
    effort = rig.driver.reading.effort_nm
    assert effort is not None
    assert effort[1] == pytest.approx(0.2, abs=0.5e-3 * CONSTANT + 1e-12)
    assert np.isnan(effort[2])
    assert rig.driver.efforts.missing[names[2]] == "its servo (model 1060) measures no current"


def test_a_servo_that_is_silent_tells_no_torque(make_rig: Callable[..., Rig]) -> None:
    rig = loaded(make_rig)
    rig.servos[0].silent = True
    rig.wait_for_answers(0.05)
    rig.cycles(1)
    effort = rig.driver.reading.effort_nm
    assert effort is not None
    assert np.isnan(effort).tolist() == [j in (0, len(effort) - 1) for j in range(len(effort))]


def test_currents_below_zero_pass_the_wire(make_rig: Callable[..., Rig]) -> None:
    rig = loaded(make_rig)
    rig.servos[0].load_nm = -0.5
    rig.cycles(1)
    assert rig.driver.reading.effort_nm is not None
    assert rig.driver.reading.effort_nm[0] == pytest.approx(-0.5, abs=3e-3)


def test_without_constants_nothing_more_is_read(make_rig: Callable[..., Rig]) -> None:
    rig = make_rig()
    rig.driver.start()
    rig.cycles(1)
    assert rig.driver.reading.effort_nm is None
    assert len(rig.driver.efforts.missing) == len(rig.names)
    told = rig.config.model_copy(update={"torque_nm_a": {rig.names[0]: CONSTANT}})
    assert told.wire_time_s() == pytest.approx(rig.config.wire_time_s() + len(rig.names) * 6e-5)


def test_a_constant_for_no_joint_is_a_mistake(make_rig: Callable[..., Rig]) -> None:
    rig = make_rig()
    wrong = DynamixelConfig(port="/dev/null", ids=rig.ids, torque_nm_a={"tail": 1.0})
    (mistake,) = wrong.mistakes_for(rig.skeleton, rig.encoder_config)
    assert (mistake.key, mistake.value) == ("servos.dynamixel.torque_nm_a", "tail")
