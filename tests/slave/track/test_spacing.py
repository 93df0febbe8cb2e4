import pytest

from slave.track.spacing import Spacing


def spacing(*elapsed_s: float) -> Spacing:
    out = Spacing()
    for each_s in elapsed_s:
        out.note(each_s)
    return out


def test_nothing_is_known_before_the_first_and_after_a_reset() -> None:
    used = spacing(0.08)
    used.reset()
    assert spacing().usual_s is used.usual_s is None


@pytest.mark.parametrize("odd", [(0.015, 0.065), (0.16,), (0.04, 0.04), (1e-6, 0.08)])
def test_one_command_out_of_turn_or_lost_changes_nothing(odd: tuple[float, ...]) -> None:
    assert spacing(0.08, 0.08, 0.08, *odd).usual_s == 0.08


def test_another_rate_is_known_after_three_commands() -> None:
    before = [0.08] * 9
    assert spacing(*before, 0.04, 0.04).usual_s == 0.08
    assert spacing(*before, 0.04, 0.04, 0.04).usual_s == 0.04
