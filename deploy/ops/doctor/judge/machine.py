"""Whether the machine will keep a 200 Hz loop on time. Pure. How well it does, `tandem bench` measures."""

from __future__ import annotations

from common.can.interface import RECEIVE_BUFFER_BYTES
from deploy.ops.doctor.judge.finding import Finding, fail, ok, warn
from deploy.ops.doctor.judge.needs import BusNeed
from deploy.ops.doctor.read.machine import MachineFacts

ENOUGH_MEMORY_BYTES = 512 << 20
LITTLE_DISK_BYTES, NO_DISK_BYTES = 5 << 30, 1 << 30
A_RECORDED_HOUR_BYTES = 150 << 20
"""Commands, states and statistics; the pictures come on top."""


def judge_machine(facts: MachineFacts) -> list[Finding]:
    """Cores, governor, kernel, load and memory."""
    return [_cores(facts), _governor(facts), _kernel(facts), _load(facts), _memory(facts)]


def judge_receive_buffer(needs: tuple[BusNeed, ...], facts: MachineFacts) -> list[Finding]:
    """Only where a bus goes over UDP: the frames of half a second must fit when the loop is late."""
    if not any(need.bus.interface == "udp_multicast" for need in needs):
        return []
    check = "socket buffer"
    most = facts.receive_buffer_bytes
    if most >= RECEIVE_BUFFER_BYTES:
        return [ok(check, f"up to {most >> 10} kB")]
    asked = RECEIVE_BUFFER_BYTES >> 10
    found = f"at most {most >> 10} kB, {asked} kB are asked for: a late loop loses frames"
    return [warn(check, found, f"sysctl -w net.core.rmem_max={RECEIVE_BUFFER_BYTES}")]


def judge_disk(folder: str, free_bytes: int | None) -> Finding:
    """Room for recordings; None where the folder is not there."""
    check = "disk for recordings"
    if free_bytes is None:
        return warn(check, f"no folder {folder}", f"mkdir -p {folder}, or name another by --recordings")
    hours = free_bytes / A_RECORDED_HOUR_BYTES
    words = f"{free_bytes / 2**30:.1f} GB free in {folder}, about {hours:.0f} h without pictures"
    if free_bytes >= LITTLE_DISK_BYTES:
        return ok(check, words)
    judge = fail if free_bytes < NO_DISK_BYTES else warn
    return judge(check, words, "make room, or record elsewhere")


def judge_clock(synchronised: bool | None) -> Finding:
    """The date is for recordings, logs and certificates: the link measures by monotonic clocks."""
    check = "date"
    if synchronised is None:
        return ok(check, "the kernel does not report whether it is synchronised")
    if synchronised:
        return ok(check, "synchronised")
    advice = "apt install chrony: recordings and certificates need the date; the robot does not"
    return warn(check, "nothing sets this host's clock", advice)


def judge_services(read: tuple[bool, str] | None) -> list[Finding]:
    """What this host's time services state. Without one the round trip bounds one-way times."""
    if read is None:
        return []
    states, words = read
    if states:
        return [ok("clock", f"{words}; used where it is narrower than half the round trip")]
    return [ok("clock", f"half the round trip bounds one-way times ({words})")]


def judge_tcp(facts: MachineFacts) -> list[Finding]:
    """How tcp shares a line, and whether it copes with a path that swallows large packets."""
    if not facts.congestion_control:
        return []
    finds = "finds" if facts.mtu_probing else "does not find"
    probing = f"{finds} a path's packet size by itself"
    words = f"congestion control {facts.congestion_control}; {probing}"
    if facts.congestion_control == "bbr":
        advice = (
            "on lines of some 200 ms and more bbr was measured to silence the link six times a minute: "
            '`[link] tcp_congestion_control = "cubic"` on both hosts, or quic'
        )
        return [warn("tcp", words, advice)]
    return [ok("tcp", words)]


def _cores(facts: MachineFacts) -> Finding:
    words = f"{facts.cores} cores" + (f", {facts.isolated} isolated" if facts.isolated else "")
    if facts.cores < 2:
        return warn("cores", words, "use a machine with two: else what else runs here delays the loop")
    hint = "" if facts.isolated else "beside other load: isolcpus= at boot, and CPUAffinity= in the unit"
    return ok("cores", words, hint)


def _governor(facts: MachineFacts) -> Finding:
    check = "CPU governor"
    slow = sorted(set(facts.governors) - {"performance"})
    if not facts.governors:
        return ok(check, "the frequency is not scaled")
    if not slow:
        return ok(check, "performance")
    advice = "cpupower frequency-set -g performance: waking from a slow clock costs some 0.2 ms a tick"
    return warn(check, ", ".join(slow), advice)


def _kernel(facts: MachineFacts) -> Finding:
    words = {"rt": "PREEMPT_RT", "dynamic": "preemptible (dynamic)", "full": "preemptible"}
    if facts.preemption == "rt":
        return ok("kernel", words["rt"])
    found = words.get(facts.preemption, "not known to be preemptible")
    return ok("kernel", found, "on a busy host: apt install linux-image-rt-amd64")


def _load(facts: MachineFacts) -> Finding:
    words = f"{facts.load:.1f} over the last minute"
    if facts.load <= facts.cores:
        return ok("load", words)
    return warn("load", words, "see what else runs here: `top`")


def _memory(facts: MachineFacts) -> Finding:
    words = f"{facts.available_bytes / 2**30:.1f} GB available"
    if facts.available_bytes >= ENOUGH_MEMORY_BYTES:
        return ok("memory", words)
    return fail("memory", words, "a side with its simulated robot takes 0.4 GB: end something else")
