"""Which node needs attention."""

from __future__ import annotations

from deploy.console.model.nodes import NodeQuality, NodeWatch


def quality(watch: NodeWatch) -> NodeQuality:
    return watch.qualities[0]


def test_a_node_is_judged_by_the_last_second() -> None:
    watch = NodeWatch(["hand"])
    assert quality(watch).level == "unknown"
    watch.on_counters({"hand": {"fresh": 100, "lost": 100}}, {})
    assert quality(watch).level == "attention"
    assert watch.on_counters({"hand": {"fresh": 300, "lost": 100}}, {}) == [], "how it begins is no news"
    assert (quality(watch).level, quality(watch).answered_percent, quality(watch).lost) == ("ok", 100.0, 100)


def test_99_percent_is_enough_and_less_is_not() -> None:
    watch = NodeWatch(["hand"])
    watch.on_counters({"hand": {"fresh": 198, "late": 2}}, {})
    assert quality(watch).level == "ok"
    watch.on_counters({"hand": {"fresh": 395, "late": 5}}, {})
    assert (quality(watch).level, quality(watch).words) == ("attention", "answered 98 % of the windows")


def test_a_node_that_answers_nothing_is_silent() -> None:
    watch = NodeWatch(["hand"])
    watch.on_counters({"hand": {"fresh": 200}}, {})
    assert watch.on_counters({"hand": {"fresh": 200, "late": 20, "lost": 180}}, {}) == ["hand: silent"]
    assert quality(watch).level == "silent"
    assert watch.on_counters({"hand": {"fresh": 200, "late": 20, "lost": 380}}, {}) == [], "still"
    again = watch.on_counters({"hand": {"fresh": 400, "late": 20, "lost": 380}}, {})
    assert again == ["hand: answers as it should"]


def test_what_the_master_doubts_and_counts_is_said() -> None:
    watch = NodeWatch(["hand"])
    watch.on_counters({"hand": {"fresh": 200}}, {})
    watch.on_counters({"hand": {"fresh": 400, "bad_checksum": 2}}, {"hand": "frozen"})
    assert quality(watch).words == "frozen; 2 frames with a wrong checksum"


def test_a_master_that_started_anew_counts_from_nothing() -> None:
    watch = NodeWatch(["hand"])
    watch.on_counters({"hand": {"fresh": 10_000, "lost": 500}}, {})
    watch.on_counters({"hand": {"fresh": 200}}, {})
    assert (quality(watch).level, quality(watch).answered_percent) == ("ok", 100.0)
    watch.forget()
    assert quality(watch).level == "unknown"
