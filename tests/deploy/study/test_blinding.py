"""A blinded study: what operator and experimenter see names no transport, and the key fits afterwards."""

from __future__ import annotations

import asyncio
import io
import json
import logging
import re
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console
from typer.testing import CliRunner

from common.errors import ConfigError, LinkError, TandemError
from common.link.endpoint import TRANSPORTS
from common.recording import RecordingStream
from deploy import cli
from deploy.console.study import StudyDesk
from deploy.examples.profiles import example
from deploy.experiments.trial.cell.folder import Folder
from deploy.experiments.trial.cell.plan import CellKey, TrialPlan
from deploy.experiments.trial.cell.result import Cell, CellStatus
from deploy.experiments.trial.report.write import write
from deploy.experiments.trial.run import Show, run_trial
from deploy.experiments.trial.view import print_findings
from deploy.study.blind_run import HidingFormatter, connect_of, transports_hidden
from deploy.study.blinding import HIDDEN, BlindKey, hide_transports, read_key
from deploy.study.marks import MarkKind
from deploy.study.protocol import load_protocol
from deploy.study.seal import seal
from deploy.study.session import begin
from deploy.study.under_way import say_under_way
from tests.deploy.experiments.trial.made_up import PLAN
from tests.deploy.experiments.trial.report.test_from_recordings import course, run

CONDITIONS = "".join(
    f'[[condition]]\ntransport = "{name}"\nconnect = ["{name}/192.0.2.9:7447"]\n'
    for name in ("tcp", "udp", "quic")
)
NAMED = re.compile(rf"(?<![A-Za-z])({'|'.join(TRANSPORTS)})(?![A-Za-z])|192\.0\.2", re.IGNORECASE)
STEPS = (
    '[[step]]\nname = "rest"\ntext = { en = "Stand." }\n[[step]]\nname = "reach"\ntext = { en = "Reach." }\n'
)


def tandem(*arguments: object) -> str:
    result = CliRunner().invoke(cli.app, [str(one) for one in arguments])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.output


@pytest.fixture
def drawn(tmp_path: Path) -> tuple[Path, str]:
    """The key's file, and the lines for the protocol."""
    (tmp_path / "conditions.toml").write_text(CONDITIONS)
    key = tmp_path / "cup.key"
    return key, tandem("session", "blind", tmp_path / "conditions.toml", "--key", key)


@pytest.fixture
def protocol(drawn: tuple[Path, str], tmp_path: Path) -> Path:
    path = tmp_path / "cup.toml"
    path.write_text(f'name = "cup"\nversion = "1"\n{drawn[1]}{STEPS}')
    return path


def test_the_key_is_its_owners_alone_and_its_lines_name_nothing(drawn: tuple[Path, str]) -> None:
    key, lines = drawn
    assert key.stat().st_mode & 0o777 == 0o600
    assert NAMED.search(lines) is None
    assert read_key(key).commitment in lines
    with pytest.raises(TandemError, match="cannot be written"):
        tandem("session", "blind", key.with_name("conditions.toml"), "--key", key)
    key.chmod(0o640)
    with pytest.raises(TandemError, match="others may read it"):
        read_key(key)


def test_codes_do_not_follow_the_order_of_the_conditions(tmp_path: Path) -> None:
    (tmp_path / "conditions.toml").write_text(CONDITIONS)
    firsts = set()
    for number in range(20):
        key = tmp_path / f"{number}.key"
        tandem("session", "blind", tmp_path / "conditions.toml", "--key", key)
        read = read_key(key)
        firsts.add(read.conditions[read.codes[0]].transport)
    assert len(firsts) > 1


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [("udp", "tcp", "condition.1.transport"), ('"quic"', '"pigeon"', "condition.2.transport"),
     ("quic/192", "tcp/192", "condition.2.connect")],
)  # fmt: skip
def test_a_wrong_condition_is_named(tmp_path: Path, old: str, new: str, named: str) -> None:
    (tmp_path / "conditions.toml").write_text(CONDITIONS.replace(old, new))
    with pytest.raises(ConfigError, match=re.escape(named)):
        tandem("session", "blind", tmp_path / "conditions.toml", "--key", tmp_path / "a.key")


