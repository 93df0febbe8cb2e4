import pytest

from common.wire.topics import CLOCK, COMMAND, CONTROL, TOPICS, Topic

every_topic = pytest.mark.parametrize("topic", TOPICS.values(), ids=TOPICS)


@every_topic
def test_no_topic_may_stall_the_loop(topic: Topic) -> None:
    assert topic.drop


@every_topic
def test_a_live_topic_is_alive_within_ten_periods(topic: Topic) -> None:
    if topic.rate_hz and topic.timeout_s:
        assert 2 / topic.rate_hz <= topic.timeout_s <= 10 / topic.rate_hz


@every_topic
def test_keys_name_the_robot_and_hold_no_wildcard(topic: Topic) -> None:
    key = topic.of("nurse-1").key_for("robot-1")
    assert key.startswith(("tandem/robot-1/", "tandem-summary/robot-1"))
    assert not set(key) & set("*$?#{}")


def test_names_and_keys_are_used_once() -> None:
    assert len({topic.key for topic in TOPICS.values()}) == len(TOPICS)
    assert all(name == topic.name for name, topic in TOPICS.items())


@pytest.mark.parametrize("topic", [COMMAND, CONTROL, CLOCK], ids=lambda t: t.name)
def test_what_moves_or_stops_the_robot_goes_first(topic: Topic) -> None:
    assert topic.priority == "real_time"
    assert topic.express


@pytest.mark.parametrize("topic", [CONTROL, CLOCK], ids=lambda t: t.name)
def test_questions_have_a_time_out(topic: Topic) -> None:
    assert 0 < topic.timeout_s <= 1
