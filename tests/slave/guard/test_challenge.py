"""A request that could move the robot counts only while its challenge is young, and once."""

from typing import Any

import pytest

from common.wire.messages import Action
from slave.guard import State
from slave.guard.challenge import KEPT, TIMEOUT_NS, Challenges

KEY = "a key kept at the robot"


@pytest.fixture
def challenges() -> Challenges:
    return Challenges(iter(range(1, 10_000)).__next__)


@pytest.mark.parametrize("sign", [1, -1])
def test_good_up_to_its_age_and_no_longer(challenges: Challenges, sign: int) -> None:
    young, old = challenges.issue(0), challenges.issue(0)
    assert challenges.refusal(young, sign * TIMEOUT_NS) is None
    assert "late" in (challenges.refusal(old, sign * (TIMEOUT_NS + 1)) or "")


def test_good_once(challenges: Challenges) -> None:
    number = challenges.issue(0)
    assert challenges.refusal(number, 0) is None
    assert challenges.refusal(number, 0) is not None


def test_a_number_that_was_never_given_is_refused(challenges: Challenges) -> None:
    challenges.issue(0)
    assert "status" in (challenges.refusal(0, 0) or "")
    assert challenges.refusal(77, 0) is not None


def test_a_flood_of_questions_fills_no_memory(challenges: Challenges) -> None:
    first = challenges.issue(0)
    numbers = [challenges.issue(0) for _ in range(KEPT)]
    assert challenges.refusal(first, 0) is not None
    assert all(challenges.refusal(number, 0) is None for number in numbers)


def test_challenges_cannot_be_guessed() -> None:
    assert len({Challenges().issue(0) for _ in range(20)}) == 20


def test_an_engage_that_the_network_held_back_moves_nothing(rig: Any) -> None:
    rig.to_leased()
    challenge = rig.ask(Action.STATUS).challenge
    rig.run(2.005)
    reply = rig.ask(Action.ENGAGE, challenge=challenge)
    assert not reply.done
    assert "late" in reply.text
    assert rig.guard.state is State.HOLD
    assert rig.ask(Action.ENGAGE).done


def test_an_engage_that_comes_twice_moves_once(rig: Any) -> None:
    rig.to_leased()
    challenge = rig.ask(Action.STATUS).challenge
    assert rig.ask(Action.ENGAGE, challenge=challenge).done
    rig.ask(Action.DISENGAGE)
    rig.run(0.1)
    assert not rig.ask(Action.ENGAGE, challenge=challenge).done
    assert rig.guard.state is State.HOLD


def test_a_reset_that_the_network_held_back_resets_nothing(rig: Any) -> None:
    rig.to(State.ESTOP)
    challenge = rig.ask(Action.STATUS).challenge
    rig.run(2.005)
    assert not rig.ask(Action.RESET, key=KEY, challenge=challenge).done
    assert rig.guard.state is State.ESTOP
    assert rig.ask(Action.RESET, key=KEY).done


@pytest.mark.parametrize("action", [Action.CLAIM, Action.ENGAGE, Action.RESET, Action.ESTOP])
def test_only_status_gives_one(rig: Any, action: Action) -> None:
    assert rig.to_leased().ask(action, key=KEY).challenge == 0
    assert rig.ask(Action.STATUS).challenge > 0


def test_to_stop_needs_none(rig: Any) -> None:
    rig.to_track()
    assert rig.ask(Action.DISENGAGE, challenge=0).done
    assert rig.ask(Action.ESTOP, challenge=0).done
