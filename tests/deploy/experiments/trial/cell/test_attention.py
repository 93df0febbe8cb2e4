from __future__ import annotations

from deploy.experiments.trial.cell.attention import Attention


def test_a_hold_is_remarked_once_and_engaged_as_soon_as_the_robot_takes_commands() -> None:
    attention = Attention()
    course = [
        (1.0, "track", True, False),
        (2.0, "hold", False, False),
        (2.1, "hold", False, False),
        (2.2, "hold", True, True),
        (2.3, "align", True, False),
        (4.0, "track", True, False),
        (5.0, "hold", True, True),
    ]
    for at_s, guard, ready, engages in course:
        assert attention.look(at_s, guard, "no command for 0.2 s", ready) is engages
    assert attention.remarks == [
        "at 2.0 s the robot held: no command for 0.2 s",
        "at 5.0 s the robot held: no command for 0.2 s",
    ]


def test_an_estop_is_no_hold_and_nobody_engages_out_of_it() -> None:
    assert Attention().look(1.0, "estop", "pressed", True) is False


def test_what_came_of_the_act_is_remarked() -> None:
    attention = Attention(["before"])
    attention.acted(2.25)
    attention.acted(3.0, "engage was refused: the deadman is released")
    assert attention.remarks == [
        "before",
        "at 2.2 s the operator engaged again",
        "at 3.0 s engage was refused: the deadman is released",
    ]
