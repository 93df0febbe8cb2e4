"""`[clock]`: what bounds the offset between the two hosts' clocks."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from common.config.section import RelativePath, Section

Source = Literal["auto", "round_trip", "chrony", "ptp"]


class ClockConfig(Section):
    """`[clock]`. Figures and prediction use it. The guard judges ages by the round trip alone."""

    source: Source = "auto"
    """`round_trip`: half the shortest round trip alone. `chrony`, `ptp`: where the error that this service
    states on both hosts is smaller, it replaces it. `auto`: whichever service answers."""
    chrony_port: int = Field(default=323, ge=1, le=65535)
    """UDP port on this host at which chronyd answers (its `cmdport`)."""
    ptp_socket: str = "/var/run/ptp4l"
    """ptp4l's `uds_address`."""
    ptp_domain: int = Field(default=0, ge=0, le=255)
    ptp_device: RelativePath | None = None
    """The hardware clock that ptp4l steers, such as `/dev/ptp0`; None: ptp4l stamps in software, and steers
    the system clock itself."""
