"""From asking to the result: a countdown that is heard, no valid joint meanwhile, and words for every end."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import pytest

from common.clock import to_ns
from master.comfort.config import ZeroPoseAgainConfig
from master.comfort.zero_pose_again import Phase, ZeroPoseConduct
from master.orientation.estimator import Estimator

NAMES = ("chest", "head", "left_forearm")


class Again:
    def __init__(self) -> None:
        self.taken = np.zeros(3, np.bool_)
        self.moved_rad = np.radians([0.0, 1.0, 12.0])
        self.wrong = ""

    def words(self, _: Any) -> str:
        return self.wrong


class Suit:
    """An estimator whose pose becomes what the test says."""

    has_zero_pose = True

    def __init__(self) -> None:
        self.again: Again | None = None

    def stand_again(self) -> Again:
        self.again = Again()
        return self.again

    def drop_again(self) -> None:
        self.again = None


class Operator:
    def __init__(self) -> None:
        self.suit = Suit()
        config = ZeroPoseAgainConfig(countdown_s=3.0, give_up_s=10.0)
        self.conduct = ZeroPoseConduct(config, cast(Estimator, self.suit), NAMES)
        self.now_s = 100.0
        self.heard: list[str] = []

    def run(self, seconds: float) -> list[str]:
        first = len(self.heard)
        for _ in range(round(seconds / 0.08)):
            self.now_s += 0.08
            self.heard += self.conduct.step(to_ns(self.now_s))
        return self.heard[first:]

    def ask(self) -> None:
        self.conduct.ask("two taps on chest", to_ns(self.now_s))


@pytest.fixture
def operator() -> Operator:
    return Operator()


def test_the_countdown_is_heard_second_by_second_and_the_robot_holds(operator: Operator) -> None:
    assert operator.run(1.0) == []
    assert operator.conduct.hold == ""
    operator.ask()
    assert operator.conduct.hold == "the operator takes the zero pose again"
    assert operator.run(3.2) == [
        "zero pose again (two taps on chest): the robot holds; stand upright, arms hanging, in 3 s",
        "zero pose in 2 s",
        "zero pose in 1 s",
        "zero pose: stand still now",
    ]
    assert operator.conduct.hold != ""
    assert operator.suit.again is not None


def test_taken_it_says_which_headings_had_moved_and_to_engage(operator: Operator) -> None:
    operator.ask()
    operator.run(3.5)
    assert operator.suit.again is not None
    operator.suit.again.taken[:] = True
    assert operator.run(0.1) == [
        "zero pose taken; headings had moved: left_forearm by +11°; engage when you are ready"
    ]
    assert operator.conduct.hold == ""
    assert operator.suit.again is None
    metrics = operator.conduct.metrics()
    assert (metrics.taken, metrics.refused, metrics.why) == (1, 0, "")
    assert metrics.moved_deg == {"chest": -1.0, "left_forearm": 11.0}


def test_refused_it_says_why_and_that_the_old_one_stays(operator: Operator) -> None:
    operator.ask()
    operator.run(3.5)
    assert operator.suit.again is not None
    operator.suit.again.wrong = "head leaned by 25°, at most 15 is upright"
    assert operator.run(9.0) == []
    assert operator.run(1.0) == [
        "zero pose refused: head leaned by 25°, at most 15 is upright: the old one stays; "
        "ask again, or engage when you are ready"
    ]
    assert (operator.conduct.hold, operator.suit.again) == ("", None)
    assert (operator.conduct.metrics().refused, operator.conduct.metrics().taken) == (1, 0)


def test_asked_again_while_it_counts_it_is_called_off(operator: Operator) -> None:
    operator.ask()
    operator.run(1.0)
    operator.ask()
    assert operator.run(5.0) == [
        "zero pose called off (two taps on chest): the old one stays; engage when you are ready"
    ]
    assert operator.conduct.phase is Phase.IDLE
    assert operator.suit.again is None


def test_while_the_operator_stands_asking_changes_nothing(operator: Operator) -> None:
    operator.ask()
    operator.run(3.5)
    before = operator.suit.again
    operator.ask()
    assert operator.run(1.0) == []
    assert operator.suit.again is before


def test_before_the_first_pose_it_is_refused_and_nothing_holds(operator: Operator) -> None:
    operator.suit.has_zero_pose = False
    operator.ask()
    (line,) = operator.run(1.0)
    assert "not every node that is heard has taken its first one yet" in line
    assert operator.conduct.hold == ""


def test_the_file_is_checked() -> None:
    (mistake,) = ZeroPoseAgainConfig(tap_node="tail").mistakes_for(NAMES, 1.0)
    assert (mistake.key, mistake.expected) == (
        "operator.zero_pose_again.tap_node", "one of chest, head, left_forearm",
    )  # fmt: skip
    (mistake,) = ZeroPoseAgainConfig(tap_node="head").mistakes_for(NAMES, 0.0)
    assert mistake.key == "estimation.zero_pose_s"
    assert ZeroPoseAgainConfig().mistakes_for(NAMES, 0.0) == []
