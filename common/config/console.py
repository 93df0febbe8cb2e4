"""`[console]`: where the web page is served, and how. `tandem console` reads it; no control loop does."""

from __future__ import annotations

import ipaddress
import re
from typing import Literal

from pydantic import Field

from common.config.section import RelativePath, Section
from common.errors import ConfigMistake

PAGE_KEYS = ("Escape", " ", "F2", "F3", "F4", "F6", "F7", "F8")
"""What the page's other keys are called by browsers: the first two stop the robot."""
_HOST_NAME = re.compile(r"[A-Za-z0-9]([A-Za-z0-9.-]{0,251}[A-Za-z0-9])?")


class CalibrationPageConfig(Section):
    """`[console.calibration]`: the suit is calibrated as the page leads, beside a master that runs."""

    folder: RelativePath | None = None
    """Takes the nodes' calibration files and recordings; without it the page calibrates nothing."""
    gravity_m_s2: float = Field(9.80665, ge=9.7, le=9.9)
    """At this place."""
    hemisphere: Literal["north", "south"] = "north"
    countdown_s: float = Field(5.0, ge=0.0, le=30.0)
    """From the word "I am ready" until the zero pose is to be held."""


class ConsoleConfig(Section):
    """`[console]`."""

    listen: str = "127.0.0.1:8080"
    """Address and port, such as 127.0.0.1:8080 or [::1]:8080; port 0: any that is free."""
    names: list[str] = Field(default_factory=list)
    """Other names by which browsers reach the page, such as `ward-3.example`. All others are refused."""
    certificate: RelativePath | None = None
    """For HTTPS: made by `tandem keys make` with `--host`; its .key lies beside it. Needed beyond
    this host."""
    authority: RelativePath | None = None
    """The authority (ca.pem of `tandem keys`) whose certificates stand for a token."""
    persons: dict[str, Literal["viewer", "operator", "engineer"]] = Field(default_factory=dict)
    """The page's role by a certificate's common name, such as `operator:nurse-2`; this operator's own is one
    already."""
    deadman_key: str = Field("F9", min_length=1, max_length=32)
    """The key that is held where the page is the deadman, as browsers name it (`KeyboardEvent.key`)."""
    language: Literal["en", "zh"] = "en"
    hardware_estop: bool = False
    """True only where the page's stop drives a certified emergency stop: the button may then be called so."""
    losing_page: Literal["nothing", "stop"] = "nothing"
    """`stop`: when the page of the person who engaged the robot is lost, the robot is stopped."""

    reports: RelativePath | None = None
    """A folder whose reports can be opened from the page, such as that of `tandem trial --out`."""
    study: RelativePath | None = None
    """The folder of a study: the page leads through the session that is under way there."""
    calibration: CalibrationPageConfig = CalibrationPageConfig()

    @property
    def host(self) -> str:
        """The address, without brackets."""
        return self.listen.rpartition(":")[0].strip("[]")

    @property
    def port(self) -> int:
        """The port."""
        return int(self.listen.rpartition(":")[2])

    @property
    def on_this_host_only(self) -> bool:
        """Whether no other host can reach the page."""
        return self.host == "localhost" or ipaddress.ip_address(self.host).is_loopback

    def mistakes(self) -> list[ConfigMistake]:
        """An address that is one; HTTPS wherever others may reach it."""
        host, colon, port = self.listen.rpartition(":")
        if not colon or not port.isdigit() or int(port) > 65535 or not _is_address(host.strip("[]")):
            return [ConfigMistake("console.listen", self.listen, "an address and a port: 127.0.0.1:8080")]
        if self.deadman_key in PAGE_KEYS:
            return [ConfigMistake("console.deadman_key", self.deadman_key, "a key without another use")]
        wrong = [name for name in self.names if not _HOST_NAME.fullmatch(name)]
        if wrong:
            return [ConfigMistake("console.names", wrong[0], "a host's name or address, without a port")]
        if self.authority is not None and self.certificate is None:
            expected = "a certificate: without HTTPS no browser shows its own"
            return [ConfigMistake("console.certificate", None, expected)]
        if not self.on_this_host_only and self.certificate is None:
            return [
                ConfigMistake(
                    "console.certificate",
                    None,
                    f"a certificate, as other hosts reach {self.listen}: `tandem keys make --host` makes one",
                )
            ]
        return []


def _is_address(host: str) -> bool:
    if host == "localhost":
        return True
    try:
        ipaddress.ip_address(host)
    except ValueError:
        return False
    return True
