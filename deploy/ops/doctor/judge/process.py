"""Whether the process may have the priority that its file asks for, and build networks for trials. Pure."""

from __future__ import annotations

from deploy.ops.doctor.judge.finding import Finding, ok, warn
from deploy.ops.doctor.read.process import CAP_IPC_LOCK, CAP_NET_ADMIN, CAP_SYS_NICE, ProcessFacts

ENOUGH_SHARE = 0.9
"""Linux leaves 5 % of each second to others by default."""


def judge_realtime(priority: int, facts: ProcessFacts) -> Finding:
    """`priority`: of [process]; 0 where none is asked for."""
    check = "real-time priority"
    if not priority:
        return ok(check, "not asked for", "[process] realtime_priority = 20 spares ticks beside other load")
    permitted = facts.may(CAP_SYS_NICE) or facts.realtime_limit >= priority
    if not permitted:
        return warn(
            check,
            f"priority {priority} would be refused here (limit {facts.realtime_limit:g}, no CAP_SYS_NICE)",
            "the units permit it (LimitRTPRIO); for a person's shell, in /etc/security/limits.d/tandem.conf: "
            f"`tandem - rtprio {priority}`",
        )
    if facts.realtime_share < ENOUGH_SHARE:
        return warn(
            check,
            f"real-time threads are stopped after {100 * facts.realtime_share:.0f} % of each second",
            "sysctl kernel.sched_rt_runtime_us=950000",
        )
    why = "CAP_SYS_NICE" if facts.may(CAP_SYS_NICE) else f"limit {facts.realtime_limit:g}"
    return ok(check, f"priority {priority} is permitted ({why})")


def judge_memory_lock(priority: int, facts: ProcessFacts, swap_bytes: int) -> Finding:
    """Whether a page that the loop needs may have to be read from a disk. With a priority it is locked."""
    check = "memory stays in memory"
    unlimited = facts.memlock_limit == float("inf")
    if priority and (unlimited or facts.may(CAP_IPC_LOCK)):
        return ok(check, f"may be locked ({'no limit' if unlimited else 'CAP_IPC_LOCK'})")
    if priority:
        return warn(
            check,
            f"may not be locked here (limit {facts.memlock_limit / 1024:.0f} kB, no CAP_IPC_LOCK)",
            "the units permit it (LimitMEMLOCK); for a person's shell, in "
            "/etc/security/limits.d/tandem.conf: `tandem - memlock unlimited`",
        )
    if not swap_bytes:
        return ok(check, "no swap")
    return warn(
        check,
        f"{swap_bytes / 2**30:.1f} GB of swap; without [process] realtime_priority nothing is locked",
        "the units keep it out of swap (MemorySwapMax=0); run by hand: `swapoff -a`",
    )


def judge_networks(facts: ProcessFacts) -> Finding:
    """Whether `tandem trial` can make hosts and links of its own."""
    check = "emulated networks"
    missing = [] if facts.may(CAP_NET_ADMIN) else ["CAP_NET_ADMIN"]
    missing += [] if facts.tun else ["/dev/net/tun"]
    if not missing:
        return ok(check, "namespaces and links can be made")
    advice = "as root: `modprobe tun`, then run trials as root or with CAP_NET_ADMIN; a robot needs neither"
    return warn(check, f"trials cannot make them: no {' and no '.join(missing)}", advice)
