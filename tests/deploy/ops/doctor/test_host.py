"""A made-up host, read and judged: every check well and not well, and at its boundary."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from common.can.config import BusConfig
from common.can.interface import RECEIVE_BUFFER_BYTES
from deploy.ops.doctor.judge.can import BUSY, judge_buses, judge_interfaces, share_of_time
from deploy.ops.doctor.judge.devices import judge_camera, judge_port
from deploy.ops.doctor.judge.finding import Health
from deploy.ops.doctor.judge.machine import (
    ENOUGH_MEMORY_BYTES,
    LITTLE_DISK_BYTES,
    NO_DISK_BYTES,
    judge_clock,
    judge_disk,
    judge_machine,
    judge_receive_buffer,
)
from deploy.ops.doctor.judge.needs import BusNeed, CameraNeed
from deploy.ops.doctor.judge.process import judge_memory_lock, judge_networks, judge_realtime
from deploy.ops.doctor.read.can import ask_ip, read_can
from deploy.ops.doctor.read.clock import clock_is_synchronised
from deploy.ops.doctor.read.devices import Device, free_bytes, read_device
from deploy.ops.doctor.read.machine import read_machine
from deploy.ops.doctor.read.process import read_process
from deploy.ops.doctor.read.tree import Tree

LIMITS = """Limit                     Soft Limit           Hard Limit           Units
Max locked memory         {memlock}                 {memlock}                 bytes
Max realtime priority     {priority}                    {priority}
"""
CAN0 = {
    "ifname": "can0",
    "linkinfo": {
        "info_kind": "can",
        "info_data": {
            "state": "ERROR-ACTIVE",
            "bittiming": {"bitrate": 1_000_000},
            "data_bittiming": {"bitrate": 5_000_000},
        },
    },
}


class Host:
    """A tree that a test fills with what a host would show."""

    def __init__(self, root: Path) -> None:
        self.tree = Tree(root)

    def put(self, path: str, text: object) -> Host:
        file = self.tree.at(path)
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(f"{text}\n", "utf-8")
        return self

    def interface(self, name: str = "can0", flags: int = 0x41, mtu: int = 72, kind: int = 280) -> Host:
        for file, value in (("flags", hex(flags)), ("mtu", mtu), ("type", kind)):
            self.put(f"/sys/class/net/{name}/{file}", value)
        return self

    def process(self, priority: object = 0, capabilities: int = 0, memlock: object = 65536) -> Host:
        self.put("/proc/self/status", f"Name:\ttandem\nCapEff:\t{capabilities:016x}")
        return self.put("/proc/self/limits", LIMITS.format(priority=priority, memlock=memlock))


@pytest.fixture
def host(tmp_path: Path) -> Host:
    return Host(tmp_path)


def need(channel: str = "can0", fd: bool = True, nodes: int = 0, interface: str = "socketcan") -> BusNeed:
    return BusNeed(BusConfig(name="suit", interface=interface, channel=channel, fd=fd), nodes, 200.0)


def of_bus(host: Host, wanted: BusNeed, link: dict[str, object] | None = None) -> tuple[Health, str, str]:
    text = json.dumps([CAN0 if link is None else link])
    [finding] = judge_buses((wanted,), read_can(host.tree, text))
    return finding.health, finding.found, finding.advice


def test_a_bus_that_is_up_and_fast_enough_is_well(host: Host) -> None:
    health, found, _ = of_bus(host.interface(), need(nodes=36))
    assert health is Health.OK
    assert "CAN FD, 1 Mbit/s / 5 Mbit/s; 36 nodes take" in found


def test_an_interface_that_is_missing_names_those_that_are_there(host: Host) -> None:
    host.interface("can1").interface("eth0", mtu=1500, kind=1)
    health, found, advice = of_bus(host, need())
    assert (health, found) == (Health.FAIL, "no CAN interface can0 (there: can1)")
    assert "ip link" in advice


def test_one_that_is_down_is_brought_up_by_its_unit(host: Host) -> None:
    health, _, advice = of_bus(host.interface(flags=0x40), need())
    assert (health, advice) == (Health.FAIL, "systemctl enable --now tandem-can@can0")


def test_fd_is_asked_for_only_where_the_file_says_so(host: Host) -> None:
    host.interface(mtu=16)
    assert of_bus(host, need(fd=True))[0] is Health.FAIL
    assert of_bus(host, need(fd=False))[0] is Health.OK


@pytest.mark.parametrize(
    ("state", "health"),
    [("ERROR-ACTIVE", Health.OK), ("ERROR-PASSIVE", Health.WARN), ("BUS-OFF", Health.FAIL)],
)
def test_the_controller_s_own_state_counts(host: Host, state: str, health: Health) -> None:
    data = {**CAN0["linkinfo"]["info_data"], "state": state}  # type: ignore[index]
    assert of_bus(host.interface(), need(), {"ifname": "can0", "linkinfo": {"info_data": data}})[0] is health


def test_too_many_nodes_for_a_bus_are_told_before_they_are_late(host: Host) -> None:
    host.interface()
    one = share_of_time(need(nodes=1), 1_000_000, 5_000_000)
    fit, fill = int(BUSY / one), int(1.0 / one)
    assert 36 <= fit < fill  # the whole suit fits at 5 Mbit/s, as it does on the emulated bus
    assert of_bus(host, need(nodes=fit))[0] is Health.OK
    assert of_bus(host, need(nodes=fit + 1))[0] is Health.WARN
    assert of_bus(host, need(nodes=fill + 1))[0] is Health.FAIL


def test_classic_can_carries_eight_nodes_and_no_suit() -> None:
    assert share_of_time(need(fd=False, nodes=8), 1_000_000, 0) < BUSY
    assert share_of_time(need(fd=False, nodes=36), 1_000_000, 0) > 1.0


def test_bit_rates_that_cannot_be_asked_for_are_left_out(host: Host) -> None:
    [finding] = judge_buses((need(nodes=36),), read_can(host.interface().tree, None))
    assert (finding.health, finding.found) == (Health.OK, "can0 is up, CAN FD")
    assert read_can(host.tree, "no json")["can0"].bitrate == 0


def test_a_bus_that_is_no_interface_is_not_looked_for(host: Host) -> None:
    assert of_bus(host, need("239.74.163.2", interface="udp_multicast"))[0] is Health.OK


def test_without_a_file_what_there_is_is_listed(host: Host) -> None:
    assert [f.found for f in judge_interfaces({})] == ["none"]
    host.interface("can0").interface("can1", flags=0, mtu=16)
    found = [f.found for f in judge_interfaces(read_can(host.tree, None))]
    assert found == ["can0 is up, CAN FD", "can1 is down"]


def test_ip_of_this_host_is_understood() -> None:
    text = ask_ip()
    if text is None:
        pytest.skip("no ip here: apt install iproute2")
    assert "lo" in [link["ifname"] for link in json.loads(text)]


@pytest.mark.parametrize(
    ("priority", "limit", "capabilities", "health"),
    [
        (20, 19, 0, Health.WARN),
        (20, 20, 0, Health.OK),
        (20, "unlimited", 0, Health.OK),
        (20, 0, 1 << 23, Health.OK),
        (20, 0, 1 << 22, Health.WARN),
        (0, 0, 0, Health.OK),
    ],
)
def test_a_priority_needs_the_limit_or_the_capability(
    host: Host, priority: int, limit: object, capabilities: int, health: Health
) -> None:
    facts = read_process(host.process(limit, capabilities).tree)
    finding = judge_realtime(priority, facts)
    assert finding.health is health
    assert ("rtprio 20" in finding.advice) == (health is Health.WARN)


def test_throttled_real_time_threads_are_told(host: Host) -> None:
    host.process(priority=50).put("/proc/sys/kernel/sched_rt_period_us", 1_000_000)
    for runtime_us, health in ((950_000, Health.OK), (-1, Health.OK), (500_000, Health.WARN)):
        host.put("/proc/sys/kernel/sched_rt_runtime_us", runtime_us)
        assert judge_realtime(20, read_process(host.tree)).health is health


def test_swap_is_told_where_nothing_is_locked(host: Host) -> None:
    facts = read_process(host.process(memlock=65536).tree)
    assert judge_memory_lock(0, facts, 0).health is Health.OK
    finding = judge_memory_lock(0, facts, 2 << 30)
    assert (finding.health, "2.0 GB" in finding.found) == (Health.WARN, True)


def test_with_a_priority_memory_needs_to_be_lockable_whole(host: Host) -> None:
    facts = read_process(host.process(memlock=65536).tree)
    finding = judge_memory_lock(20, facts, 0)
    assert (finding.health, "64 kB" in finding.found) == (Health.WARN, True)
    assert "LimitMEMLOCK" in finding.advice
    unlimited = read_process(host.process(memlock="unlimited").tree)
    assert judge_memory_lock(20, unlimited, 1).health is Health.OK
    capable = read_process(host.process(memlock=65536, capabilities=1 << 14).tree)
    assert judge_memory_lock(20, capable, 1).health is Health.OK


def test_trials_need_a_capability_and_a_device(host: Host) -> None:
    facts = read_process(host.process().tree)
    assert "no CAP_NET_ADMIN and no /dev/net/tun" in judge_networks(facts).found
    host.process(capabilities=1 << 12).put("/dev/net/tun", "")
    assert judge_networks(read_process(host.tree)).health is Health.OK


def well(host: Host) -> Host:
    for core in range(4):
        host.put(f"/sys/devices/system/cpu/cpu{core}/cpufreq/scaling_governor", "performance")
    host.put("/sys/devices/system/cpu/isolated", "2-3").put("/sys/devices/system/cpu/cpufreq/x", "")
    host.put("/proc/version", "Linux version 6.1 #1 SMP PREEMPT_RT Debian").put(
        "/proc/loadavg", "0.50 0.4 0.3"
    )
    host.put("/proc/meminfo", "MemTotal: 8000000 kB\nMemAvailable: 4000000 kB\nSwapTotal: 0 kB")
    return host.put("/proc/sys/net/core/rmem_max", RECEIVE_BUFFER_BYTES)


def healths(host: Host) -> dict[str, Health]:
    return {finding.check: finding.health for finding in judge_machine(read_machine(host.tree))}


def test_a_machine_that_is_well(host: Host) -> None:
    facts = read_machine(well(host).tree)
    assert (facts.cores, facts.isolated, facts.preemption) == (4, "2-3", "rt")
    assert set(healths(host).values()) == {Health.OK}


@pytest.mark.parametrize(
    ("path", "text", "check", "health"),
    [
        ("/sys/devices/system/cpu/cpu3/cpufreq/scaling_governor", "powersave", "CPU governor", Health.WARN),
        ("/proc/loadavg", "4.00 1 1", "load", Health.OK),
        ("/proc/loadavg", "4.01 1 1", "load", Health.WARN),
        ("/proc/meminfo", f"MemAvailable: {ENOUGH_MEMORY_BYTES // 1024} kB", "memory", Health.OK),
        ("/proc/meminfo", f"MemAvailable: {ENOUGH_MEMORY_BYTES // 1024 - 1} kB", "memory", Health.FAIL),
    ],
)
def test_what_ails_a_machine(host: Host, path: str, text: str, check: str, health: Health) -> None:
    well(host).put(path, text)
    assert healths(host)[check] is health


def test_one_core_is_few(host: Host) -> None:
    host.put("/sys/devices/system/cpu/cpu0/online", 1)
    assert healths(host)["cores"] is Health.WARN


@pytest.mark.parametrize(
    ("version", "kind"),
    [
        ("Linux version 6.12 #1 SMP PREEMPT_DYNAMIC", "dynamic"),
        ("Linux version 6.12 #1 SMP PREEMPT_RT", "rt"),
        ("Linux version 5.10 #1 SMP PREEMPT", "full"),
        ("Linux version 4.19 #1 SMP", ""),
    ],
)
def test_how_a_kernel_gives_way(host: Host, version: str, kind: str) -> None:
    assert read_machine(host.put("/proc/version", version).tree).preemption == kind


def test_the_socket_buffer_matters_to_multicast_alone(host: Host) -> None:
    multicast = (need("239.74.163.2", interface="udp_multicast"),)
    facts = read_machine(well(host).tree)
    assert [f.health for f in judge_receive_buffer(multicast, facts)] == [Health.OK]
    small = read_machine(host.put("/proc/sys/net/core/rmem_max", RECEIVE_BUFFER_BYTES - 1).tree)
    assert [f.health for f in judge_receive_buffer(multicast, small)] == [Health.WARN]
    assert judge_receive_buffer((need(),), small) == []


def test_an_empty_tree_is_read_without_an_error(host: Host) -> None:
    assert read_machine(host.tree).cores == 0
    assert not read_process(host.tree).may(12)
    assert read_can(host.tree, None) == {}


@pytest.mark.parametrize(
    ("free", "health"),
    [
        (LITTLE_DISK_BYTES, Health.OK),
        (LITTLE_DISK_BYTES - 1, Health.WARN),
        (NO_DISK_BYTES, Health.WARN),
        (NO_DISK_BYTES - 1, Health.FAIL),
        (None, Health.WARN),
    ],
)
def test_room_for_recordings(free: int | None, health: Health) -> None:
    assert judge_disk("/var/lib/tandem", free).health is health


def test_the_disk_of_a_folder_that_is_not_there(tmp_path: Path) -> None:
    assert free_bytes(tmp_path / "none") is None
    assert (free_bytes(tmp_path) or 0) > 0


def test_the_date_is_for_people() -> None:
    assert clock_is_synchronised() in (True, False, None)
    assert [judge_clock(state).health for state in (True, False, None)] == [
        Health.OK,
        Health.WARN,
        Health.OK,
    ]


def test_a_serial_port_is_there_usable_or_a_url(host: Host) -> None:
    port = "/dev/ttyUSB0"
    assert judge_port(port, read_device(host.tree, port)).health is Health.FAIL
    host.put(port, "")
    assert judge_port(port, read_device(host.tree, port)).health is Health.OK
    assert "dialout" in judge_port(port, Device(port, there=True, usable=False)).advice
    assert judge_port("socket://10.0.0.7:4000", None).health is Health.OK


@pytest.mark.skipif(os.geteuid() == 0, reason="root may use every device")
def test_a_device_that_this_user_may_not_use(host: Host) -> None:
    host.put("/dev/video0", "").tree.at("/dev/video0").chmod(0)
    assert not read_device(host.tree, "/dev/video0").usable


def test_a_camera_is_never_fatal(host: Host) -> None:
    there, missing = Device("/dev/video0", True, True), Device("/dev/video0", False, False)
    forbidden = Device("/dev/video0", True, False)

    def health(source: CameraNeed, device: Device, egl: bool = True, v4l2: bool = True) -> Health:
        return judge_camera(source, device, egl, v4l2).health

    assert health(CameraNeed.OFF, missing, egl=False, v4l2=False) is Health.OK
    assert health(CameraNeed.DRAWN, missing) is Health.OK
    assert health(CameraNeed.DRAWN, missing, egl=False) is Health.WARN
    assert health(CameraNeed.V4L2, there) is Health.OK
    assert health(CameraNeed.V4L2, there, v4l2=False) is Health.WARN
    assert health(CameraNeed.V4L2, missing) is health(CameraNeed.V4L2, forbidden) is Health.WARN
