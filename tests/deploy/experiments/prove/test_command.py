"""`tandem prove` says in one line what is missing."""

from __future__ import annotations

import pytest

from common.errors import TandemError
from deploy.experiments.prove.command import _planted, prove_motion


def test_what_may_be_planted() -> None:
    assert _planted(["servo=20", "camera=15"]) == {"servo": 20, "camera": 15}
    for word in ("motor=20", "servo", "servo=7", "servo=-5"):
        with pytest.raises(TandemError, match="expected one of servo, encoder, camera and ms in steps of 5"):
            _planted([word])


def test_without_a_recording_it_says_what_to_do() -> None:
    with pytest.raises(
        TandemError, match="expected a recording, --lead SOCKET, --poll FILE, or --simulate lan"
    ):
        prove_motion()
