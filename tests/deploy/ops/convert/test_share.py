"""A copy for others: motion is kept to the last bit, names, dates, hosts and texts are not."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from common.errors import TandemError
from common.recording import McapRecorder, read_recording
from common.skeleton import load_skeleton
from common.wire.codec import decode
from common.wire.messages import Command, RobotState
from deploy import cli
from deploy.ops.convert.share import DAY_NS, ShareKey, write_share
from deploy.sim.world.world import VirtualWorld
from deploy.study.marks import MARK_TOPIC, NOW_TOPIC, Mark, MarkKind
from tests.deploy.recorded.virtual import record_run

SKELETON = load_skeleton("nursing")
J = len(SKELETON.joints)
pytestmark = pytest.mark.timeout(300)


def follow(world: VirtualWorld) -> None:
    world.engage()
    world.run(1.0)


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of a session, with marks and a picture."""
    folder = tmp_path_factory.mktemp("share")
    run = record_run(folder, follow)
    whole = read_recording(run.master)
    path = folder / "session.mcap"
    study = {"study_subject": "k7pd", "study_scope": "motion sharing", "connect": "tcp/ward-3:1"}
    head = {**whole.metadata, **study}
    with McapRecorder(path, head, capacity=100_000) as recorder:
        for entry in whole.entries:
            recorder.put(entry.topic, entry.payload, entry.monotonic_ns)
        for kind, text in ((MarkKind.STEP, "reach"), (MarkKind.EVENT, "Mrs Smith dropped the cup")):
            recorder.put(MARK_TOPIC, Mark(1, 2, kind, text).line().encode(), 2)
        now = {"subject": "k7pd", "session": "01", "step": "reach"}
        recorder.put(NOW_TOPIC, json.dumps(now).encode(), 3)
        recorder.put("tandem/robot-1/video/head", b"picture", 4)
    return path


def test_motion_is_kept_and_names_dates_texts_and_pictures_are_not(source: Path, tmp_path: Path) -> None:
    out, key = tmp_path / "shared.mcap", ShareKey(tmp_path / "key")
    said = write_share(source, out, SKELETON, key)
    before, after = read_recording(source), read_recording(out)
    bytes_ = b"".join(e.topic.encode() + e.payload for e in after.entries) + str(after.metadata).encode()
    for word in (b"nurse", b"robot-1", b"k7pd", b"Smith", b"ward-3", b"video", b"picture", b"follows"):
        assert word not in bytes_, word
    assert "left out" in said
    states = [[e for e in r.entries if e.topic.endswith("/state")] for r in (before, after)]
    assert len(states[0]) == len(states[1]) > 20
    for one, other in zip(*states, strict=True):
        old, new = (decode(e.payload, RobotState, J) for e in (one, other))
        assert np.array_equal(old.position_rad, new.position_rad)
        assert (old.guard, new.reason, len(new.operator)) == (new.guard, "", 6 if old.operator else 0)
        shift_ns = one.wall_ns - other.wall_ns
        assert shift_ns % DAY_NS == 0
        assert 365 <= shift_ns // DAY_NS <= 3650
    commands = [[e for e in r.entries if e.topic.endswith("/command")] for r in (before, after)]
    for one, other in zip(*commands, strict=True):
        sent, shared = (decode(e.payload, Command, J).position_rad for e in (one, other))
        assert np.array_equal(sent, shared)
    marks = [json.loads(e.payload) for e in after.entries if e.topic == MARK_TOPIC]
    assert [(mark["kind"], mark["text"]) for mark in marks] == [("step", "reach"), ("event", "")]


