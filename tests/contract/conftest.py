"""The buses on which one contract is kept: what each is called, and how to break and mend it."""

from __future__ import annotations

import errno
import itertools
import os
import socket
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import ParamSpec, TypeVar

import can
import pytest
from _pytest.mark.structures import ParameterSet

from common.can.config import BusConfig
from common.can.interface import open_bus
from common.errors import BusError

_channel_number = itertools.count()
P = ParamSpec("P")
R = TypeVar("R")


class Wire:
    """One bus seen from its two ends; `broken` says what an end finds there now."""

    def __init__(self, near: BusConfig, far: BusConfig) -> None:
        self.near = near
        self.far = far

    @property
    def fd(self) -> bool:
        return self.near.fd

    def open(self, config: BusConfig) -> can.BusABC:
        """As the adapter opens it."""
        return open_bus(config)

    def disappear(self) -> None:
        raise NotImplementedError

    def come_back(self) -> None:
        raise NotImplementedError


class SimulatedWire(Wire):
    """`virtual` and `udp_multicast`: they never fail by themselves, so every end fails by injection."""

    def __init__(self, near: BusConfig, far: BusConfig) -> None:
        super().__init__(near, far)
        self.gone = False

    def open(self, config: BusConfig) -> can.BusABC:
        if self.gone:
            raise BusError(f"bus {config.name}: {os.strerror(errno.ENODEV)}")
        bus = open_bus(config)
        bus.recv = self._failing(bus.recv)  # type: ignore[method-assign]
        bus.send = self._failing(bus.send)  # type: ignore[method-assign]
        return bus

    def _failing(self, operation: Callable[P, R]) -> Callable[P, R]:
        def attempt(*args: P.args, **kwargs: P.kwargs) -> R:
            if self.gone:
                raise can.CanOperationError(os.strerror(errno.ENETDOWN), errno.ENETDOWN)
            return operation(*args, **kwargs)

        return attempt

    def disappear(self) -> None:
        self.gone = True

    def come_back(self) -> None:
        self.gone = False


class KernelWire(Wire):
    """`socketcan`: the interface goes down and up again."""

    def disappear(self) -> None:
        ip("link", "set", self.near.channel, "down")

    def come_back(self) -> None:
        ip("link", "set", self.near.channel, "up")


def ip(*arguments: str) -> None:
    """Run iproute2; what it says is the failure."""
    done = subprocess.run(["ip", *arguments], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, f"ip {' '.join(arguments)}: {done.stderr}"


def virtual(fd: bool) -> Wire:
    channel = f"contract-{next(_channel_number)}"
    near = BusConfig(name="near", interface="virtual", channel=channel, fd=fd)
    return SimulatedWire(near, near.model_copy(update={"name": "far"}))


def udp_multicast(fd: bool) -> Wire:
    # a port of its own, so that neither a running suit nor the test before is heard
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("", 0))
        options: dict[str, str | int | float | bool] = {"port": free.getsockname()[1], "hop_limit": 0}
    near = BusConfig(name="near", interface="udp_multicast", channel="239.74.163.7", fd=fd, options=options)
    return SimulatedWire(near, near.model_copy(update={"name": "far"}))


def vcan(fd: bool) -> Wire:
    _need_interfaces("vcan0")
    ip("link", "set", "vcan0", "up")
    near = BusConfig(name="near", interface="socketcan", channel="vcan0", fd=fd)
    return KernelWire(near, near.model_copy(update={"name": "far"}))


def kvaser() -> Wire:
    _need_interfaces("can0", "can1")
    for channel in ("can0", "can1"):
        ip("link", "set", channel, "down")
        ip("link", "set", channel, "type", "can", "bitrate", "500000", "restart-ms", "100")
        ip("link", "set", channel, "up")
    near = BusConfig(name="near", interface="socketcan", channel="can0", fd=False)
    return KernelWire(near, near.model_copy(update={"name": "far", "channel": "can1"}))


def has_socketcan() -> bool:
    """Whether this kernel has raw CAN sockets."""
    try:
        socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW).close()
    except (AttributeError, OSError):
        return False
    return True


def _need_interfaces(*names: str) -> None:
    if not has_socketcan():
        pytest.skip("this kernel has no SocketCAN")
    for name in names:
        if not (Path("/sys/class/net") / name).exists():
            pytest.skip(f"there is no interface {name}")


WIRES: dict[str, Callable[[], Wire]] = {
    "virtual-fd": lambda: virtual(fd=True),
    "virtual-classic": lambda: virtual(fd=False),
    "udp_multicast-fd": lambda: udp_multicast(fd=True),
    "udp_multicast-classic": lambda: udp_multicast(fd=False),
    "socketcan-vcan-fd": lambda: vcan(fd=True),
    "socketcan-vcan-classic": lambda: vcan(fd=False),
    "socketcan-kvaser-classic": kvaser,
}


def _parameters() -> list[ParameterSet]:
    kernel = pytest.mark.kernel_can
    return [pytest.param(name, marks=kernel if "socketcan" in name else ()) for name in WIRES]


@pytest.fixture(params=_parameters())
def wire(request: pytest.FixtureRequest) -> Iterator[Wire]:
    wire = WIRES[request.param]()
    yield wire
    wire.come_back()
