"""Real-time scheduling for a process's threads, and its memory kept in memory, where the host permits it."""

from __future__ import annotations

import ctypes
import logging
import os

from pydantic import Field

from common.config.section import Section

log = logging.getLogger(__name__)

_MCL_CURRENT, _MCL_FUTURE, _MCL_ONFAULT = 1, 2, 4
"""mlockall(2): what is there, what will come, each page from its first use on."""


class ProcessConfig(Section):
    """`[process]`: how the host runs it."""

    realtime_priority: int = Field(0, ge=0, le=80)
    """SCHED_FIFO priority; 0 leaves scheduler and memory as they are. Lateness beside a busy core falls to a
    third. With it the kernel may not take back a page that the process has used, code least of all."""


def enter_real_time(priority: int) -> bool:
    """Give this thread, and those it starts later, SCHED_FIFO, and lock the process's memory; 0: neither.

    Call it once what takes long has been built: with the priority, that would take a core from the
    neighbours. False, and a warning in the log, where the priority is refused. Memory that may not be locked
    is a warning too, and not fatal.
    """
    if not priority:
        return False
    if not hasattr(os, "sched_setscheduler"):
        log.warning("no real-time priority: this system has no SCHED_FIFO; set process.realtime_priority = 0")
        return False
    _lock_memory()
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except OSError as error:
        log.warning(
            "no real-time priority (%s): under load the loop may miss ticks; "
            "grant CAP_SYS_NICE or LimitRTPRIO, or set process.realtime_priority = 0",
            error.strerror,
        )
        return False
    return True


def _lock_memory() -> None:
    import resource  # Linux and macOS

    # a finite limit might be reached later, and then a mere allocation would fail: all or nothing
    unlimited = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0] == resource.RLIM_INFINITY
    refused = "a limit is set"
    if unlimited or os.geteuid() == 0:
        libc = ctypes.CDLL(None, use_errno=True)
        if libc.mlockall(_MCL_CURRENT | _MCL_FUTURE | _MCL_ONFAULT) == 0:
            return
        refused = os.strerror(ctypes.get_errno())
    log.warning(
        "memory not locked (%s): a page that must be read from the disk again delays a tick; "
        "grant CAP_IPC_LOCK or LimitMEMLOCK=infinity",
        refused,
    )
