"""CAN interfaces: their state from /sys/class/net, and their bit rates from netlink (`ip`)."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass

from deploy.ops.doctor.read.tree import Tree

CAN_TYPE = 280
"""ARPHRD_CAN."""
FD_MTU = 72
"""An interface with this much room for a frame carries CAN FD."""
_IFF_UP = 1
_IP_TIMEOUT_S = 5.0


@dataclass(frozen=True, slots=True)
class CanInterface:
    """One interface as the kernel has it."""

    name: str
    up: bool
    fd: bool
    bitrate: int = 0
    """0 where it is not known: a virtual bus has none."""
    data_bitrate: int = 0
    state: str = ""
    """The controller's, such as ERROR-ACTIVE or BUS-OFF; empty where it is not known."""


def read_can(tree: Tree, ip_json: str | None) -> dict[str, CanInterface]:
    """The interfaces by name. `ip_json`: the output of `ip -details -json link show`; None if it failed."""
    details = _details(ip_json)
    return {
        name: _interface(tree, name, details.get(name, {}))
        for name in tree.names("/sys/class/net")
        if tree.number(f"/sys/class/net/{name}/type") == CAN_TYPE
    }


def ask_ip() -> str | None:
    """The output of `ip` for all interfaces; None if there is no such program, or it fails."""
    program = shutil.which("ip", path="/usr/sbin:/sbin:/usr/bin:/bin")
    if program is None:
        return None
    try:
        asked = subprocess.run(
            [program, "-details", "-json", "link", "show"],
            capture_output=True, text=True, timeout=_IP_TIMEOUT_S, check=False,
        )  # fmt: skip
    except (OSError, subprocess.TimeoutExpired):
        return None
    return asked.stdout if asked.returncode == 0 else None


def _interface(tree: Tree, name: str, details: Mapping[str, object]) -> CanInterface:
    flags = tree.text(f"/sys/class/net/{name}/flags") or "0"
    return CanInterface(
        name,
        up=bool(int(flags, 16) & _IFF_UP),
        fd=tree.number(f"/sys/class/net/{name}/mtu") == FD_MTU,
        bitrate=_bitrate(details, "bittiming"),
        data_bitrate=_bitrate(details, "data_bittiming"),
        state=str(details.get("state", "")),
    )


def _bitrate(details: Mapping[str, object], of: str) -> int:
    timing = details.get(of)
    rate = timing.get("bitrate") if isinstance(timing, dict) else None
    return rate if isinstance(rate, int) else 0


def _details(ip_json: str | None) -> dict[str, dict[str, object]]:
    try:
        links = json.loads(ip_json or "[]")
    except ValueError:
        return {}
    return {link.get("ifname", ""): link.get("linkinfo", {}).get("info_data", {}) for link in links}
