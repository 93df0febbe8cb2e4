"""Faults that somebody who tests tells the simulated suit while it runs."""

from __future__ import annotations

import pytest

from common.errors import ConfigError
from deploy.sim.suit.faults import FaultsConfig
from deploy.sim.suit.process import requested_faults

NODES = ["chest", "head"]


def test_they_are_read_as_those_of_the_file() -> None:
    faults = requested_faults(b'lose = [{ node = "head" }]', NODES)
    assert [loss.node for loss in faults.lose] == ["head"]
    assert faults.lose[0].includes(12.0)


def test_nothing_told_is_no_fault() -> None:
    assert requested_faults(b"", NODES) == FaultsConfig()


@pytest.mark.parametrize(
    ("told", "expected"),
    [
        (b"lose = [", "faults = .*expected valid TOML"),
        (b"\xff", "expected valid TOML"),
        (b"speed = 1", "speed = 1: expected no such key"),
        (b'lose = [{ node = "tail" }]', "faults.lose.0.node = 'tail': expected the segment"),
    ],
)
def test_what_is_no_fault_is_refused(told: bytes, expected: str) -> None:
    with pytest.raises(ConfigError, match=expected):
        requested_faults(told, NODES)
