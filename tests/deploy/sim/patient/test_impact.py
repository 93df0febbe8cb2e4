"""The robot meets a soft patient, and it follows through the air: what `tandem contact` prints, in small."""

from __future__ import annotations

import pytest

from common.skeleton import load_skeleton
from deploy.sim.patient.free_run import free_run, of_motion
from deploy.sim.patient.impact import PLACES, Impact, meet
from deploy.sim.patient.robot import Imperfect
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
    assert fine.peak_n < 0.8 * coarse.peak_n


@pytest.mark.parametrize("imperfect", [Imperfect(mass_share=0.05), Imperfect(mass_share=0.05, drive_bits=16)])
def test_a_motion_through_the_air_is_no_contact(imperfect: Imperfect) -> None:
    run = free_run(of_motion("bottle", load_skeleton("nursing")), 12.0, imperfect, ContactConfig())
    assert run.followed_s > 8.0
    assert run.false_stops == ()
    assert 0.1 < run.nearest < 0.9
