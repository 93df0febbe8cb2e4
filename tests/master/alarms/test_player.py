"""The player on a card that behaves as real ones do: refused rates, pulled out, late, missing, hanging."""

from __future__ import annotations

import logging
import threading

import numpy as np
import pytest

from common.clock import to_ns
from master.alarms.alarm import Alarm
from master.alarms.config import AlarmsConfig
from master.alarms.player import TonePlayer
from master.alarms.tones import burst
from tests.master.alarms.card import Card


class Desk:
    """A player that is looked after by hand, in time that the test moves on."""

    def __init__(self, card: Card) -> None:
        self.card = card
        self.now_s = 100.0
        self.player = TonePlayer(AlarmsConfig(), lambda: card, lambda: to_ns(self.now_s))

    def passes(self, seconds: float, late: bool = False) -> None:
        """The card asks for blocks of 10 ms meanwhile."""
        for _ in range(round(seconds / 0.01)):
            self.now_s += 0.01
            self.card.asks(self.player._rate_hz // 100, late=late)


def test_a_burst_is_heard_at_its_volume() -> None:
    desk = Desk(Card())
    assert desk.player.look()
    desk.passes(0.1)
    desk.card.heard.clear()
    desk.player.play(Alarm.HOLD)
    desk.passes(1.1)
    wave = burst(Alarm.HOLD, 48_000)
    np.testing.assert_allclose(np.concatenate(desk.card.heard)[: len(wave)], 0.5 * wave, atol=1e-6)


def test_a_card_that_refuses_the_rate_plays_at_its_own() -> None:
    desk = Desk(Card(rates_hz=(44_100,)))
    assert desk.player.look()
    assert desk.card.opened == [44_100]
    desk.player.play(Alarm.CLAMP)
    desk.passes(0.7)
    wave = burst(Alarm.CLAMP, 44_100)
    np.testing.assert_allclose(np.concatenate(desk.card.heard)[: len(wave)], 0.5 * wave, atol=1e-6)


@pytest.mark.parametrize("tells", [True, False])
def test_a_card_that_is_pulled_out_is_noticed_and_found_again(
    tells: bool, caplog: pytest.LogCaptureFixture
) -> None:
    desk = Desk(Card())
    desk.card.tells_when_gone = tells
    assert desk.player.look()
    desk.passes(1.0)
    desk.card.unplug()
    desk.passes(0.0 if tells else 2.1)
    desk.now_s += 0.0 if tells else 2.1
    with caplog.at_level(logging.INFO):
        for _ in range(3):
            assert not desk.player.look()
            desk.player.play(Alarm.ESTOP)
        desk.card.plugged = True
        assert desk.player.look()
    said = [record.message for record in caplog.records]
    assert said == [
        "alarms are not heard: the sound card has gone; the master goes on",
        "alarms are heard again",
    ]
    # a card plugged in since is not in the list that the library made when it started
    assert desk.card.started > 1


def test_just_before_the_time_is_over_a_slow_card_is_still_there() -> None:
    desk = Desk(Card())
    desk.player.look()
    desk.passes(0.1)
    desk.now_s += 2.0
    assert desk.player.look()
    desk.now_s += 0.001
    assert not desk.player.look()


def test_a_card_that_runs_out_is_counted_and_goes_on() -> None:
    desk = Desk(Card())
    desk.player.look()
    desk.player.play(Alarm.HOLD)
    desk.passes(0.05, late=True)
    assert desk.player.underruns == 5
    assert desk.player.look()


def test_a_card_that_does_not_start_is_said_once(caplog: pytest.LogCaptureFixture) -> None:
    desk = Desk(Card())
    desk.card.wont_start = True
    with caplog.at_level(logging.INFO):
        assert not desk.player.look()
        assert not desk.player.look()
    assert len(caplog.records) == 1
    assert "Unanticipated host error" in caplog.text


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (
            ModuleNotFoundError("No module named 'sounddevice'", name="sounddevice"),
            "pip install 'tandem[sound]'",
        ),
        (OSError("PortAudio library not found"), "no sound card can be opened: PortAudio library not found"),
    ],
)
def test_a_missing_package_or_library_is_said_once_and_stops_nothing(
    error: Exception, said: str, caplog: pytest.LogCaptureFixture
) -> None:
    def load() -> object:
        raise error

    player = TonePlayer(AlarmsConfig(), load)
    with caplog.at_level(logging.INFO):
        for _ in range(3):
            assert not player.look()
            player.play(Alarm.ESTOP)
    assert [said in record.message for record in caplog.records] == [True]


def test_a_card_that_hangs_holds_nobody_up() -> None:
    opened, let_go = threading.Event(), threading.Event()

    def load() -> object:
        opened.set()
        let_go.wait(30.0)
        raise OSError("too late")

    player = TonePlayer(AlarmsConfig(), load)
    player.start()
    try:
        assert opened.wait(30.0)
        # returns although the card has not opened yet
        player.play(Alarm.ESTOP)
        assert player.silent_because == ""
    finally:
        let_go.set()
        player.stop()
    assert "too late" in player.silent_because
