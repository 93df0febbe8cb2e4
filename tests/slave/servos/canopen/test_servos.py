"""The adapter on real buses: drives in a thread (virtual, udp_multicast), or in a process."""

from __future__ import annotations

import asyncio
import itertools
import logging
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import can
import canopen
import numpy as np
import pytest
import uvloop

from common.can.config import BusConfig
from common.can.interface import open_bus
from common.clock import to_ns
from common.errors import BusError, RobotError
from common.link.config import LinkConfig
from common.skeleton import load_skeleton
from deploy.harness.host import HostWatch
from deploy.sim.drives.app import run as run_drives
from deploy.sim.drives.faults import DEMAND, DriveFault
from deploy.sim.drives.wire import EDS
from slave.backends import ServosConfig
from slave.config import SlaveConfig
from slave.encoders.counts import EncoderConfig, Encoders
from slave.servos.canopen.config import CanopenConfig
from slave.servos.canopen.servos import CanopenServos
from slave.servos.contract import Subject, check

pytestmark = pytest.mark.live
NURSING = load_skeleton("nursing")
DEADLINE_S = 60.0
_number = itertools.count()


def virtual() -> list[BusConfig]:
    n = next(_number)
    return [
        BusConfig(name=name, interface="virtual", channel=f"drives-{n}-{name}", fd=False)
        for name in ("left", "right")
    ]


def udp_multicast() -> list[BusConfig]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("", 0))
        options: dict[str, str | int | float | bool] = {"port": free.getsockname()[1], "hop_limit": 0}
    groups = (("left", "239.74.163.31"), ("right", "239.74.163.32"))
    return [
        BusConfig(name=name, interface="udp_multicast", channel=group, fd=False, options=options)
        for name, group in groups
    ]


@pytest.fixture(params=[virtual, udp_multicast])
def config(request: pytest.FixtureRequest) -> CanopenConfig:
    # generous times: the machine may be busy; what is tested does not depend on them
    return CanopenConfig(
        buses=request.param(), dead_ms=3000, drive_dead_ms=5000, start_timeout_s=30.0, join_deg_s=60.0
    )


class Heard(logging.Handler):
    """Waits until the drives say that they are there."""

    def __init__(self) -> None:
        super().__init__()
        self.ready = threading.Event()

    def emit(self, record: logging.LogRecord) -> None:
        if "drives on" in record.getMessage():
            self.ready.set()


@contextmanager
def drives_on(config: CanopenConfig, folder: Path) -> Iterator[None]:
    """The simulated drives: in a thread on `virtual`, which ends at the process, else in a process."""
    if config.buses[0].interface == "virtual":
        with drives_thread(config):
            yield
    else:
        file = folder / "slave.toml"
        file.write_text(as_toml(config), "utf-8")
        with drives_process(file):
            yield


def as_toml(config: CanopenConfig) -> str:
    """A slave's file with these buses and times."""
    buses = "".join(
        f'[[servos.canopen.buses]]\nname = "{bus.name}"\ninterface = "udp_multicast"\n'
        f'channel = "{bus.channel}"\nfd = false\n'
        f"options = {{ port = {bus.options['port']}, hop_limit = 0 }}\n"
        for bus in config.buses
    )
    return (
        'robot = "robot-1"\n[link]\n[servos]\nbackend = "canopen"\n[servos.canopen]\n'
        f"dead_ms = {config.dead_ms}\ndrive_dead_ms = {config.drive_dead_ms}\n"
        f"start_timeout_s = {config.start_timeout_s}\n{buses}"
    )


@contextmanager
def drives_process(file: Path) -> Iterator[None]:
    drives = subprocess.Popen([sys.executable, "-m", "deploy", "drives", str(file)], stderr=subprocess.PIPE)
    assert drives.stderr is not None
    # read on, or what it logs would fill the pipe and stop it
    reading = threading.Thread(target=drives.stderr.read)
    try:
        while b"25 drives on" not in drives.stderr.readline():
            assert drives.poll() is None
        reading.start()
        yield
    finally:
        drives.terminate()
        try:
            drives.wait(30)
        except subprocess.TimeoutExpired:
            drives.kill()
            drives.wait()
        if reading.ident is not None:
            reading.join()
        drives.stderr.close()


