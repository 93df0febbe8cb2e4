"""Doubts of nodes: put together, made a refusal, and logged without repeating themselves."""

from common.clock import NS_PER_S
from master.suit.doubt import DoubtLog, NodeDoubt, Weight, as_figures, refusal, together

FIELD = NodeDoubt("its field is not the earth's", Weight.NOTED)
FROZEN = NodeDoubt("it repeats one reading", Weight.INVALID)
MOVED = NodeDoubt("moved in the zero pose", Weight.REFUSED)


def test_the_heaviest_doubt_comes_first_and_weighs_for_the_whole() -> None:
    doubts = together({"waist": FIELD, "head": FIELD}, {"waist": FROZEN})
    assert doubts["waist"] == NodeDoubt(
        "it repeats one reading; its field is not the earth's", Weight.INVALID
    )
    assert doubts["head"] == FIELD
    assert as_figures(doubts)["head"] == "its field is not the earth's"


def test_only_what_refuses_is_in_the_refusal_and_few_are_named() -> None:
    assert refusal({"waist": FIELD, "head": FROZEN}) == ""
    assert refusal({"waist": MOVED, "head": FIELD}) == "waist: moved in the zero pose"
    many = {f"node{i}": MOVED for i in range(5)}
    assert refusal(many) == "node0, node1, node2 and 2 more: moved in the zero pose"


def test_each_doubt_is_logged_as_it_begins_grows_and_ends() -> None:
    log = DoubtLog()
    assert log.lines({}, 0) == []
    (line,) = log.lines({"waist": FIELD}, 0)
    assert line == "node waist: its field is not the earth's"
    assert log.lines({"waist": FIELD}, 60 * NS_PER_S) == []
    (line,) = log.lines({"waist": FROZEN}, 60 * NS_PER_S)
    assert line == "node waist: it repeats one reading (its joints are invalid)"
    assert log.lines({}, 61 * NS_PER_S) == ["node waist: believed again"]


def test_figures_that_change_from_tick_to_tick_do_not_flood_the_log() -> None:
    log, lines = DoubtLog(), []
    for tenth in range(300):
        words = NodeDoubt(f"off by {tenth}", Weight.NOTED)
        lines += log.lines({"waist": words}, tenth * NS_PER_S // 10)
    assert len(lines) == 3
