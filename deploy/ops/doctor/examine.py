"""All checks of a host, in the order of the report: facts are read, then judged. Open this file first."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from common.errors import LinkError
from common.wire.version import software
from deploy.client.efforts import without_detection
from deploy.ops.doctor.judge.access import judge_access
from deploy.ops.doctor.judge.can import judge_buses, judge_interfaces
from deploy.ops.doctor.judge.devices import is_url, judge_camera, judge_latency, judge_port
from deploy.ops.doctor.judge.endpoints import judge_endpoint
from deploy.ops.doctor.judge.finding import Finding, fail, ok, warn
from deploy.ops.doctor.judge.keys import judge_keys
from deploy.ops.doctor.judge.machine import (
    judge_clock,
    judge_disk,
    judge_machine,
    judge_receive_buffer,
    judge_services,
    judge_tcp,
)
from deploy.ops.doctor.judge.needs import GENERAL, Needs
from deploy.ops.doctor.judge.path import judge_path
from deploy.ops.doctor.judge.process import judge_memory_lock, judge_networks, judge_realtime
from deploy.ops.doctor.judge.robots import judge_robot
from deploy.ops.doctor.judge.stops import judge_stops
from deploy.ops.doctor.judge.switches import judge_switch
from deploy.ops.doctor.read.can import ask_ip, read_can
from deploy.ops.doctor.read.clock import clock_is_synchronised, read_services
from deploy.ops.doctor.read.devices import egl_is_there, free_bytes, read_device, v4l2_is_there
from deploy.ops.doctor.read.endpoints import knock, try_to_listen
from deploy.ops.doctor.read.keys import read_keys
from deploy.ops.doctor.read.machine import read_machine
from deploy.ops.doctor.read.path import read_path
from deploy.ops.doctor.read.process import read_process
from deploy.ops.doctor.read.revoked import read_revoked
from deploy.ops.doctor.read.robots import read_robots
from deploy.ops.doctor.read.servos import ping_servos
from deploy.ops.doctor.read.stops import read_stops
from deploy.ops.doctor.read.switches import read_pedal
from deploy.ops.doctor.read.tree import Tree
from master.deadman.config import Pedal
from slave.servos.dynamixel.port import Port

NOBODY_NEAR = "nobody stands within reach of these joints, or drives that tell their torque"

HELD_THERE = "the joint is held there mechanically; the guard counts on that angle"


@dataclass(frozen=True, slots=True)
class Options:
    """What a person asked for beside the file."""

    recordings: Path = Path()
    """Folder for recordings; its free space is checked."""
    reach: bool = True
    """Whether to ask the other hosts."""


async def examine(needs: Needs, options: Options, tree: Tree) -> list[Finding]:
    """Every finding; at most some seconds, most of them for robots that do not answer."""
    found = [_software(), *host(needs, options, tree), *devices(needs, tree), *keys(needs)]
    if needs.servos is not None and read_device(tree, needs.servos.port).usable:
        port = Port if options.reach else None
        pinged = await asyncio.to_thread(ping_servos, needs.servos, tree, port)
        found.append(judge_latency(pinged, needs.servos.reply_timeout_s))
    found += [warn("contact", line, NOBODY_NEAR) for line in without_detection(needs.no_effort)]
    found += [warn("servos", f"{joint} {why}", HELD_THERE) for joint, why in needs.not_driven.items()]
    for name, switch in needs.switches.items():
        pedal = read_pedal(switch) if isinstance(switch, Pedal) else None
        found.append(judge_switch(name, switch, pedal))
    if needs.estop is not None:
        found += judge_stops(read_stops(needs.estop), not needs.simulated, needs.reset_key)
    found += [judge_endpoint(try_to_listen(endpoint)) for endpoint in needs.link.all_listen]
    if options.reach:
        found += await others(needs)
    return found


def host(needs: Needs, options: Options, tree: Tree) -> list[Finding]:
    """The machine and what the process may do on it."""
    machine, process = read_machine(tree), read_process(tree)
    return [
        *judge_machine(machine),
        judge_realtime(needs.realtime_priority, process),
        judge_memory_lock(needs.realtime_priority, process, machine.swap_bytes),
        *judge_receive_buffer(needs.buses, machine),
        *judge_tcp(machine),
        judge_clock(clock_is_synchronised()),
        *judge_services(read_services(needs.clock)),
        judge_disk(str(options.recordings.absolute()), free_bytes(options.recordings)),
        *([judge_networks(process)] if needs.role == GENERAL else []),
    ]


def devices(needs: Needs, tree: Tree) -> list[Finding]:
    """Buses, serial ports, cameras."""
    ports = {port: None if is_url(port) else read_device(tree, port) for port in needs.serial_ports}
    cameras = [("", needs.camera, needs.camera_device), *needs.other_cameras]
    interfaces = read_can(tree, ask_ip())
    return [
        *(judge_interfaces(interfaces) if needs.role == GENERAL else judge_buses(needs.buses, interfaces)),
        *(judge_port(port, device) for port, device in ports.items()),
        *(
            judge_camera(source, read_device(tree, device), egl_is_there(), v4l2_is_there(), name)
            for name, source, device in cameras
            if needs.role == "slave"
        ),
    ]


def keys(needs: Needs) -> list[Finding]:
    """Check the link's keys; no finding if no file configures a link."""
    if needs.role in (GENERAL, "suit"):
        return []
    tls, listed = needs.link.tls, needs.link.revoked
    if tls is None:
        return judge_keys(needs, None)
    facts = read_keys(tls, datetime.now(UTC))
    found = judge_keys(needs, facts)
    if not facts.trouble:
        found += judge_access(needs, facts.common_name, None if listed is None else read_revoked(listed))
    return found


async def others(needs: Needs) -> Sequence[Finding]:
    """Whom this host connects to, and the robots that it commands."""
    knocked = await asyncio.gather(*(knock(endpoint) for endpoint in needs.link.all_connect))
    found = [judge_endpoint(facts) for facts in knocked]
    if not needs.robots:
        return found
    try:
        robots = await read_robots(needs.link, needs.robots, needs.operator, needs.clock)
    except LinkError as error:
        return [*found, fail("link", str(error), "mend [link] first")]
    found += [finding for facts in robots for finding in judge_robot(facts, software())]
    reach = needs.link.model_copy(update={"listen": [], "twin": None, "access": None, "revoked": None})
    for facts in robots:
        if facts.guard:
            found += judge_path(await read_path(reach, facts.name))
    return found


def _software() -> Finding:
    ours = software()
    words = f"tandem {ours.tandem}, schema {ours.schema}, Zenoh {ours.zenoh}, Python {ours.python}"
    return ok("software", words)