@contextmanager
def drives_thread(config: CanopenConfig) -> Iterator[None]:
    interval = sys.getswitchinterval()
    sys.setswitchinterval(0.0005)  # as a process of tandem has it
    slave = SlaveConfig(
        robot="robot-1", link=LinkConfig(), servos=ServosConfig(backend="canopen", canopen=config)
    )
    loop, stop = uvloop.new_event_loop(), asyncio.Event()
    thread = threading.Thread(target=lambda: loop.run_until_complete(run_drives(slave, stop)))
    log, heard = logging.getLogger("deploy.sim.drives.app"), Heard()
    log.addHandler(heard)
    level = log.level
    log.setLevel(logging.INFO)
    thread.start()
    try:
        assert heard.ready.wait(DEADLINE_S)
        log.removeHandler(heard)
        log.setLevel(level)
        yield
    finally:
        loop.call_soon_threadsafe(stop.set)
        thread.join()
        loop.close()
        sys.setswitchinterval(interval)


class Ticking:
    """What the slave does with its servos, as fast as the loop goes."""

    def __init__(self, servos: CanopenServos) -> None:
        self.servos = servos
        self.encoders = Encoders(NURSING)
        self.setpoint = np.clip(np.zeros(25), NURSING.lower_rad, NURSING.upper_rad)

    async def until(self, condition: Callable[[], bool]) -> None:
        deadline_s = time.monotonic() + DEADLINE_S
        while not condition():
            assert time.monotonic() < deadline_s, (dict(self.servos.faults()), self.servos.metrics())
            self.servos.read()
            self.servos.write(self.setpoint)
            await asyncio.sleep(0.005)

    def near(self) -> bool:
        reading = self.servos.read()
        off = np.abs(self.encoders.position_rad(reading.counts) - self.setpoint)
        return bool(reading.valid.all() and off.max() < 0.006)


def test_they_keep_the_contract_of_all_backends(config: CanopenConfig, tmp_path: Path) -> None:
    async def test() -> None:
        pause = threading.Event()
        servos = ServosConfig(backend="canopen", canopen=config).open(NURSING, EncoderConfig())
        check(Subject(servos, NURSING, EncoderConfig(), lambda: bool(pause.wait(0.002))))

    with drives_on(config, tmp_path):
        uvloop.run(test())


def test_start_follow_quick_stop_fault_and_back(config: CanopenConfig, tmp_path: Path) -> None:
    async def test() -> None:
        servos = ServosConfig(backend="canopen", canopen=config).open(NURSING, EncoderConfig())
        assert isinstance(servos, CanopenServos)
        servos.start()
        try:
            ticking = Ticking(servos)
            await ticking.until(lambda: bool(servos.read().valid.all()))
            assert dict(servos.faults()) == {}
            ticking.setpoint = np.clip(np.full(25, 0.2), NURSING.lower_rad, NURSING.upper_rad)
            await ticking.until(ticking.near)

            servos.quick_stop(True)
            before = ticking.encoders.position_rad(servos.read().counts)
            ticking.setpoint = ticking.setpoint * 0.5
            syncs = servos.metrics().times_ms["sync_to_positions"].count
            await ticking.until(lambda: servos.metrics().times_ms["sync_to_positions"].count > syncs + 10)
            assert np.abs(ticking.encoders.position_rad(servos.read().counts) - before).max() < 0.05
            servos.quick_stop(False)
            await ticking.until(ticking.near)

            # a fault on demand, by a third party on the bus: SDO write of one byte to 2010h of node 1
            with can_bus(config) as bus:
                data = bytes([0x2F, DEMAND & 0xFF, DEMAND >> 8, 0, DriveFault.OVER_CURRENT, 0, 0, 0])
                bus.send(can.Message(arbitration_id=0x601, is_extended_id=False, data=data))
                await ticking.until(lambda: "neck_yaw" in servos.faults())
                await ticking.until(lambda: "over-current" in servos.faults()["neck_yaw"])
            # and whoever asks drives for something is a second master: until it has gone, no reset helps
            assert "a second master is on bus left: SDO requests to node 1" in servos.faults()["neck_yaw"]

            def well_after_a_reset() -> bool:
                if any("second master" in words for words in servos.faults().values()):
                    servos.quick_stop(True)
                    servos.quick_stop(False)
                return not servos.faults()

            await ticking.until(well_after_a_reset)
            await ticking.until(ticking.near)
        finally:
            servos.stop()
            servos.stop()

    with drives_on(config, tmp_path):
        uvloop.run(test())


@contextmanager
def can_bus(config: CanopenConfig) -> Iterator[can.BusABC]:
    bus = open_bus(config.buses[0])
    try:
        yield bus
    finally:
        bus.shutdown()