def test_a_protocol_with_half_of_it_is_refused(protocol: Path) -> None:
    text = protocol.read_text()
    for old, new, named in (
        ("blinded = true", "", "conditions"),
        ("commitment = ", "# ", "commitment"),
        (re.findall("conditions = .*", text)[0], 'conditions = ["K7"]', "conditions"),
    ):
        protocol.write_text(text.replace(old, new))
        with pytest.raises(ConfigError, match=named):
            load_protocol(protocol)


def test_sessions_go_through_all_steps_in_each_condition_in_a_balanced_order(
    protocol: Path, tmp_path: Path
) -> None:
    sessions = [begin(tmp_path / "study", protocol, subject) for subject in ("k7pd", "m2xx", "q3rr")]
    orders = [session.head.conditions for session in sessions]
    codes = load_protocol(protocol)[0].conditions
    assert [sorted(one) for one in zip(*orders, strict=True)] == [sorted(codes)] * 3
    first = sessions[0]
    begun = [first.next_step() for _ in range(7)]
    assert begun == [f"{code}-{step}" for code in orders[0] for step in ("rest", "reach")] + [None]


def test_nothing_of_a_session_names_a_transport_until_it_is_unblinded(
    drawn: tuple[Path, str], protocol: Path, tmp_path: Path
) -> None:
    study = tmp_path / "study"
    session = begin(study, protocol, "k7pd")
    say_under_way(session)
    session.next_step()
    page = StudyDesk(study).shown(0)
    assert page is not None
    assert page["steps"] == 6
    session.mark(MarkKind.END, "done")
    key = drawn[0]
    with pytest.raises(TandemError, match="not sealed yet"):
        tandem("session", "unblind", session.path, "--key", key)
    seal(session.path)
    seen = [json.dumps(page), json.dumps(session.metadata())]
    seen += [str(path) for path in study.rglob("*")]
    seen += [path.read_text("utf-8") for path in study.rglob("*") if path.is_file()]
    assert not [text for text in seen if NAMED.search(text)]
    told = tandem("session", "unblind", session.path, "--key", key)
    assert {line.split()[1] for line in told.splitlines()} == {"tcp", "udp", "quic"}


def test_another_key_or_a_changed_one_is_refused(
    drawn: tuple[Path, str], protocol: Path, tmp_path: Path
) -> None:
    session = begin(tmp_path / "study", protocol, "k7pd")
    key = drawn[0]
    text = key.read_text()
    one, other = re.findall(r'"transport": "(\w+)"', text)[:2]
    swapped = text.replace(f'"{one}"', '"x"').replace(f'"{other}"', f'"{one}"').replace('"x"', f'"{other}"')
    key.write_text(swapped)
    with pytest.raises(TandemError, match="not the key of this study"):
        tandem("session", "unblind", session.path, "--key", key, "--unsealed")
    inside = session.path / "inside.key"
    inside.write_text(text)
    inside.chmod(0o600)
    with pytest.raises(TandemError, match="must not lie in its folder"):
        tandem("session", "unblind", session.path, "--key", inside, "--unsealed")


def test_the_master_of_a_condition_connects_by_the_key_and_its_log_does_not_say_where(
    drawn: tuple[Path, str], caplog: pytest.LogCaptureFixture
) -> None:
    read = read_key(drawn[0])
    for code in read.codes:
        assert connect_of(drawn[0], code) == [f"{read.conditions[code].transport}/192.0.2.9:7447"]
    with pytest.raises(TandemError, match="expected one of"):
        connect_of(drawn[0], "Z9")
    record = logging.makeLogRecord({"msg": "no router at %s, udp", "args": ("quic/192.0.2.9:7447",)})
    assert HidingFormatter(logging.Formatter()).format(record) == f"no router at {HIDDEN}, {HIDDEN}"
    with pytest.raises(TandemError, match=r"cannot be opened: \(hidden\)"), transports_hidden():
        raise LinkError("the link cannot be opened: tcp/192.0.2.9:7447")


def test_a_blinded_master_takes_no_second_path(drawn: tuple[Path, str], tmp_path: Path) -> None:
    """It would run beside the condition's, and the metrics name the path that is missing by its endpoints."""
    file = tmp_path / "master.toml"
    shipped = example("master").read_text("utf-8")
    file.write_text(f'{shipped}\n[link.twin]\nconnect = ["tcp/192.0.2.8:7447"]\n', "utf-8")
    conditions = read_key(drawn[0]).conditions
    # one that needs no keys: the codes are drawn anew each time
    code = next(code for code, condition in conditions.items() if condition.transport == "tcp")
    with pytest.raises(TandemError, match=r"link\.twin.*take \[link\.twin\] out"):
        tandem("master", file, "--blinded", drawn[0], "--condition", code)