def test_the_same_secret_gives_the_same_codes_and_another_others(source: Path, tmp_path: Path) -> None:
    keys = [ShareKey(tmp_path / name) for name in ("a", "a", "b")]
    assert keys[0].code("subject", "k7pd") == keys[1].code("subject", "k7pd")
    assert keys[0].shift_ns("k7pd") == keys[1].shift_ns("k7pd")
    assert keys[0].code("subject", "k7pd") != keys[2].code("subject", "k7pd")
    assert keys[0].code("subject", "k7pd") != keys[0].code("operator", "k7pd")
    (tmp_path / "a").chmod(0o644)
    with pytest.raises(TandemError, match="others may read it"):
        ShareKey(tmp_path / "a")


def test_without_consent_to_sharing_nothing_is_written(source: Path, tmp_path: Path) -> None:
    closed = tmp_path / "closed.mcap"
    with McapRecorder(closed, {"study_subject": "k7pd", "study_scope": "motion video"}) as recorder:
        recorder.put(MARK_TOPIC, Mark(1, 2, MarkKind.STEP, "reach").line().encode(), 2)
    out = tmp_path / "out.mcap"
    with pytest.raises(TandemError, match="has not consented to sharing"):
        write_share(closed, out, SKELETON, ShareKey(tmp_path / "key"))
    assert not out.exists()
    arguments = ["export", str(source), "--to", "share", "--out", str(out)]
    result = CliRunner().invoke(cli.app, arguments)
    assert result.exit_code
    assert not out.exists()
    assert CliRunner().invoke(cli.app, [*arguments, "--key", str(tmp_path / "key")]).exit_code == 0
    assert out.exists()


@pytest.mark.parametrize("scopes", [[["motion"]], [["motion", "sharing"], ["motion"]], [None]])
def test_a_session_that_was_under_way_without_consent_to_sharing_keeps_the_recording_here(
    tmp_path: Path, scopes: list[list[str] | None]
) -> None:
    """A recorder that runs for good has no subject in its head."""
    steady, out = tmp_path / "steady.mcap", tmp_path / "out.mcap"
    with McapRecorder(steady, {"role": "master"}) as recorder:
        for scope in scopes:
            now = {"subject": "k7pd", "session": "01", "step": "reach"} | ({"scope": scope} if scope else {})
            recorder.put(NOW_TOPIC, json.dumps(now).encode(), 1)
    with pytest.raises(TandemError, match="has not consented to sharing"):
        write_share(steady, out, SKELETON, ShareKey(tmp_path / "key"))
    assert not out.exists()


def test_each_subject_of_a_recording_has_a_code(tmp_path: Path) -> None:
    steady, out, key = tmp_path / "steady.mcap", tmp_path / "out.mcap", ShareKey(tmp_path / "key")
    with McapRecorder(steady, {"role": "master"}) as recorder:
        for subject in ("k7pd", "m2xa"):
            now = {"subject": subject, "session": "01", "step": "reach", "scope": ["motion", "sharing"]}
            recorder.put(NOW_TOPIC, json.dumps(now).encode(), 1)
    write_share(steady, out, SKELETON, key)
    shared = [json.loads(entry.payload)["subject"] for entry in read_recording(out).entries]
    assert shared == [key.code("subject", subject) for subject in ("k7pd", "m2xa")]


def test_a_copy_that_could_not_be_finished_is_removed(tmp_path: Path) -> None:
    damaged, out = tmp_path / "damaged.mcap", tmp_path / "out.mcap"
    with McapRecorder(damaged, {"role": "master"}) as recorder:
        recorder.put(MARK_TOPIC, b"not a mark", 1)
    with pytest.raises(ValueError, match="Expecting value"):
        write_share(damaged, out, SKELETON, ShareKey(tmp_path / "key"))
    assert not out.exists()


def test_the_copys_name_is_not_made_of_the_recordings(source: Path, tmp_path: Path) -> None:
    """A recording's name holds the day that the copy must not tell."""
    result = CliRunner().invoke(
        cli.app, ["export", str(source), "--to", "share", "--key", str(tmp_path / "k")]
    )
    assert result.exit_code
    assert not list(source.parent.glob("*_shared.mcap"))
