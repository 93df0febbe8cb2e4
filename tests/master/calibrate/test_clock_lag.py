"""A node whose readings come later or earlier than its neighbours' is named, with by how much."""

import re
from dataclasses import replace

import numpy as np
import pytest

from master.calibrate.alignment import find_alignment
from master.calibrate.clock_lag import Lag, check_lags
from tests.master.calibrate.worn import Worn, wear

ARM = ("chest", "upper_arm", "forearm", "hand")
LINKS = [(0, 1), (1, 2), (2, 3)]


@pytest.fixture(scope="module")
def worn() -> Worn:
    return wear("nursing", 5)


@pytest.mark.parametrize(("name", "by"), [("left_forearm", 6), ("right_hand", 40), ("left_upper_arm", -8)])
def test_a_late_node_is_refused_and_the_others_are_not_late(worn: Worn, name: str, by: int) -> None:
    unit = worn.nodes[name]
    late = replace(unit, acc_m_s2=np.roll(unit.acc_m_s2, by, 0), gyr_rad_s=np.roll(unit.gyr_rad_s, by, 0))
    found = find_alignment({**worn.nodes, name: late}, worn.skeleton)
    said = re.search(r"readings come (\d+) ms", found.refused[name])
    assert said is not None
    assert int(said[1]) == pytest.approx(abs(10 * by), abs=15)
    assert ("later" if by > 0 else "earlier") in found.refused[name]
    assert [n for n, why in found.refused.items() if "its readings come" in why] == [name]


@pytest.mark.parametrize(("ms", "told"), [(24.0, False), (26.0, True)])
def test_the_limit_is_25_ms(ms: float, told: bool) -> None:
    found = check_lags(ARM, LINKS, [Lag(0.0, 1.0), Lag(0.0, 1.0), Lag(1e-3 * ms, 2.0)])
    assert [name for name, (e, _) in found.items() if e.contradicts] == (["hand"] if told else [])


def test_the_one_between_two_joints_that_lag_is_to_blame() -> None:
    found = check_lags(ARM, LINKS, [Lag(0.0, 1.0), Lag(0.1, 2.0), Lag(-0.1, 3.0)])
    assert [name for name, (e, _) in found.items() if e.contradicts] == ["forearm"]
    assert found["forearm"][1] == pytest.approx(np.log(6.0))


def test_a_joint_that_does_not_tell_is_not_judged() -> None:
    found = check_lags(ARM, LINKS, [None, None, None])
    assert {e.verdict for e, _ in found.values()} == {"not judged"}
