"""Each check at its limit; what is not judged counts neither way."""

import math

from master.calibrate.evidence import at_most, first_contradiction, not_judged


def test_a_figure_at_its_limit_agrees_and_beyond_it_contradicts() -> None:
    assert at_most("a with b", 1.0, 1.0, "s", advice="do").verdict == "agrees"
    assert at_most("a with b", 1.0, 1.0, "s", advice="do").advice == ""
    beyond = at_most("a with b", 1.0 + 1e-9, 1.0, "s", advice="do")
    assert (beyond.contradicts, beyond.advice) == (True, "do")


def test_a_figure_that_is_no_number_contradicts() -> None:
    assert at_most("a with b", math.nan, 1.0, "s", advice="do").contradicts


def test_the_first_contradiction_is_the_one_to_tell() -> None:
    none = not_judged("a with b", "nothing to go by")
    first, second = (at_most("a with b", 2.0, 1.0, "s", advice=text) for text in ("first", "second"))
    assert first_contradiction([none, first, second]) is first
    assert first_contradiction([none]) is None
    assert not none.contradicts
