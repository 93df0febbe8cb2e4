"""A trial computed again from its recordings alone: identical, on a machine that has nothing else."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from common.errors import TandemError
from common.link.config import LinkConfig
from common.wire.codec import encode
from common.wire.messages import Command, RobotState, Statistics, Truth
from common.wire.topics import COMMAND, STATE, STATISTICS, TRUTH, Topic
from deploy import cli
from deploy.experiments.trial.cell.conclude import conclude, open_tape
from deploy.experiments.trial.cell.folder import Folder
from deploy.experiments.trial.cell.plan import CellKey, Setup
from deploy.experiments.trial.cell.recomputed import recompute
from deploy.experiments.trial.cell.recording import CellCourse, CellMessages, on_masters_clock
from deploy.experiments.trial.cell.result import Cell
from deploy.experiments.trial.cell.tape import AFTER, JUDGED, CellTape, recording_of
from deploy.experiments.trial.report.verify import differences
from deploy.experiments.trial.report.write import write
from deploy.study.seal import seal
from slave.config import SlaveConfig
from tests.deploy.experiments.trial.cell.test_measure import CONFIG
from tests.deploy.experiments.trial.cell.test_measure import recording as made_up
from tests.deploy.experiments.trial.made_up import PLAN

KEYS = [CellKey(Setup(transport, "lan", "latest"), 1) for transport in ("tcp", "udp")]
SETTINGS = {"guard.max_age_s": "0.45"}


def recording(lost: Iterable[int] = ()) -> CellMessages:
    """A made-up stretch, as a suit can send it: it numbers from 0."""
    heard = made_up(lost)
    return replace(heard, truth=[one for one in heard.truth if one.tick >= 0])


def put(tape: CellTape, messages: CellMessages) -> None:
    by_topic: dict[Topic, Sequence[Command | RobotState | Truth | Statistics]] = {
        COMMAND: messages.commands,
        STATE: messages.states,
        TRUTH: messages.truth,
        STATISTICS: messages.statistics,
    }
    for topic, sent in by_topic.items():
        for message in sent:
            tape.hear(topic, encode(message), 1)


def run(folder: Path, key: CellKey, course: CellCourse, config: SlaveConfig = CONFIG) -> Cell:
    tape = open_tape(folder, key, config, SETTINGS)
    assert tape is not None
    tape.stretch(JUDGED)
    put(tape, course.judged)
    tape.stretch(AFTER)
    return conclude(key, course, config, SETTINGS, ("the suit ended with status 1",), tape)


def course(lost: int, shared_clock: bool = True) -> CellCourse:
    heard = recording(lost=range(20, 20 + lost))
    cpu = {"master": 20.123456789, "slave": 33.3}
    return CellCourse(heard, 0.45, shared_clock, cpu_percent=cpu, up_bytes_s=4920.123, remarks=("a hold",))


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recorded")
    folder = Folder(path)
    folder.begin(replace(PLAN, profiles=("lan",), strategies=("latest",), repeat=1, outage_s=0.0))
    for lost, key in enumerate(KEYS):
        folder.keep(run(path, key, course(lost)))
    write(folder)
    return path


@pytest.fixture
def copy(made: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(made, tmp_path / "elsewhere"))


def test_cells_and_tables_are_what_the_recordings_give(copy: Path) -> None:
    checked = differences(Folder(copy))
    assert checked.differences == []
    assert (checked.recomputed, checked.cells) == (2, 2)
    seal(copy)
    shown = CliRunner().invoke(cli.app, ["trial", "verify", str(copy)])
    assert shown.exit_code == 0, shown.output
    assert "2 of 2 cells were computed from their recordings; the seal is whole" in shown.output


def test_a_figure_changed_in_cell_and_tables_alike_is_named(copy: Path) -> None:
    file = copy / "cells" / f"{KEYS[0].slug}.json"
    tree = json.loads(file.read_text("utf-8"))
    tree["figures"]["rmse_deg"] += 0.01
    file.write_text(json.dumps(tree), "utf-8")
    write(Folder(copy))  # the tables then agree with the cells: only the recording tells
    found = differences(Folder(copy)).differences
    assert f"cells/{KEYS[0].slug}.json: figures.rmse_deg is not what the recording gives" in found
    assert "cells.csv: line 2 is not what the recordings give" in found


def test_a_changed_byte_of_a_recording_is_named_with_and_without_a_seal(copy: Path) -> None:
    file = recording_of(copy, KEYS[1])
    seal(copy)
    data = bytearray(file.read_bytes())
    data[len(data) // 2] ^= 1
    file.write_bytes(data)
    result = CliRunner().invoke(cli.app, ["trial", "verify", str(copy)])
    assert isinstance(result.exception, TandemError)
    by_seal = [
        line for line in result.output.splitlines() if line.startswith(f"recordings/{file.name}: bytes")
    ]
    assert len(by_seal) >= 1
    (copy / "seal.json").unlink()
    found = differences(Folder(copy)).differences
    assert any(f"recordings/{file.name}: bytes" in words and "were changed" in words for words in found)


def test_a_recording_that_is_gone_exchanged_or_of_no_cell_is_named(copy: Path) -> None:
    first, second = (recording_of(copy, key) for key in KEYS)
    shutil.copy(second, first)
    shutil.copy(second, first.with_name("another.mcap"))
    second.unlink()
    found = differences(Folder(copy)).differences
    assert f"recordings/{first.name}: it is the recording of {KEYS[1].slug}" in found
    assert f"recordings/{second.name}: is missing, and its cell has figures" in found
    assert "recordings/another.mcap: there is no cell of it" in found


def test_a_recording_that_reached_its_size_is_not_judged_by(tmp_path: Path) -> None:
    tape = CellTape(tmp_path / "small.mcap", {}, most_bytes=10_000)
    tape.stretch(JUDGED)
    put(tape, recording())
    cell = conclude(KEYS[0], course(0), CONFIG, SETTINGS, (), tape)
    assert "largest size" in cell.remarks[-1]
    assert cell.values["rmse_deg"] is not None
    assert tape.path.stat().st_size < 20_000


def test_a_robot_with_a_clock_of_its_own_is_moved_onto_the_masters_again(tmp_path: Path) -> None:
    heard = recording()
    there = [replace(one, master_offset_ns=1_000_000_000) for one in heard.states]  # 1 s behind, say
    heard = replace(heard, states=there)
    moved = replace(heard, states=on_masters_clock(there))
    assert moved.states[0].encoder_ns != there[0].encoder_ns
    apart = replace(course(0, shared_clock=False), judged=moved)
    tape = open_tape(tmp_path, KEYS[0], CONFIG, SETTINGS)
    assert tape is not None
    tape.stretch(JUDGED)
    put(tape, heard)  # as the robot's host sent them
    cell = conclude(KEYS[0], apart, CONFIG, SETTINGS, (), tape)
    assert cell.tree() == conclude(KEYS[0], apart, CONFIG, SETTINGS, (), None).tree()


def test_limits_and_a_profile_of_ones_own_come_from_the_recording(tmp_path: Path) -> None:
    shipped = Path(__file__).parents[5] / "common/skeleton/nursing.toml"
    own = tmp_path / "mine"
    own.mkdir()
    (own / "robot.toml").write_text(shipped.read_text("utf-8"), "utf-8")
    config = SlaveConfig(robot="robot-1", profile=str(own), link=LinkConfig())
    cell = run(tmp_path, KEYS[0], course(1), config)
    shutil.rmtree(own)
    assert recompute(recording_of(tmp_path, KEYS[0])).tree() == cell.tree()
