"""The worked examples of docs/extending.md, taken from the page and run through the contracts."""

from __future__ import annotations

import importlib
import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

import common.skeleton.load
import deploy.examples.profiles
from common.clock import to_ns
from common.config.load import check_config, load_config
from common.quaternion import Array
from common.skeleton import load_skeleton
from common.wire.messages import Action
from deploy.measure import motion
from deploy.sim.suit.free_running import FreeNode, NodeClock, Reading, sent_by
from deploy.sim.suit.motion import load_motion
from deploy.sim.suit.sensors import IdealSensors, earth_field_ut
from deploy.sim.world.world import VirtualWorld, WorldSettings
from master.capture.source import load_layouts
from master.config import MasterConfig
from master.orientation.config import EstimationConfig
from master.orientation.filter import FilterSection
from master.orientation.filters import FILTERS
from master.pipeline import MasterPipeline
from master.suit.protocol import SuitProtocol
from slave.backends import ServosConfig
from slave.encoders.counts import EncoderConfig
from slave.track.config import STRATEGIES, TrackConfig, make_tracker
from tests.master.orientation.filter_contract import FilterContract
from tests.slave.track.contract import check as check_tracker

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/extending.md").read_text("utf-8")
BLOCK = re.compile(r"^```(?:python|toml|dbc)\n# ([^\n]+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
BLOCKS = [(name, text) for name, text in BLOCK.findall(PAGE)]


def blocks(name: str) -> list[str]:
    """The text of every block whose first line is `# name`."""
    return [text for found, text in BLOCKS if found == name]


def module(name: str) -> ModuleType:
    """The one block of a new Python file, loaded as the module that it would be."""
    (text,) = blocks(name)
    made = ModuleType(name.removesuffix(".py").replace("/", "."))
    sys.modules[made.__name__] = made
    exec(compile(text, name, "exec"), vars(made))
    return made


COMPLEMENTARY = module("master/orientation/complementary.py")
RAMP = module("slave/track/ramp.py")


def add_line(patch: pytest.MonkeyPatch, table: dict[str, Any], block: str, **names: object) -> None:
    """Put a block's line into a table, with the names that its file would import."""
    (line,) = blocks(block)
    for key, value in eval("{" + line + "}", dict(names)).items():
        patch.setitem(table, key, value)


class TestFilter(FilterContract):
    @pytest.fixture
    def section(self) -> FilterSection:
        section: FilterSection = COMPLEMENTARY.ComplementaryConfig()
        return section


def toml(section: str) -> dict[str, object]:
    """The keys of the one block for a person's file that holds `[section]`."""
    (found,) = (
        tomllib.loads(text)[section]
        for name, text in BLOCKS
        if name in {"master.toml", "slave.toml"} and f"[{section}" in text
    )
    assert isinstance(found, dict)
    return found


def test_a_file_chooses_the_filter(monkeypatch: pytest.MonkeyPatch) -> None:
    line = "master/orientation/filters.py, in FILTERS"
    add_line(monkeypatch, FILTERS, line, ComplementaryConfig=COMPLEMENTARY.ComplementaryConfig)
    config = EstimationConfig.model_validate(toml("estimation"))
    assert config.mistakes_at(200.0) == []
    assert config.filter_sections["complementary"] == COMPLEMENTARY.ComplementaryConfig(tau_acc_s=2.0)


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The page's own package, as pip would install it: its modules, and the entry points of its pyproject."""
    for name, text in BLOCKS:
        if name.startswith(("acme_ideal/", "tests/")):
            (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / name).write_text(text, "utf-8")
    (project,) = (tomllib.loads(text)["project"] for text in blocks("pyproject.toml"))
    info = tmp_path / f"acme_ideal-{project['version']}.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: 1.0\n", "utf-8")
    lines = [
        f"[{group}]\n" + "".join(f"{name} = {value}\n" for name, value in points.items())
        for group, points in project["entry-points"].items()
    ]
    (info / "entry_points.txt").write_text("\n".join(lines), "utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    yield tmp_path
    for name in [name for name in sys.modules if name.partition(".")[0] == "acme_ideal"]:
        del sys.modules[name]


def test_a_package_adds_a_servo_backend_beside_others(package: Path) -> None:
    skeleton = load_skeleton("nursing")
    config = check_config(Path("slave.toml"), toml("servos"), ServosConfig)
    assert config.mistakes_for(skeleton, EncoderConfig()) == []
    (ideal, simulated, absent) = config.shares(skeleton)
    assert ideal.section == importlib.import_module("acme_ideal.config").IdealConfig(cycle_ms=5.0)
    assert len(ideal.skeleton.joints) == 22
    assert simulated.skeleton.joint_names == ("neck_yaw", "neck_pitch")
    assert absent.skeleton.joint_names == ("waist_pitch",)
    assert "waist_pitch" in config.not_driven(skeleton)
    servos = config.open(skeleton, EncoderConfig())
    servos.start()
    try:
        reading = servos.read()
        servos.write(np.clip(np.full(25, 0.2), skeleton.lower_rad, skeleton.upper_rad))
        left = skeleton.joint_names.index("left_elbow_pitch")
        waist = skeleton.joint_names.index("waist_pitch")
        assert servos.read().counts[left] != reading.counts[left]
        assert servos.read().counts[waist] == reading.counts[waist] == round(5.0 / 360.0 * 4096)
    finally:
        servos.stop()
    assert "no torque" in servos.metrics().no_effort["left_elbow_pitch"]


def test_the_package_runs_the_contract_by_its_own_test(package: Path) -> None:
    paths = {"PYTHONPATH": f"{package}:{ROOT}"}
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(package / "tests")]
    ran = subprocess.run(command, env={**os.environ, **paths}, capture_output=True, text=True, cwd=package)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert "1 passed" in ran.stdout


