"""The robot meets a soft patient, what `tandem contact` prints, in small."""

from __future__ import annotations

import pytest

from common.link.config import LinkConfig
from common.skeleton import load_skeleton
from deploy.sim.patient import impact
from deploy.sim.patient.free_run import of_motion
from deploy.sim.patient.impact import PLACES, Impact, meet
from deploy.sim.patient.operator import OperatedRobot
from deploy.sim.patient.robot import Imperfect, TouchingRobot
from slave.config import SlaveConfig
from slave.contact.config import ContactConfig, Reflex

FINE = Imperfect(drive_bits=16)


def clamped(place: str, reflex: Reflex | None, imperfect: Imperfect | None = None) -> Impact:
    return meet(PLACES[place], 0.5, clamped=True, reflex=reflex, imperfect=imperfect or Imperfect())


@pytest.fixture(scope="module")
def unseen() -> Impact:
    return clamped("hand", None)


def test_nobody_watches_and_it_goes_on_pressing(unseen: Impact) -> None:
    assert unseen.noticed_s is None
    assert unseen.pressing_n > 80.0


def test_it_notices_and_goes_back(unseen: Impact) -> None:
    seen = clamped("hand", Reflex.RETREAT)
    assert seen.noticed_s is not None
    assert seen.crossed_s is not None
    assert seen.noticed_s - seen.crossed_s <= 0.05
    assert seen.peak_n < 0.45 * unseen.peak_n
    assert seen.pressing_n == 0.0
    assert 0.01 < seen.went_back_m < 0.1


def test_hold_goes_on_pressing_and_float_yields() -> None:
    assert clamped("hand", Reflex.HOLD).pressing_n > 20.0
    assert clamped("hand", Reflex.FLOAT).pressing_n < 20.0


@pytest.mark.parametrize("place", ["forearm", "elbow"])
def test_finer_angles_notice_sooner(place: str) -> None:
    coarse, fine = (clamped(place, Reflex.RETREAT, imperfect) for imperfect in (Imperfect(), FINE))
    assert coarse.noticed_s is not None
    assert fine.noticed_s is not None
    assert fine.noticed_s < 0.02 < coarse.noticed_s < 0.05
    assert fine.peak_n < 0.96 * coarse.peak_n


def test_a_free_patient_is_noticed_by_coarse_encoders_too() -> None:
    """He is touched by the elbow for 60 ms; the allowances must not rise by the push itself."""
    seen = meet(PLACES["elbow"], 0.5, clamped=False, reflex=Reflex.RETREAT, imperfect=Imperfect())
    assert seen.noticed_s is not None
    assert seen.noticed_s < 0.05


def test_the_torque_limit_lowers_the_peak_before_anything_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    limited = clamped("elbow", Reflex.RETREAT)
    off = ContactConfig(torque_limit=False)
    monkeypatch.setattr(impact, "contact_config", lambda *_: off)
    as_hard_as_it_can = clamped("elbow", Reflex.RETREAT)
    assert limited.peak_n < 0.8 * as_hard_as_it_can.peak_n


def test_drives_are_limited_while_the_robot_follows_and_only_then() -> None:
    skeleton = load_skeleton("nursing")
    run = OperatedRobot(
        SlaveConfig(robot="robot-1", link=LinkConfig()),
        TouchingRobot(skeleton, Imperfect()),
        of_motion("bottle", skeleton),
    )
    run.run(0.5)
    assert run.setpoint is not None
    assert run.setpoint.torque_nm is None
    assert run.engage() is None
    run.run(1.0)
    limit_nm = run.setpoint.torque_nm
    assert limit_nm is not None
    assert (limit_nm[0] < limit_nm[1]).all()
    run.pipeline.guard.lose(run.now_ns, "target", "for the test")
    run.tick()
    assert run.setpoint.torque_nm is None
