"""Real-time priority for a process's threads, where the host permits it."""

from __future__ import annotations

import logging
import os

from pydantic import Field

from common.config import Section

log = logging.getLogger("tandem.realtime")


class ProcessConfig(Section):
    """`[process]`: how the host runs it."""

    realtime_priority: int = Field(0, ge=0, le=80)
    """SCHED_FIFO priority; 0 leaves the scheduler as it is. Lateness beside a busy core falls to a third."""


def take_priority(config: ProcessConfig) -> bool:
    """Give this thread, and those it starts later, the priority; False, and a word in the log, if refused."""
    if not config.realtime_priority:
        return False
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(config.realtime_priority))
    except OSError as error:
        log.warning(
            "no real-time priority (%s): ticks may be missed beside other load; "
            "grant CAP_SYS_NICE or LimitRTPRIO, or set process.realtime_priority = 0",
            error.strerror,
        )
        return False
    return True
