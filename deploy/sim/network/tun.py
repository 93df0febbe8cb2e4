"""The forwarder from its parent's side: two TUN devices, one in each host, and the process between them."""

from __future__ import annotations

import json
import os
import socket
import struct
import subprocess
import sys
from pathlib import Path

from common.errors import NetworkError
from common.metrics.tree import from_tree, to_tree
from deploy.sim.network.emulation import LinkCounters, LinkRequest
from deploy.sim.network.namespaces import LINK, NetworkRun, ip, link_addresses
from deploy.sim.network.profile import Profile

DEVICE = Path("/dev/net/tun")
ANSWER_S = 5.0
_TUNSETIFF, _IFF_TUN, _IFF_NO_PI = 0x400454CA, 0x0001, 0x1000


class Forwarder:
    """An emulation by our own process; each request blocks for the forwarder's answer, some 0.2 ms."""

    name = "forwarder"

    def __init__(self, run: NetworkRun, profile: Profile, seed: int) -> None:
        """Raises NetworkError."""
        devices: list[int] = []
        try:
            for host, address, peer in link_addresses(run):
                devices.append(_open_tun(f"{run.short}{len(devices)}"))
                ip("link", "set", f"{run.short}{len(devices) - 1}", "netns", host, "name", LINK)
                # only what the two sides send, no neighbour's questions
                ip("-n", host, "link", "set", LINK, "txqueuelen", "5000", "addrgenmode", "none")
                ip("-n", host, "address", "add", address, "peer", peer, "dev", LINK)
                ip("-n", host, "link", "set", LINK, "up")
            ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            with theirs:
                passed = (*devices, theirs.fileno())
                arguments = [*map(str, passed), str(seed)]
                self._process = subprocess.Popen(
                    [sys.executable, "-m", "deploy.sim.network.forwarder", *arguments],
                    pass_fds=passed,
                    stdin=subprocess.DEVNULL,
                    start_new_session=True,  # Ctrl-C is the parent's to answer
                )
        finally:
            for device in devices:
                os.close(device)
        self._control = ours
        self._control.settimeout(ANSWER_S)
        self.set(profile)

    def set(self, profile: Profile) -> None:
        """Change the link to this profile."""
        self._ask(LinkRequest(profile=profile.model_dump_json(exclude_unset=True)))

    def cut(self, cut: bool) -> None:
        """Let nothing pass, or let it pass again."""
        self._ask(LinkRequest(cut=cut))

    def counters(self) -> LinkCounters:
        """Packets and bytes each way so far."""
        return self._ask(LinkRequest())

    def close(self) -> None:
        """End the process."""
        self._control.close()
        try:
            self._process.wait(ANSWER_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _ask(self, request: LinkRequest) -> LinkCounters:
        try:
            self._control.send(json.dumps(to_tree(request)).encode())
            answer = self._control.recv(1_000_000)
        except OSError as error:
            answer = b""
            why = f" ({error})"
        else:
            why = f" (status {self._process.poll()})"
        if not answer:
            raise NetworkError(f"the forwarder between the hosts does not answer{why}")
        return from_tree(LinkCounters, json.loads(answer))


def _open_tun(name: str) -> int:
    try:
        device = os.open(DEVICE, os.O_RDWR | os.O_NONBLOCK)
    except OSError as error:
        raise NetworkError(f"{DEVICE}: {error.strerror}; the forwarder needs it: modprobe tun") from None
    try:
        import fcntl  # Linux alone has tun devices

        fcntl.ioctl(device, _TUNSETIFF, struct.pack("16sH22x", name.encode(), _IFF_TUN | _IFF_NO_PI))
    except OSError as error:
        os.close(device)
        raise NetworkError(f"no TUN device can be made: {error.strerror}") from None
    return device
