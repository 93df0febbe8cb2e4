"""Open a python-can interface, set its socket up, and say in plain words why it could not be opened."""

from __future__ import annotations

import errno
import logging
import os
import socket
from pathlib import Path

import can

from common.can.config import BusConfig
from common.errors import BusError

FD_MTU = 72
"""Room for a frame of an interface that carries CAN FD (linux/can.h, CANFD_MTU); classic CAN has 16."""
_SYSFS = Path("/sys/class/net")
_CLASSIC_ADAPTERS = frozenset(
    {"canalystii", "gs_usb", "robotell", "seeedstudio", "serial", "slcan", "usb2can"}
)
"""Interfaces that take `fd` without a word and say of themselves that they carry CAN 2.0."""
RECEIVE_BUFFER_BYTES = 1 << 20
"""Some 4000 waiting udp_multicast frames: half a second of 36 nodes."""
_LOOPBACK = "127.0.0.1"
_IP_MULTICAST_ALL = getattr(socket, "IP_MULTICAST_ALL", 49)
_SO_BINDTODEVICE = getattr(socket, "SO_BINDTODEVICE", 25)

log = logging.getLogger(__name__)


def open_bus(config: BusConfig) -> can.BusABC:
    """An open python-can bus. Raises BusError: which bus, why not, and what to do."""
    options: dict[str, object] = {"fd": config.fd, **config.options}
    try:
        # ignore_config: only tandem's TOML says what is opened, no ~/.canrc or CAN_CONFIG
        bus = can.Bus(
            channel=config.channel,
            interface=config.interface,
            config_context=None,
            ignore_config=True,
            **options,
        )
    except Exception as error:  # a driver may raise what it likes, of any library it is made with
        raise BusError(explain(config, error)) from error
    try:
        _set_up_socket(config, bus)
    except OSError as error:
        bus.shutdown()
        raise BusError(explain(config, error)) from error
    classic = config.fd and carries_classic_only(config, bus)
    if classic:
        bus.shutdown()
        raise BusError(f"bus {config.name}: {classic}")
    return bus


def carries_classic_only(config: BusConfig, bus: can.BusABC, sysfs: Path = _SYSFS) -> str:
    """Why a bus that is to carry CAN FD cannot, and what to do; empty if it can, or if that is not known."""
    otherwise = "or set fd = false, if the nodes use classic CAN"
    if config.interface == "socketcan":
        try:
            room = int((sysfs / config.channel / "mtu").read_text())
        except (OSError, ValueError):
            return ""
        if room >= FD_MTU:
            return ""
        setting = "type can bitrate 1000000 dbitrate 5000000 fd on"
        return (
            f"{config.channel} carries classic CAN only (MTU {room}) and the file says fd = true: every "
            f"answer would be lost; set it up with `ip link set {config.channel} {setting}`, {otherwise}"
        )
    protocol = getattr(bus, "protocol", None)
    if config.interface in _CLASSIC_ADAPTERS and protocol is can.CanProtocol.CAN_20:
        return (
            f"python-can's {config.interface} carries classic CAN only and the file says fd = true: every "
            f"answer would be lost; use another adapter, {otherwise}"
        )
    return ""


def descriptor(bus: can.BusABC) -> int | None:
    """What an event loop can watch, or None where the interface has no such thing."""
    try:
        number = bus.fileno()
    except NotImplementedError:  # python-can's word for an interface without a descriptor
        return None
    return number if number >= 0 else None


def _set_up_socket(config: BusConfig, bus: can.BusABC) -> None:
    number = descriptor(bus)
    if number is None:
        return
    try:
        # python-can keeps its socket to itself: a second handle reaches the same one
        wire = socket.socket(fileno=os.dup(number))
    except OSError as error:
        if error.errno == errno.ENOTSOCK:  # a serial adapter
            return
        raise
    with wire:
        wire.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
        if config.interface == "udp_multicast" and ":" not in config.channel:
            # else Linux also hands it what comes for other groups at this port
            wire.setsockopt(socket.IPPROTO_IP, _IP_MULTICAST_ALL, 0)
        if stays_on_host(config):
            _keep_on_host(wire, config.channel)
        # a CAN socket can be bound to an interface that is down: only its pending error says so
        pending = wire.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
    if pending:
        raise OSError(pending, os.strerror(pending))


def stays_on_host(config: BusConfig) -> bool:
    """Whether the bus is a multicast group that nothing leaves: `hop_limit = 0`, IPv4."""
    return (
        config.interface == "udp_multicast"
        and config.options.get("hop_limit") == 0
        and ":" not in config.channel
    )


def _keep_on_host(wire: socket.socket, group: str) -> None:
    membership = socket.inet_aton(group) + socket.inet_aton(_LOOPBACK)
    try:
        wire.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
    except OSError as error:
        # python-can has joined where the route leads: on a host whose multicast stays on loopback, there
        if error.errno != errno.EADDRINUSE:
            raise
    wire.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton(_LOOPBACK))
    try:
        # the port is bound on every interface: without this, another host could send frames to it
        wire.setsockopt(socket.SOL_SOCKET, _SO_BINDTODEVICE, b"lo\0")
    except OSError as error:
        log.warning("multicast group %s also hears other hosts: %s", group, error.strerror)


def explain(config: BusConfig, error: BaseException) -> str:
    """One line: the bus, what failed, what to do about it, and the way without hardware."""
    reason = _reason(error)
    what = f"bus {config.name}: cannot open {config.interface} {config.channel}: {reason}"
    advice = _advice(config, error)
    peers = "tandem suit for the nodes, tandem drives for the robot's drives"
    simulated = f"without hardware, put this bus on udp_multicast and start its peers: {peers}"
    return f"{what}; " + "; ".join(filter(None, [advice, simulated]))


def error_number(error: BaseException) -> int | None:
    """The operating system's number behind a python-can error, where there is one."""
    code = getattr(error, "error_code", None)
    if code is None and isinstance(error, OSError):
        code = error.errno
    if code is None and error.__cause__ is not None:
        return error_number(error.__cause__)
    return code


def _reason(error: BaseException) -> str:
    number = error_number(error)
    if number is not None and number in errno.errorcode:
        return os.strerror(number)
    return " ".join(str(error).split()) or type(error).__name__


def _advice(config: BusConfig, error: BaseException) -> str:
    number = error_number(error) or 0
    channel = config.channel
    if isinstance(error, NotImplementedError):  # python-can's word for an interface that it does not know
        return "use an interface that python-can has, such as socketcan or udp_multicast"
    if config.interface == "socketcan":
        bitrate = f"ip link set {channel} type can bitrate 1000000"
        if config.fd:
            bitrate += " dbitrate 5000000 fd on"
        by_number = {
            errno.ENODEV: "plug the adapter in and check its name with `ip link`",
            errno.ENETDOWN: f"bring it up: `{bitrate}`, then `ip link set {channel} up`",
            errno.EAFNOSUPPORT: "this kernel has no SocketCAN",
        }
        return by_number.get(number, "")
    if config.interface == "udp_multicast":
        by_number = {
            errno.ENODEV: "give multicast a route: `ip route add 239.0.0.0/8 dev lo`",
            errno.ENETUNREACH: "give multicast a route: `ip route add 239.0.0.0/8 dev lo`",
            errno.EINVAL: "its channel must be a multicast group, such as 239.74.163.2",
        }
        return by_number.get(number, "")
    return ""