def test_the_strategy_keeps_the_contract(monkeypatch: pytest.MonkeyPatch) -> None:
    add_line(monkeypatch, STRATEGIES, "slave/track/config.py, in STRATEGIES", Ramp=RAMP.Ramp)
    config = check_config(Path("slave.toml"), toml("track"), TrackConfig)
    check_tracker(lambda: make_tracker(config))


@pytest.fixture
def files_of_the_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The page's TOML files beside those that ship."""
    skeletons, examples = tmp_path / "common/skeleton", tmp_path / "deploy/examples"
    shutil.copytree(ROOT / "common/skeleton", skeletons)
    (tmp_path / "master/suit").mkdir(parents=True)
    shutil.copy(ROOT / "master/suit/suit.dbc", tmp_path / "master/suit")
    for name, text in BLOCKS:
        if "/" in name and name.endswith((".toml", ".dbc")):
            (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / name).write_text(text, "utf-8")
    monkeypatch.setattr(common.skeleton.load, "resources", SimpleNamespace(files=lambda _: skeletons))
    monkeypatch.setattr(deploy.examples.profiles, "EXAMPLES", examples)
    monkeypatch.chdir(tmp_path)
    yield
    load_skeleton.cache_clear()


@pytest.mark.usefixtures("files_of_the_page")
@pytest.mark.long
def test_a_robot_of_the_profile_follows_the_operator() -> None:
    run = VirtualWorld(
        WorldSettings(slave_ahead_ns=0, slave_drift_ppm=0.0, one_way_ns=500_000, profile="one_arm")
    )
    run.run(5.0, until=lambda: bool(run.commands and run.commands[-1].valid.all() and run.commands[-1].lease))
    run.run(1.0)
    reply = run.ask(Action.ENGAGE)
    assert reply.done, reply.text
    run.run(20.0)
    assert run.slave.guard.state == "track", run.slave.guard.reason
    moved = motion(run.trace.truth(), run.trace.moved(), run.trace.joint_names)
    assert moved is not None
    assert set(moved.joints) == {"raise", "bend"}
    assert moved.lag_ms is not None
    assert abs(moved.lag_ms) <= 25.0


@pytest.mark.usefixtures("files_of_the_page")
def test_joint_angles_follow_the_nodes_of_the_own_suit() -> None:
    config = load_config(Path("own_suit/master.toml"), MasterConfig)
    motion, sensors = (
        load_motion("sweep", config.skeleton),
        IdealSensors(config.skeleton, earth_field_ut(50.0, 60.0)),
    )
    layout = load_layouts(config.nodes, config.suit)["imu"]
    random, noise = np.random.default_rng(2), np.repeat([0.04, 0.002, 0.3], 3)

    def reading(row: int) -> Reading:
        def read(time_s: float) -> tuple[Array, Array]:
            true = sensors.read(*motion.state(time_s))[row]
            return true + noise * random.normal(size=9), np.array([1.0, 0.0, 0.0, 0.0])

        return read

    nodes = [
        FreeNode(layout, node.id, reading(row), NodeClock(100.0, 0.003 * row, 80.0 - 60.0 * row, 5.0))
        for row, node in enumerate(config.nodes.values())
    ]
    pipeline = MasterPipeline(config, SuitProtocol.load())
    frames = list(sent_by({"suit": nodes}, 12.0, np.random.default_rng(1), lost_share=0.005))
    found = []
    for tick in range(1, 2400):
        while frames and frames[0].at_s <= 0.005 * tick:
            sent = frames.pop(0)
            pipeline.frame(sent.bus, sent.frame.id, sent.frame.data, to_ns(sent.at_s))
        _, angles = pipeline.tick(tick, to_ns(0.005 * tick))
        if angles is not None and tick > 600:
            found.append(angles)
    assert len(found) >= 100
    assert all(angles.valid.all() for angles in found)
    off = [np.abs(angles.position_rad - motion.state(1e-9 * angles.sampled_ns)[0]).max() for angles in found]
    assert np.degrees(max(off)) <= 2.0
    # the newest sample of a node at 100 Hz, brought to the instants between
    age_ms = [1e-6 * (angles.frames_in_ns - angles.sampled_ns) for angles in found]
    assert 10.0 <= min(age_ms) <= max(age_ms) <= 15.0
    counts = pipeline.node_counts()["forearm"]
    assert counts["rate_hz"] == 100
    assert counts["missing"] > 0
