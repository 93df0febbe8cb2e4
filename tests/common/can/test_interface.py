from __future__ import annotations

import errno
import os
import socket
from pathlib import Path

import can
import pytest

from common.can.config import BusConfig
from common.can.interface import (
    RECEIVE_BUFFER_BYTES,
    carries_classic_only,
    descriptor,
    error_number,
    explain,
    open_bus,
)
from common.errors import BusError


def bus(interface: str, channel: str, fd: bool = True, **options: str | int | float | bool) -> BusConfig:
    return BusConfig(name="suit", interface=interface, channel=channel, fd=fd, options=options)


CAN0 = bus("socketcan", "can0", fd=False)
GROUP = bus("udp_multicast", "239.74.163.2", hop_limit=0)
EXPLAINED = [
    (CAN0, OSError(errno.ENODEV, "x"), "cannot open socketcan can0: No such device; plug the adapter in"),
    (
        CAN0,
        OSError(errno.ENETDOWN, "x"),
        "`ip link set can0 type can bitrate 1000000`, then `ip link set can0",
    ),
    (CAN0, OSError(errno.EAFNOSUPPORT, "x"), "this kernel has no SocketCAN"),
    (GROUP, OSError(errno.ENODEV, "x"), "`ip route add 239.0.0.0/8 dev lo`"),
    (GROUP, OSError(errno.ENETUNREACH, "x"), "`ip route add 239.0.0.0/8 dev lo`"),
    (GROUP, OSError(errno.EINVAL, "x"), "must be a multicast group"),
    (bus("pcan", "PCAN_USBBUS1"), ValueError("no such\n  channel"), "pcan PCAN_USBBUS1: no such channel; "),
]


@pytest.mark.parametrize(("config", "error", "expected"), EXPLAINED)
def test_each_failure_is_one_line_with_its_remedy(config: BusConfig, error: Exception, expected: str) -> None:
    text = explain(config, error)
    assert text.startswith("bus suit: cannot open ")
    assert expected in text
    assert "tandem suit" in text
    assert "\n" not in text


def test_an_fd_bus_is_advised_a_data_bitrate() -> None:
    text = explain(bus("socketcan", "can0"), OSError(errno.ENETDOWN, "x"))
    assert "dbitrate 5000000 fd on" in text


def test_an_interface_that_python_can_does_not_have() -> None:
    with pytest.raises(
        BusError, match=r"cannot open carrier_pigeon coop: .*use an interface that python-can"
    ):
        open_bus(bus("carrier_pigeon", "coop"))


def test_an_option_that_the_interface_does_not_take() -> None:
    with pytest.raises(BusError, match=r"cannot open udp_multicast 239\.74\.163\.2: "):
        open_bus(bus("udp_multicast", "239.74.163.2", receive_own_messages=True))


def test_the_number_of_an_error_is_found_behind_python_can() -> None:
    assert error_number(can.CanOperationError("gone", errno.ENETDOWN)) == errno.ENETDOWN
    assert error_number(OSError(errno.ENODEV, "x")) == errno.ENODEV
    wrapped = can.CanOperationError("wrapped")
    wrapped.__cause__ = OSError(errno.ENOBUFS, "x")
    assert error_number(wrapped) == errno.ENOBUFS
    assert error_number(ValueError("none")) is None


def test_virtual_has_nothing_to_watch() -> None:
    opened = open_bus(bus("virtual", "interface-test"))
    try:
        assert descriptor(opened) is None
    finally:
        opened.shutdown()


def test_a_bus_that_stays_on_the_host_uses_loopback_and_a_large_buffer() -> None:
    opened = open_bus(GROUP.model_copy(update={"options": {"hop_limit": 0, "port": 0}}))
    try:
        number = descriptor(opened)
        assert number is not None
        with socket.socket(fileno=os.dup(number)) as wire:
            sender = wire.getsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, 4)
            assert socket.inet_ntoa(sender) == "127.0.0.1"
            # the kernel doubles what it grants, and grants no more than net.core.rmem_max
            granted = wire.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF)
            most = int(Path("/proc/sys/net/core/rmem_max").read_text("ascii"))
            assert granted == 2 * min(RECEIVE_BUFFER_BYTES, most)
    finally:
        opened.shutdown()


@pytest.mark.parametrize(("mtu", "fits"), [("16\n", False), ("72\n", True), (None, True), ("odd", True)])
def test_a_classic_interface_cannot_carry_can_fd(tmp_path: Path, mtu: str | None, fits: bool) -> None:
    (tmp_path / "can0").mkdir()
    if mtu is not None:
        (tmp_path / "can0" / "mtu").write_text(mtu)
    config = BusConfig(name="suit", interface="socketcan", channel="can0", fd=True)
    with can.Bus(interface="virtual", channel="no matter") as bus:
        said = carries_classic_only(config, bus, tmp_path)
    assert bool(said) is not fits
    assert fits or "fd on`" in said


def test_an_adapter_that_says_it_carries_classic_can_alone_is_refused() -> None:
    with can.Bus(interface="virtual", channel="no matter", protocol=can.CanProtocol.CAN_20) as bus:
        for interface, refused in (("slcan", True), ("virtual", False)):
            config = BusConfig(name="suit", interface=interface, channel="x", fd=True)
            assert bool(carries_classic_only(config, bus)) == refused