def test_a_second_start_takes_over_drives_that_hold(config: CanopenConfig, tmp_path: Path) -> None:
    async def test() -> None:
        for _ in range(2):
            servos = CanopenServos(config, NURSING)
            servos.start()
            with pytest.raises(RobotError, match="run already"):
                servos.start()
            ticking = Ticking(servos)
            await ticking.until(ticking.near)
            servos.stop()

    with drives_on(config, tmp_path):
        uvloop.run(test())


def test_a_second_slave_is_refused_and_the_first_does_not_notice(
    config: CanopenConfig, tmp_path: Path
) -> None:
    async def test() -> None:
        servos = CanopenServos(config, NURSING)
        servos.start()
        ticking = Ticking(servos)
        await ticking.until(ticking.near)
        loop = asyncio.get_running_loop()

        def second() -> str:
            async def start() -> str:
                with pytest.raises(RobotError, match="second master") as raised:
                    CanopenServos(config, NURSING).start()
                return str(raised.value)

            return asyncio.run(start())

        refused = loop.run_in_executor(None, second)
        await ticking.until(refused.done)
        assert "nothing has been sent to the drives" in await refused
        assert "SYNC" in await refused
        assert dict(servos.faults()) == {}
        assert servos._drives.second_master.frames == 0
        servos.stop()

    with drives_on(config, tmp_path):
        uvloop.run(test())


def test_a_start_without_torque_begins_stopped_and_a_reset_enables(
    config: CanopenConfig, tmp_path: Path
) -> None:
    """Safe torque off at the start, as a safety controller has it until it is released, is no failure."""

    def demand(bus: can.BusABC, fault: DriveFault) -> None:
        data = bytes([0x2F, DEMAND & 0xFF, DEMAND >> 8, 0, fault, 0, 0, 0])
        bus.send(can.Message(arbitration_id=0x601, is_extended_id=False, data=data))

    async def test() -> None:
        servos = CanopenServos(config, NURSING)
        with can_bus(config) as bus:
            demand(bus, DriveFault.STO)
            servos.start()
            try:
                assert not servos.signs("neck_yaw").voltage
                assert "cannot be enabled" in servos.faults()["neck_yaw"]
                demand(bus, DriveFault.NONE)
                ticking = Ticking(servos)

                def well_after_a_reset() -> bool:
                    words = " ".join(servos.faults().values())
                    if "cannot be enabled" in words or "second master" in words:
                        servos.quick_stop(True)
                        servos.quick_stop(False)
                    return not servos.faults()

                await ticking.until(well_after_a_reset)
                await ticking.until(ticking.near)
                assert servos.signs("neck_yaw").voltage
            finally:
                servos.stop()

    with drives_on(config, tmp_path):
        uvloop.run(test())


def test_without_drives_the_start_says_what_to_do(config: CanopenConfig, tmp_path: Path) -> None:
    async def test() -> None:
        with pytest.raises(RobotError, match=r"25 of 25 drives do not start: .*start `tandem drives`"):
            CanopenServos(config.model_copy(update={"start_timeout_s": 0.5}), NURSING).start()

    uvloop.run(test())


def test_a_bus_that_cannot_be_opened_is_told() -> None:
    config = CanopenConfig(buses=[BusConfig(name="left", interface="nothing", channel="x")])

    async def test() -> None:
        with pytest.raises(BusError, match="bus left: cannot open nothing x"):
            CanopenServos(config, NURSING).start()

    uvloop.run(test())


@pytest.mark.parametrize("setpoint", [np.zeros(24), np.full(25, np.nan)])
def test_a_setpoint_that_is_none_is_refused(setpoint: np.ndarray) -> None:
    with pytest.raises(ValueError, match="25 finite angles"):
        CanopenServos(CanopenConfig(), NURSING).write(setpoint)


def test_the_library_s_master_finds_a_cia_402_drive(config: CanopenConfig, tmp_path: Path) -> None:
    """The `canopen` library, which knows nothing of this code, drives node 2 through its states by SDO."""
    with drives_on(config, tmp_path), can_bus(config) as bus:
        drives = canopen.Network(bus)
        drives.connect()
        try:
            node = drives.add_node(2, str(EDS))
            node.sdo.RESPONSE_TIMEOUT = 10.0
            assert node.sdo[0x1000].raw & 0xFFFF == 402
            assert node.sdo[0x1008].raw == "tandem simulated CiA 402 drive"  # segmented
            node.sdo[0x1017].raw = 50
            node.nmt.wait_for_heartbeat(10.0)
            assert node.nmt.state == "PRE-OPERATIONAL"
            node.nmt.state = "OPERATIONAL"
            with pytest.raises(canopen.SdoAbortedError):
                node.sdo[0x6041].raw = 1
            node.sdo[0x6060].raw = 8
            seen = []
            for controlword in (0x06, 0x07, 0x0F, 0x02, 0x0F):
                node.sdo[0x6040].raw = controlword
                seen.append(node.sdo[0x6041].raw & 0x6F)
            assert seen == [0x21, 0x23, 0x27, 0x07, 0x27]
            heard = threading.Event()
            node.emcy.add_callback(lambda _: heard.set())
            node.sdo[DEMAND].raw = DriveFault.OVER_TEMPERATURE
            assert heard.wait(10.0)
            assert [emergency.code for emergency in node.emcy.log] == [0x4310]
            assert node.sdo[0x1001].raw == 0x09
        finally:
            drives.bus = None
            assert drives.notifier is not None
            drives.notifier.stop()


