"""Asks this host's time services how wrong its clock is, and reads the clocks beside each other.

`read` takes up to a second and is for a thread. What it makes of the answers is in chrony.py, ptp.py and
reference.py.
"""

from __future__ import annotations

import asyncio
import logging
import os
import shutil
import socket
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

from common.clock import NS_PER_S, Clock, monotonic_ns, wall_ns
from common.clock_sync.chrony import read_tracking, tracking_request
from common.clock_sync.config import ClockConfig
from common.clock_sync.ptp import QUESTIONS, PtpState, read_state
from common.clock_sync.reference import ReferenceTrack, Statement
from common.process.pacing import TickGrid
from common.process.ticker import ticks
from common.wire.messages import ClockReference

log = logging.getLogger(__name__)

ANSWER_S = 0.2
PMC_S = 2.0
READINGS = 5
EVERY_NS = NS_PER_S
SELDOM = 10
"""Where no service answers, it is asked every so many turns only."""


def read_beside(other_ns: Clock, own_ns: Clock = monotonic_ns) -> tuple[int, int, int]:
    """`own` now, `other` minus `own`, and the half-width of that: the closest of some readings."""
    closest = (0, 0, 1 << 62)
    for _ in range(READINGS):
        before_ns = own_ns()
        there_ns = other_ns()
        after_ns = own_ns()
        half_ns = (after_ns - before_ns + 1) // 2
        if half_ns < closest[2]:
            middle_ns = before_ns + half_ns
            closest = middle_ns, there_ns - middle_ns, half_ns
    return closest


class TimeServices:
    """chronyd and ptp4l of this host, as `[clock]` asks for them."""

    def __init__(self, config: ClockConfig) -> None:
        self._config = config
        self._number = 0
        self.track = ReferenceTrack()
        self.words = "not asked yet"
        """What they state, or why nothing."""

    def read(self) -> None:
        """Ask them."""
        source = self._config.source
        told: list[Statement | str] = []
        if source == "ptp" or (source == "auto" and Path(self._config.ptp_socket).exists()):
            told.append(self._ptp())
        if source in ("auto", "chrony"):
            told.append(self._chrony())
        stated = [one for one in told if isinstance(one, Statement)]
        if not stated:
            self.words = "; ".join(one for one in told if isinstance(one, str))
            self.track.silent()
            return
        best = min(stated, key=lambda one: one.error_ns)
        self.words = f"{best.source} states ± {best.error_ns / 1e6:.3f} ms ({best.scale})"
        self.track.take(best)

    def _chrony(self) -> Statement | str:
        self._number += 1
        _, before_ns, _ = read_beside(wall_ns)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as wire:
            wire.settimeout(ANSWER_S)
            try:
                wire.connect(("127.0.0.1", self._config.chrony_port))
                wire.send(tracking_request(self._number))
                answer = wire.recv(1024)
            except OSError as error:
                why = "no answer" if isinstance(error, TimeoutError) else error.strerror
                return f"chronyd at UDP port {self._config.chrony_port}: {why}"
        at_ns, wall_ahead_ns, half_ns = read_beside(wall_ns)
        tracking = read_tracking(answer, self._number)
        if tracking is None:
            return "chronyd's answer is not understood: expected its command protocol, version 6"
        if tracking.nothing_stated:
            return tracking.nothing_stated
        # the system clock is steered while the question is under way
        error_ns = tracking.error_ns + half_ns + abs(wall_ahead_ns - before_ns)
        ahead_ns = wall_ahead_ns + round(tracking.correction_s * NS_PER_S)
        return Statement(at_ns, ahead_ns, error_ns, "chrony", "utc", leaps=bool(tracking.leap))

    def _ptp(self) -> Statement | str:
        config, pmc = self._config, shutil.which("pmc")
        if pmc is None:
            return "`pmc` is missing: install linuxptp"
        ask = [pmc, "-u", "-b", "0", "-d", str(config.ptp_domain), "-s", config.ptp_socket, *QUESTIONS]
        try:
            done = subprocess.run(ask, capture_output=True, text=True, timeout=PMC_S, check=False)
        except (OSError, subprocess.TimeoutExpired):
            return f"ptp4l does not answer at {config.ptp_socket}"
        state = read_state(done.stdout)
        return state if isinstance(state, str) else self._by_clock(state)

    def _by_clock(self, state: PtpState) -> Statement | str:
        device = self._config.ptp_device
        if state.hardware != (device is not None):
            steered = "a hardware clock: name it" if state.hardware else "the system clock: leave out"
            return f"ptp4l steers {steered} [clock] ptp_device"
        if device is None:
            at_ns, ahead_ns, half_ns = read_beside(wall_ns)
            utc_offset_s = 0
        else:
            try:
                at_ns, ahead_ns, half_ns = _read_hardware(device)
            except OSError as error:
                return f"{device}: {error.strerror}"
            utc_offset_s = state.utc_offset_s  # a hardware clock counts TAI
        ahead_ns -= state.offset_ns + utc_offset_s * NS_PER_S
        return Statement(at_ns, ahead_ns, state.error_ns + half_ns, "ptp", state.scale, state.leaps)


def _read_hardware(device: Path) -> tuple[int, int, int]:
    number = os.open(device, os.O_RDONLY)
    try:
        clock = (~number << 3) | 3  # Linux: the clock of an open device
        return read_beside(lambda: time.clock_gettime_ns(clock))
    finally:
        os.close(number)


async def keep_reference(config: ClockConfig, tell: Callable[[ClockReference | None, int], None]) -> None:
    """Ask once a second until cancelled; `tell` takes what may be told to the other host, and the steps."""
    if config.source == "round_trip":
        return
    services, said = TimeServices(config), ""
    async for due in ticks(TickGrid(monotonic_ns(), EVERY_NS)):
        if due.tick % SELDOM and services.track.reference(monotonic_ns()) is None and due.tick > SELDOM:
            continue
        try:
            await asyncio.to_thread(services.read)
        except Exception as error:  # whatever goes wrong: the round trip is enough, and the session goes on
            services.words = f"the time service cannot be asked: {type(error).__name__}: {error}"
        tell(services.track.reference(monotonic_ns()), services.track.steps)
        source = services.words.partition(" states")[0]
        if source != said:
            log.info("clock: %s", services.words)
            said = source
