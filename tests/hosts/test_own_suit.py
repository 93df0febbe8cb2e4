"""docs/extending.md, *Own suit*, on a bus: `tandem suit check` hears the page's nodes, and what is wrong."""

from __future__ import annotations

import asyncio
import json
import re
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import can
import numpy as np
import pytest

from common.can.config import BusConfig
from common.can.interface import open_bus
from common.config.load import load_config
from common.quaternion import Array
from common.skeleton import load_skeleton
from deploy.harness.endpoints import free_port
from deploy.harness.host import HostWatch
from deploy.sim.suit.free_running import FreeNode, NodeClock, Reading, Sent, sent_by
from deploy.sim.suit.motion import load_motion
from deploy.sim.suit.sensors import IdealSensors, earth_field_ut
from master.capture.source import load_layouts
from master.config import MasterConfig

if TYPE_CHECKING:
    from tests.conftest import OnThisHost

pytestmark = [pytest.mark.live, pytest.mark.timeout(300)]
ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/extending.md").read_text("utf-8")
WANTED = ("own_suit/imu.dbc", "own_suit/master.toml", "common/skeleton/one_arm.toml")
GROUP, SECONDS = "239.74.163.2", 6.0
Wrong = Callable[[Array], Array]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """The page's own files, as its reader has them."""
    blocks = dict(re.findall(r"^```(?:toml|dbc)\n# ([^\n]+)\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL))
    for name in WANTED:
        (tmp_path / Path(name).name).write_text(blocks[name], "utf-8")
    load_skeleton.cache_clear()
    return tmp_path / "master.toml"


def bus_at(port: int) -> dict[str, object]:
    options = {"port": port, "hop_limit": 0}
    return {"name": "suit", "interface": "udp_multicast", "channel": GROUP, "fd": True, "options": options}


def overrides(file: Path, port: int) -> list[str]:
    """The page's bus is can0: here it is one between processes."""
    options = f"{{ port = {port}, hop_limit = 0 }}"
    keys = ", ".join(
        f"{key} = {json.dumps(value)}" for key, value in bus_at(port).items() if key != "options"
    )
    return [f'profile="{file.parent / "one_arm.toml"}"', f"capture.buses=[{{ {keys}, options = {options} }}]"]


def frames(config: MasterConfig, wrong: Wrong) -> list[Sent]:
    """What three nodes send that nobody moves; `wrong` changes the readings of the forearm's."""
    motion = load_motion("sweep", config.skeleton)
    sensors = IdealSensors(config.skeleton, earth_field_ut(50.0, 60.0))
    layout, random = load_layouts(config.nodes, config.suit)["imu"], np.random.default_rng(2)

    def reading(row: int, name: str) -> Reading:
        def read(time_s: float) -> tuple[Array, Array]:
            true = sensors.read(*motion.state(0.0))[row]
            noisy = true + np.repeat([0.04, 0.002, 0.3], 3) * random.normal(size=9)
            return (wrong(noisy) if name == "forearm" else noisy), np.array([1.0, 0.0, 0.0, 0.0])

        return read

    nodes = [
        FreeNode(layout, node.id, reading(row, name), NodeClock(100.0, 0.003 * row, 80.0 - 60.0 * row, 5.0))
        for row, (name, node) in enumerate(config.nodes.items())
    ]
    return list(sent_by({"suit": nodes}, SECONDS + 25.0, np.random.default_rng(1)))


@contextmanager
def sending(port: int, all_frames: list[Sent]) -> Iterator[None]:
    """The nodes, which nobody asks."""
    ended = threading.Event()

    def run() -> None:
        # as tandem opens it: a plain python-can bus would send by another interface than loopback
        with open_bus(BusConfig.model_validate(bus_at(port))) as bus:
            begun = time.monotonic()
            for sent in all_frames:
                if ended.wait(max(0.0, begun + sent.at_s - time.monotonic())):
                    return
                message = can.Message(
                    arbitration_id=sent.frame.id, data=sent.frame.data, is_extended_id=False
                )
                bus.send(message)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join(5.0)


async def checked(file: Path, wrong: Wrong) -> tuple[int, dict[str, dict[str, object]]]:
    """The command's status, and what it says of each node."""
    port = free_port("udp")
    given = overrides(file, port)
    with sending(port, frames(load_config(file, MasterConfig, given), wrong)):
        sets = [word for override in given for word in ("--set", override)]
        process = await asyncio.create_subprocess_exec(
            sys.executable, "-m", "deploy", "suit", "check", str(file), "--seconds", str(SECONDS), "--json",
            *sets, stdout=asyncio.subprocess.PIPE, cwd=ROOT,
        )  # fmt: skip
        said, _ = await process.communicate()
    assert process.returncode is not None
    return process.returncode, {one["name"]: one for one in json.loads(said)}


def wrongs(finding: dict[str, object]) -> list[str]:
    """What is wrong with a node itself: a busy host loses frames of any."""
    troubles = finding["troubles"]
    assert isinstance(troubles, list)
    return [trouble for trouble in troubles if "samples are lost" not in trouble]


def in_g(reading: Array) -> Array:
    out = reading.copy()
    out[:3] /= 9.81
    return out


def test_the_page_s_nodes_are_found_sound(file: Path, on_this_host: OnThisHost) -> None:
    async def story(_: HostWatch) -> None:
        status, found = await checked(file, lambda reading: reading)
        assert set(found) == {"shoulder", "upper_arm", "forearm"}
        assert found["forearm"]["rate_hz"] == pytest.approx(100.0, rel=0.02)
        assert [wrongs(one) for one in found.values()] == [[], [], []], found
        assert status == any(one["troubles"] for one in found.values())

    on_this_host(story)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [(in_g, 'write unit = "g"'), (lambda reading: np.zeros(9), "it repeats one reading")],
    ids=["in g", "dead"],
)
def test_what_is_wrong_with_one_of_them_is_said_of_that_one(
    file: Path, on_this_host: OnThisHost, wrong: Wrong, words: str
) -> None:
    async def story(_: HostWatch) -> None:
        status, found = await checked(file, wrong)
        assert any(words in trouble for trouble in wrongs(found["forearm"])), found["forearm"]
        assert wrongs(found["shoulder"]) == wrongs(found["upper_arm"]) == []
        assert status == 1

    on_this_host(story)
