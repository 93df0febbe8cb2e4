"""The machine: cores and how they are clocked, kernel, memory, socket buffers, load."""

from __future__ import annotations

import re
from dataclasses import dataclass

from deploy.ops.doctor.read.tree import Tree

_CPU = "/sys/devices/system/cpu"


@dataclass(frozen=True, slots=True)
class MachineFacts:
    """What one host's kernel and hardware are."""

    cores: int
    governors: tuple[str, ...]
    """The governors of the cores with frequency scaling; empty without it, as in a virtual machine."""
    isolated: str
    """Cores that the scheduler leaves alone, such as `2-3`; empty where none is."""
    preemption: str
    """`rt`, `dynamic`, `full` or empty where the kernel does not tell."""
    load: float
    """The load average of the last minute."""
    receive_buffer_bytes: int
    """Most that a socket may ask for."""
    congestion_control: str
    """The default congestion control of TCP."""
    mtu_probing: bool
    """Whether tcp finds out by itself that a path swallows large packets."""
    available_bytes: int
    swap_bytes: int


def read_machine(tree: Tree) -> MachineFacts:
    """What cannot be read counts as 0 or empty."""
    memory = tree.fields("/proc/meminfo")
    cores = [name for name in tree.names(_CPU) if re.fullmatch(r"cpu\d+", name)]
    governors = [tree.text(f"{_CPU}/{core}/cpufreq/scaling_governor") for core in cores]
    return MachineFacts(
        cores=len(cores),
        governors=tuple(governor for governor in governors if governor),
        isolated=tree.text(f"{_CPU}/isolated") or "",
        preemption=_preemption(tree),
        load=float((tree.text("/proc/loadavg") or "0").split()[0]),
        receive_buffer_bytes=tree.number("/proc/sys/net/core/rmem_max") or 0,
        congestion_control=tree.text("/proc/sys/net/ipv4/tcp_congestion_control") or "",
        mtu_probing=(tree.number("/proc/sys/net/ipv4/tcp_mtu_probing") or 0) > 0,
        available_bytes=_kilobytes(memory.get("MemAvailable", "")),
        swap_bytes=_kilobytes(memory.get("SwapTotal", "")),
    )


def _preemption(tree: Tree) -> str:
    version = tree.text("/proc/version") or ""
    if tree.text("/sys/kernel/realtime") == "1" or "PREEMPT_RT" in version:
        return "rt"
    if "PREEMPT_DYNAMIC" in version:
        return "dynamic"
    return "full" if re.search(r"\bPREEMPT\b", version) else ""


def _kilobytes(text: str) -> int:
    number = text.split()[0] if text else "0"
    return 1024 * int(number) if number.isdecimal() else 0