def test_a_blinded_master_listens_nowhere(drawn: tuple[Path, str], tmp_path: Path) -> None:
    """A robot that connects there would run over that transport, not over the condition's."""
    conditions = read_key(drawn[0]).conditions
    code = next(code for code, condition in conditions.items() if condition.transport == "tcp")
    with pytest.raises(TandemError, match=r"link\.listen: expected \[\] with --blinded") as refused:
        tandem(
            "master", example("master"), "--blinded", drawn[0], "--condition", code,
            "--set", 'link.listen=["udp/127.0.0.1:7499"]',
        )  # fmt: skip
    assert "udp" not in str(refused.value)


@pytest.mark.parametrize(
    ("text", "hidden"),
    [
        ("tcp/127.0.0.1:7447, unixsock-stream//tmp/a b", f"{HIDDEN}, {HIDDEN} b"),
        ("over QUIC-datagram", f"over {HIDDEN}"),
        ("the guard holds", "the guard holds"),
        ("udp", HIDDEN),
        ("wsl, awstcp, udp_multicast", "wsl, awstcp, udp_multicast"),
    ],
)  # fmt: skip
def test_only_transports_are_hidden(text: str, hidden: str) -> None:
    assert hide_transports(text) == hidden


def trial(key: BlindKey) -> TrialPlan:
    return replace(
        PLAN,
        transports=key.codes,
        profiles=("lan",),
        strategies=("latest",),
        blinded=key.commitment,
        outage_s=0.0,
    )


def test_nothing_of_a_trial_names_a_transport_until_it_is_unblinded(
    drawn: tuple[Path, str], tmp_path: Path
) -> None:
    key, path, out = read_key(drawn[0]), tmp_path / "trial", io.StringIO()
    console = Console(file=out, width=200, force_terminal=True)

    async def run_cell(_: TrialPlan, one: CellKey, stop: asyncio.Event, show: Show) -> Cell:
        show("judging")
        if one.repetition == 2:
            why = hide_transports(
                f"no command: {key.condition(one.setup.transport).transport}/192.0.2.9:7447"
            )
            return Cell(one, CellStatus.FAILED, why)
        return run(path, one, course(one.repetition))

    asyncio.run(run_trial(replace(trial(key), repeat=2), Folder(path), run_cell, asyncio.Event(), console))
    print_findings(write(Folder(path)), console)
    seen = [out.getvalue()] + [str(one.relative_to(tmp_path)) for one in path.rglob("*")]
    for file in (one for one in path.rglob("*") if one.is_file()):
        if file.suffix == ".mcap":
            stream = RecordingStream(file)
            seen += [
                f"{entry.topic} {entry.payload.decode('latin-1')}"
                for entry in stream
                if "trial/" in entry.topic
            ]
            seen.append(json.dumps(stream.metadata))
        else:
            seen.append(re.sub(r'src="data:[^"]*"', "", file.read_text("utf-8")))
    assert key.codes[0] in seen[0]
    assert [match for text in seen if (match := NAMED.search(text))] == []
    assert "every table is what the recordings give" in tandem("trial", "verify", path)
    seal(path)
    told = tandem("session", "unblind", path, "--key", drawn[0])
    assert f"{key.codes[0]}  {key.conditions[key.codes[0]].transport}" in told


def test_the_cells_of_a_blinded_trial_come_in_a_balanced_order(drawn: tuple[Path, str]) -> None:
    cells = trial(read_key(drawn[0])).cells()
    places = [[cells[3 * turn + place].setup.transport for turn in range(3)] for place in range(3)]
    assert all(len(set(one)) == 3 for one in places)


def test_a_blinded_trial_takes_its_transports_from_the_key_alone(
    drawn: tuple[Path, str], tmp_path: Path
) -> None:
    with pytest.raises(TandemError, match="without --transports"):
        tandem("trial", "--blinded", drawn[0], "--transports", "tcp", "--report", tmp_path / "t")