SLAVE = """
import asyncio, sys, uvloop
import numpy as np
from pathlib import Path
from common.config.load import load_config
from common.skeleton import load_skeleton
from deploy.harness.host import HostWatch
from slave.config import SlaveConfig
from slave.servos.canopen.servos import CanopenServos
config = load_config(Path(sys.argv[1]), SlaveConfig)
skeleton = load_skeleton("nursing")
async def main():
    servos = CanopenServos(config.servos.canopen, skeleton)
    servos.start()
    setpoint, up = np.zeros(25), 1.0
    while True:
        servos.read()
        # at the hands, where nothing is heavy: back and forth at 1 rad/s
        setpoint[-5:] = np.clip(setpoint[-5:] + up * 0.005, 0.0, 1.2)
        up = -up if setpoint[-1] in (0.0, 1.2) else up
        servos.write(np.clip(setpoint, skeleton.lower_rad, skeleton.upper_rad))
        if not servos.faults():
            print("moves", flush=True)
        await asyncio.sleep(0.005)
uvloop.run(main())
"""


@pytest.mark.timeout(400)
def test_kill_9_of_the_slave_and_the_drives_stop_by_themselves(
    tmp_path: Path, on_this_host: Callable[[Callable[[HostWatch], Awaitable[None]]], None]
) -> None:
    dead_s = 0.5

    async def story(host: HostWatch) -> None:
        killed_ns, moved_until_ns, states = await asyncio.to_thread(kill_9, tmp_path, dead_s)
        await host.known(moved_until_ns)
        # the ramp and the motor's lag take less than 0.2 s
        within_s = dead_s + 0.2 + host.lost(killed_ns, moved_until_ns).excused_s
        assert killed_ns < moved_until_ns < killed_ns + to_ns(within_s)
        assert states == {0x07}

    on_this_host(story)


def kill_9(tmp_path: Path, dead_s: float) -> tuple[int, int, set[int]]:
    """When the slave was killed, until when the drives moved on, and the states they ended in."""
    buses = udp_multicast()
    config = CanopenConfig(buses=buses, dead_ms=500, start_timeout_s=30.0, drive_dead_ms=5000)
    file = tmp_path / "slave.toml"
    file.write_text(as_toml(config), "utf-8")
    with drives_process(file):
        slave = subprocess.Popen([sys.executable, "-c", SLAVE, str(file)], stdout=subprocess.PIPE)
        assert slave.stdout is not None
        try:
            for _ in range(200):
                assert slave.stdout.readline() == b"moves\n"
        finally:
            slave.kill()
        killed_s = time.monotonic()
        slave.wait()
        slave.stdout.close()
        moved_until_s, states = watch_encoders(buses[1], killed_s + dead_s + 1.0)
    return to_ns(killed_s), to_ns(moved_until_s), states


def watch_encoders(config: BusConfig, until_s: float) -> tuple[float, set[int]]:
    """When any encoder on a bus last moved by more than two counts, and the drives' last states.

    The watcher sends SYNC, and nothing that could move a drive or keep it alive.
    """
    bus = open_bus(config)
    counts: dict[int, int] = {}
    states: dict[int, int] = {}
    moved_s = 0.0
    due_s = time.monotonic()
    while (now_s := time.monotonic()) < until_s:
        if now_s >= due_s:
            due_s += 0.02
            bus.send(can.Message(arbitration_id=0x80, is_extended_id=False))
        message = bus.recv(0.002)
        if message is None or message.arbitration_id & 0x780 != 0x180:
            continue
        word = int.from_bytes(message.data[2:4], "little")
        states[message.arbitration_id] = message.data[0] & 0x6F
        if abs(word - counts.get(message.arbitration_id, word + 9)) > 2:
            counts[message.arbitration_id] = word
            moved_s = now_s
    bus.shutdown()
    return moved_s, set(states.values())
