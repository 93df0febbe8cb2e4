"""The filters by their names, as a TOML writes them."""

from __future__ import annotations

from functools import partial

from master.orientation.ekf import EkfConfig, EkfFilter
from master.orientation.filter import MakeFilter
from master.orientation.mahony import MahonyConfig, MahonyFilter
from master.orientation.vqf import VqfConfig, VqfFilter


def makers(
    rate_hz: float,
    vqf: VqfConfig | None = None,
    mahony: MahonyConfig | None = None,
    ekf: EkfConfig | None = None,
) -> dict[str, MakeFilter]:
    """What makes each filter for readings at that rate; None takes the defaults."""
    return {
        "vqf": partial(VqfFilter, vqf or VqfConfig(), rate_hz),
        "mahony": partial(MahonyFilter, mahony or MahonyConfig(), rate_hz),
        "ekf": partial(EkfFilter, ekf or EkfConfig(), rate_hz),
    }
