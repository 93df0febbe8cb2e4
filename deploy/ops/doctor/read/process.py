"""What this process may do: limits, capabilities, groups. A service's own may differ: see its unit."""

from __future__ import annotations

import math
from dataclasses import dataclass

from deploy.ops.doctor.read.tree import Tree

CAP_NET_ADMIN, CAP_IPC_LOCK, CAP_SYS_NICE = 12, 14, 23
"""Bits of the effective set (linux/capability.h)."""


@dataclass(frozen=True, slots=True)
class ProcessFacts:
    """The limits of the process that reads them."""

    realtime_limit: float
    """Largest real-time priority that it may take without a capability (RLIMIT_RTPRIO)."""
    memlock_limit: float
    """Bytes that it may keep in memory."""
    capabilities: int
    """The effective set."""
    realtime_share: float
    """The share of each second that real-time threads may run; 1 if they are not throttled."""
    tun: bool
    """Whether /dev/net/tun is there."""

    def may(self, capability: int) -> bool:
        """Whether it has one capability."""
        return bool(self.capabilities >> capability & 1)


def read_process(tree: Tree) -> ProcessFacts:
    """From /proc/self; what cannot be read counts as not permitted."""
    limits = tree.text("/proc/self/limits") or ""
    capabilities = tree.fields("/proc/self/status").get("CapEff", "0")
    runtime_us = tree.number("/proc/sys/kernel/sched_rt_runtime_us")
    period_us = tree.number("/proc/sys/kernel/sched_rt_period_us")
    return ProcessFacts(
        realtime_limit=_soft_limit(limits, "Max realtime priority"),
        memlock_limit=_soft_limit(limits, "Max locked memory"),
        capabilities=int(capabilities, 16),
        realtime_share=1.0 if not period_us or runtime_us in (None, -1) else (runtime_us or 0) / period_us,
        tun=tree.at("/dev/net/tun").exists(),
    )


def _soft_limit(limits: str, name: str) -> float:
    for line in limits.splitlines():
        if line.startswith(name):
            value = line.removeprefix(name).split()[0]
            return math.inf if value == "unlimited" else float(value)
    return 0.0
