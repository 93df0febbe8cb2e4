"""What no reflex can better: the figures of slave/contact/README.md, and that they are a bound."""

from __future__ import annotations

import math

import pytest

from deploy.sim.patient.floor import latest_s, least_peak_n, striking
from deploy.sim.patient.impact import PLACES, meet
from deploy.sim.patient.robot import Imperfect
from slave.contact.config import Reflex

WITHOUT_N = {"hand": 124.0, "forearm": 166.0, "elbow": 283.0}
"""Clamped at 0.5 m/s, nobody watching."""
PIPELINE_S = 0.013
"""From what an encoder sees to what a drive does: a reading, a tick and a cycle of the drives at least."""


@pytest.mark.parametrize(
    ("place", "let_go_n", "at_once_n"), [("hand", 47, 44), ("forearm", 77, 42), ("elbow", 105, 44)]
)
def test_one_mass_tells_what_the_whole_robot_did(place: str, let_go_n: float, at_once_n: float) -> None:
    """The simulated robot whose drives let go, or brake with all they have, at the instant of touch."""
    what = striking(PLACES[place])
    assert least_peak_n(what, 0.5, math.inf) == pytest.approx(let_go_n, rel=0.1)
    assert least_peak_n(what, 0.5, 0.0) == pytest.approx(at_once_n, rel=0.1)


def test_at_half_a_metre_a_second_hand_and_forearm_cannot_be_met_with_a_third() -> None:
    """0.35 of the force without detection: the hand's and the forearm's brakes would have to be sooner."""
    latest = {name: latest_s(striking(PLACES[name]), 0.5, 0.35 * WITHOUT_N[name]) for name in PLACES}
    assert 0.001 < latest["hand"] < 0.005
    assert 0.003 < latest["forearm"] < 0.007
    assert latest["forearm"] < PIPELINE_S
    # at the elbow some milliseconds are left, in which the contact would have to be noticed
    assert PIPELINE_S < latest["elbow"] < PIPELINE_S + 0.006


def test_at_half_the_speed_all_three_can() -> None:
    for name, place in PLACES.items():
        assert latest_s(striking(place), 0.25, 0.35 * WITHOUT_N[name]) == math.inf


@pytest.mark.parametrize("place", PLACES)
def test_the_robot_is_not_gentler_than_the_bound(place: str) -> None:
    seen = meet(PLACES[place], 0.5, clamped=True, reflex=Reflex.RETREAT, imperfect=Imperfect(drive_bits=16))
    assert seen.noticed_s is not None
    assert seen.peak_n > 0.95 * least_peak_n(striking(PLACES[place]), seen.speed_m_s, seen.noticed_s)


def test_later_brakes_are_no_gentler() -> None:
    what = striking(PLACES["forearm"])
    peaks = [least_peak_n(what, 0.5, 1e-3 * ms) for ms in range(0, 24, 2)]
    assert peaks == sorted(peaks)
    assert peaks[-1] > 1.5 * peaks[0]
