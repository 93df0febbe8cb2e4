"""Another robot of one's name: shown by its token, or told of by a master that sees both."""

import pytest

from common.clock import to_ns
from common.link.namesakes import NOTICE_S, Namesakes
from common.wire.presence import ProcessPresence

OTHER = ProcessPresence("r", "slave", 2, 3, "1.0", "room 2")


def test_one_that_shows_itself_counts_until_it_goes() -> None:
    known = Namesakes(own=1)
    assert known.words(0) is None
    known.on_presence(OTHER, here=True)
    assert "room 2 (instance 00000002)" in str(known.words(to_ns(1e6)))
    known.on_presence(OTHER, here=False)
    assert known.words(to_ns(1e6)) is None


@pytest.mark.parametrize(
    "shown",
    [ProcessPresence("r", "slave", 1), ProcessPresence("r", "slave"), ProcessPresence("r", "master", 9)],
    ids=str,
)
def test_oneself_and_masters_are_no_namesakes(shown: ProcessPresence) -> None:
    known = Namesakes(own=1)
    known.on_presence(shown, here=True)
    assert known.words(0) is None


def test_a_notice_counts_while_it_is_repeated() -> None:
    known = Namesakes(own=1)
    known.on_notice("2 robots have the name r", 5)
    assert known.words(5 + to_ns(NOTICE_S)) == "2 robots have the name r"
    assert known.words(6 + to_ns(NOTICE_S)) is None
    assert known.words(4 - to_ns(NOTICE_S)) is None
