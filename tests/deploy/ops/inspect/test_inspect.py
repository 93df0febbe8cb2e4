"""`tandem inspect` on recordings of a virtual run: contents, guard events, pictures, and planted jitter."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from common.clock import to_s
from common.recording import McapRecorder, read_recording
from deploy import cli
from deploy.sim.world.world import VirtualWorld
from slave.tap import TICK, RobotTick, decode_tick, encode_tick
from tests.deploy.recorded.virtual import RecordedRun, record_run

FOLLOWED_S = 5.5
pytestmark = pytest.mark.timeout(400)
SMOOTH = {"slave": ['track.strategy="interpolate"']}
"""The tracker that predicts adds a hump at 12.5 Hz by itself: each command corrects what it foretold."""


def cut_line(world: VirtualWorld) -> None:
    """Follow for some seconds, then the link dies and the guard holds."""
    world.engage()
    world.run(FOLLOWED_S)
    world.inject.carry = lambda kind, payload: ()
    world.run(1.0)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> RecordedRun:
    return record_run(tmp_path_factory.mktemp("inspected"), cut_line, overrides=SMOOTH)


def inspected(*arguments: object) -> dict[str, object]:
    result = CliRunner().invoke(cli.app, ["inspect", *map(str, arguments), "--json"])
    assert result.exit_code == 0, result.output
    tree: dict[str, object] = json.loads(result.stdout)
    return tree


def test_it_shows_what_the_guard_did_and_what_came_before(run: RecordedRun) -> None:
    tree = inspected(run.slave)
    guard = tree["guard"]
    assert isinstance(guard, list)
    states = [event["state"] for event in guard]
    assert states[0] in ("boot", "hold")
    assert {"align", "track"} <= set(states)
    lost = guard[-1]
    assert (lost["before"], lost["state"]) == ("track", "hold")
    assert "command" in lost["reason"]
    assert 30 <= lost["commands"] <= 38, "3 s of 12.5 Hz, less the silence"
    assert 0.1 < lost["silence_s"] < 1.0
    assert lost["off_joint"] in run.world.slave_config.skeleton.joint_names
    assert 0.0 < lost["off_deg"] < 20.0


def test_the_master_s_recording_shows_the_guard_by_the_states_that_came(run: RecordedRun) -> None:
    guard = inspected(run.master)["guard"]
    assert isinstance(guard, list)
    assert {"align", "track"} <= {event["state"] for event in guard}


def test_pictures_are_drawn_of_joints_and_events(run: RecordedRun, tmp_path: Path) -> None:
    inspected(run.slave, "--plots", tmp_path / "drawn")
    names = {path.name for path in (tmp_path / "drawn").iterdir()}
    assert "joints.png" in names
    assert any(name.startswith("guard-") and name.endswith("-hold.png") for name in names)


@pytest.mark.long
def test_a_calm_run_has_no_stage_that_adds_jitter(run: RecordedRun, tmp_path: Path) -> None:
    tree = inspected(run.master, run.slave, "--jitter", "--plots", tmp_path)
    jitter = tree["jitter"]
    assert isinstance(jitter, dict)
    stages = [stage["stage"] for stage in jitter["stages"]]
    assert stages == ["nodes", "fused", "solved", "received", "tracked", "limited", "encoders"]
    assert jitter["first"] is None, jitter["words"]
    assert (tmp_path / "jitter.png").stat().st_size > 10_000


FIELDS = ("target_rad", "setpoint_rad", "position_rad")
"""Of a tick, in the order in which a motion passes them."""


def shaking(field: str) -> Callable[[RobotTick], RobotTick]:
    """Joint 8 trembles by 0.7° at 9 Hz, from this field of a tick on."""

    def change(tick: RobotTick) -> RobotTick:
        shake = np.zeros_like(tick.setpoint_rad)
        shake[8] = np.radians(0.7) * np.sin(2 * np.pi * 9.0 * to_s(tick.now_ns))
        later = FIELDS[FIELDS.index(field) :]
        known = {name: getattr(tick, name) for name in later}
        return replace(tick, **{n: value + shake for n, value in known.items() if value is not None})

    return change


@pytest.mark.parametrize(
    ("field", "stage"), [("target_rad", "tracked"), ("setpoint_rad", "limited"), ("position_rad", "encoders")]
)
def test_jitter_planted_in_the_robot_is_found(
    run: RecordedRun, field: str, stage: str, tmp_path: Path
) -> None:
    recording, change = read_recording(run.slave), shaking(field)
    wall_ns, out = 0, tmp_path / "slave.mcap"
    with McapRecorder(out, recording.metadata, capacity=100_000, wall=lambda: wall_ns) as recorder:
        for entry in recording.entries:
            wall_ns = entry.wall_ns
            payload = entry.payload
            if entry.topic == TICK:
                payload = encode_tick(change(decode_tick(payload)))
            assert recorder.put(entry.topic, payload, entry.monotonic_ns)
    jitter = inspected(out, "--jitter")["jitter"]
    assert isinstance(jitter, dict)
    assert jitter["first"] == stage, jitter["words"]


def test_two_robots_are_told_apart_and_a_clock_that_is_set_changes_nothing(
    run: RecordedRun, tmp_path: Path
) -> None:
    """As two robots of one master are recorded: the second does the same half a second later."""
    recording = read_recording(run.master)
    [state] = {entry.topic for entry in recording.entries if entry.topic.endswith("/state")}
    robot = state.split("/")[1]
    later = [
        entry._replace(
            topic=entry.topic.replace(f"/{robot}/", "/robot-9/"),
            monotonic_ns=entry.monotonic_ns + 500_000_000,
            wall_ns=entry.wall_ns + 500_000_000,
        )
        for entry in recording.entries
        if entry.topic.startswith(f"tandem/{robot}/")
    ]
    entries = sorted([*recording.entries, *later], key=lambda entry: entry.monotonic_ns)
    set_ns = entries[len(entries) // 2].monotonic_ns
    wall_ns, out = 0, tmp_path / "two.mcap"
    with McapRecorder(out, recording.metadata, capacity=200_000, wall=lambda: wall_ns) as recorder:
        for entry in entries:
            # an hour back in the middle
            wall_ns = entry.wall_ns - (3600 * 10**9 if entry.monotonic_ns >= set_ns else 0)
            assert recorder.put(entry.topic, entry.payload, entry.monotonic_ns)

    def of(tree: dict[str, object], name: str) -> list[tuple[object, ...]]:
        guard = tree["guard"]
        assert isinstance(guard, list)
        told = ("before", "state", "reason", "commands", "silence_s", "off_joint")
        return [tuple(event[key] for key in told) for event in guard if event["robot"] == name]

    alone, both = inspected(run.master), inspected(out)
    assert len(of(alone, robot)) == 3
    assert of(both, robot) == of(both, "robot-9") == of(alone, robot)


def test_it_says_how_well_the_page_foretold_the_robot(run: RecordedRun) -> None:
    foretold = inspected(run.master)["foretold"]
    assert isinstance(foretold, dict)
    (score,) = foretold.values()
    assert score["count"] > 50
    assert score["rms_deg"] < score["held_rms_deg"] + 0.1
    assert inspected(run.slave)["foretold"] == {}
    words = CliRunner().invoke(cli.app, ["inspect", str(run.master)]).output
    assert "ms ahead, off by" in words
