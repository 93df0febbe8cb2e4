"""A session's folder, its marks, its subject, and names where none may be."""

from __future__ import annotations

import json
import os
import shutil
import zipfile
from pathlib import Path

import pytest

from common.errors import ConfigError, TandemError
from common.recording import McapRecorder
from common.wire.sender import operator_chunk
from deploy.examples import profiles
from deploy.study.marks import MARKS, MarkKind, NewMarks, write_mark
from deploy.study.pseudonyms import Pseudonyms, names_in, too_short
from deploy.study.seal import seal
from deploy.study.session import Session, begin
from deploy.study.subject import RECEIPTS, delete_subject, export_subject
from deploy.study.under_way import UNDER_WAY, say_over, say_under_way, session_under_way

CUP = Path(profiles.__file__).parent / "study" / "cup.toml"


def test_sessions_are_numbered_and_say_what_they_are(tmp_path: Path) -> None:
    first, second = begin(tmp_path, CUP, "k7pd"), begin(tmp_path, CUP, "k7pd", consent="C-17")
    assert [one.path.name for one in (first, second)] == ["ses-01", "ses-02"]
    head = Session(second.path).metadata()
    assert (head["study_subject"], head["study_session"], head["study_consent"]) == ("k7pd", "02", "C-17")
    assert len(head["study_protocol_sha256"]) == 64
    with pytest.raises(TandemError, match="there already"):
        begin(tmp_path, CUP, "k7pd", "02")


@pytest.mark.parametrize("name", ["Li Mei", "x", "../k7", "a" * 17])
def test_a_name_is_no_code(tmp_path: Path, name: str) -> None:
    with pytest.raises(TandemError, match="never a name"):
        begin(tmp_path, CUP, name)


def test_a_protocol_with_a_step_twice_is_refused(tmp_path: Path) -> None:
    twice = tmp_path / "p.toml"
    step = '[[step]]\nname = "a"\ntext = { en = "x" }\n'
    twice.write_text(f'name = "p"\nversion = "1"\n{step}{step}')
    with pytest.raises(ConfigError, match=r"step\.name"):
        begin(tmp_path, twice, "k7pd")


def test_steps_come_in_order_and_the_end_takes_no_more(tmp_path: Path) -> None:
    session = begin(tmp_path, CUP, "k7pd")
    assert [session.next_step() for _ in range(4)] == ["rest", "reach", "questions", None]
    session.mark(MarkKind.EVENT, "cup dropped")
    session.mark(MarkKind.END, "done")
    marks = session.marks()
    assert [mark.kind for mark in marks] == ["step", "step", "step", "event", "end"]
    assert [mark.monotonic_ns for mark in marks] == sorted(mark.monotonic_ns for mark in marks)
    with pytest.raises(TandemError, match="has ended"):
        session.mark(MarkKind.EVENT, "late")
    with (session.path / MARKS).open("a") as stream:
        stream.write("not a mark\n")
    with pytest.raises(TandemError, match="line 6 is no mark"):
        session.marks()


def test_marks_are_taken_once_each_as_they_come(tmp_path: Path) -> None:
    write_mark(tmp_path, MarkKind.EVENT, "before")
    late, everything = NewMarks(tmp_path, all_of_them=False), NewMarks(tmp_path, all_of_them=True)
    assert [mark.text for mark in everything.take()] == ["before"]
    assert list(late.take()) == []
    write_mark(tmp_path, MarkKind.EVENT, "now")
    assert [[mark.text for mark in one.take()] for one in (late, everything)] == [["now"], ["now"]]
    assert list(late.take()) == []
    assert list(NewMarks(tmp_path / "none", all_of_them=True).take()) == []


def test_the_session_that_is_under_way_is_found_until_it_ends(tmp_path: Path) -> None:
    assert session_under_way(tmp_path) is None
    session = begin(tmp_path, CUP, "k7pd")
    say_under_way(session)
    found = session_under_way(tmp_path)
    assert found is not None
    assert found.path == session.path.resolve()
    assert (found.step, [step.name for step in found.steps_left]) == ("", ["rest", "reach", "questions"])
    found.next_step()
    assert (session.step, len(session.steps_left)) == ("rest", 2)
    other = begin(tmp_path, CUP, "k7pd")
    say_under_way(other)
    say_over(session)
    assert session_under_way(tmp_path) is not None, "another one began meanwhile"
    other.mark(MarkKind.END, "done")
    assert session_under_way(tmp_path) is None, "ended, though nobody said that it is over"
    (tmp_path / UNDER_WAY).write_text("../elsewhere")
    assert session_under_way(tmp_path) is None


@pytest.mark.parametrize("text", ["a\u2028b", "a\x85b", "a\nb", "杯子"])
def test_any_text_may_be_marked(tmp_path: Path, text: str) -> None:
    session = begin(tmp_path, CUP, "k7pd")
    session.mark(MarkKind.EVENT, text)
    assert [mark.text for mark in session.marks()] == [text]


def test_without_consent_for_it_no_video_is_recorded(tmp_path: Path) -> None:
    motion = begin(tmp_path, CUP, "k7pd")
    both = begin(tmp_path, CUP, "k7pd", scope=("motion", "video"))
    assert [s.may_record("tandem/robot-1/video/head") for s in (motion, both)] == [False, True]
    assert motion.may_record("tandem/robot-1/state")
    with pytest.raises(TandemError, match="motion, video or sharing"):
        begin(tmp_path, CUP, "k7pd", scope=("all",))


def test_the_table_of_names_is_apart_and_its_owner_s(tmp_path: Path) -> None:
    study = tmp_path / "study"
    study.mkdir()
    table = Pseudonyms(tmp_path / "people.csv", study)
    code, other = table.add("Li Mei"), table.add("Anna Möller")
    assert table.add("Li Mei") == code != other
    assert table.names() == {code: "Li Mei", other: "Anna Möller"}
    assert table.path.stat().st_mode & 0o777 == 0o600
    assert table.remove(code)
    assert not table.remove(code)
    assert table.names() == {other: "Anna Möller"}
    assert table.path.stat().st_mode & 0o777 == 0o600
    table.path.chmod(0o644)
    with pytest.raises(TandemError, match="others may read"):
        Pseudonyms(table.path)
    with pytest.raises(TandemError, match="must not lie in the study"):
        Pseudonyms(study / "people.csv", study)


def test_a_name_in_any_file_is_found(tmp_path: Path) -> None:
    session = begin(tmp_path, CUP, "k7pd")
    with McapRecorder(session.path / "master.mcap", {"operator": "k7pd"}) as recorder:
        recorder.put("tandem/robot-1/state", b"\x01\xffnurse Li Mei\x00", 1)
        recorder.put("suit/frames", b"nothing", 2)
    session.mark(MarkKind.EVENT, "LI MEI dropped it")
    found = names_in(session.path, ["Li Mei", "Anna Möller", "x"])
    assert found == [f"{session.path / MARKS}", f"{session.path / 'master.mcap'}: tandem/robot-1/state"]
    with McapRecorder(session.path / "head.mcap", {"operator": "Anna Möller"}) as recorder:
        recorder.put("t", b"", 1)
    assert names_in(session.path, ["anna möller"]) == [f"{session.path / 'head.mcap'}: its head"]


@pytest.mark.parametrize(
    ("name", "written", "found"),
    [
        ("Li Mei", "li_mei", True), ("Li Mei", "Mei Li", True), ("Li Mei", "LIMEI", True),
        ("李梅", "护士李梅来了", True), ("李 梅", "李梅", True), ("李", "李", False),
        ("Bo", "Bobo", False), ("Bob", "bob", True), ("Li Mei", "Li saw Mei", False),
    ],
)  # fmt: skip
def test_a_name_is_found_however_it_is_written(tmp_path: Path, name: str, written: str, found: bool) -> None:
    (tmp_path / "notes.txt").write_text(f"- {written} -", "utf-8")
    assert bool(names_in(tmp_path, [name])) == found
    assert too_short([name]) == (name in ("李", "Bo"))


def test_a_name_in_the_key_of_a_command_is_found(tmp_path: Path) -> None:
    topic = f"tandem/robot-1/operator/{operator_chunk('李 梅')}/command"
    with McapRecorder(tmp_path / "link.mcap", {}) as recorder:
        recorder.put(topic, b"\x01", 1)
    assert names_in(tmp_path, ["李梅"]) == [f"{tmp_path / 'link.mcap'}: {topic}"]


def test_a_damaged_seal_does_not_keep_a_subject(tmp_path: Path) -> None:
    sealed, damaged = begin(tmp_path, CUP, "k7pd"), begin(tmp_path, CUP, "k7pd")
    head = seal(sealed.path)
    (damaged.path / "seal.json").write_text("{")
    assert delete_subject(tmp_path, "k7pd").heads == (head,)
    assert not (tmp_path / "sub-k7pd").exists()


def test_a_deleted_subject_is_no_participant_and_no_zip_file_stays_in_the_study(tmp_path: Path) -> None:
    begin(tmp_path, CUP, "k7pd")
    (tmp_path / "participants.tsv").write_text("participant_id\tage\nsub-k7pd\t40\nsub-k7pd2\t50\n")
    with pytest.raises(TandemError, match="outside of it"):
        export_subject(tmp_path, "k7pd", tmp_path / "deep" / "k7pd.zip")
    delete_subject(tmp_path, "k7pd")
    assert (tmp_path / "participants.tsv").read_text() == "participant_id\tage\nsub-k7pd2\t50\n"
    left = [path for path in tmp_path.rglob("*") if path.is_file() and path.name != RECEIPTS]
    assert [path.name for path in left] == ["participants.tsv"]


def test_one_subject_is_handed_out_and_deleted_and_the_others_stay(tmp_path: Path) -> None:
    root = tmp_path / "study"
    mine, others = begin(root, CUP, "k7pd"), begin(root, CUP, "m2qa")
    head = seal(mine.path)
    out = tmp_path / "k7pd.zip"
    assert export_subject(root, "k7pd", out) == 3
    with zipfile.ZipFile(out) as archive:
        assert all(name.startswith("sub-k7pd/ses-01/") for name in archive.namelist())
    with pytest.raises(TandemError, match="is there already"):
        export_subject(root, "k7pd", out)
    receipt = delete_subject(root, "k7pd")
    assert (receipt.files, receipt.heads) == (3, (head,))
    assert not mine.path.exists()
    assert others.path.exists()
    assert json.loads((root / RECEIPTS).read_text())["subject"] == "k7pd"
    with pytest.raises(TandemError, match="no such subject"):
        delete_subject(root, "k7pd")


def test_a_line_that_a_full_disk_cut_off_costs_itself_alone(tmp_path: Path) -> None:
    session = begin(tmp_path, CUP, "k7pd")
    say_under_way(session)
    session.next_step()
    new = NewMarks(session.path, all_of_them=True)
    with (session.path / MARKS).open("ab") as stream:
        stream.write('{"wall_ns": 1, "text": "落'.encode()[:-1])
    session.mark(MarkKind.EVENT, "after")
    assert [mark.text for mark in new.take()] == ["rest", "after"]
    found = session_under_way(tmp_path)
    assert found is not None, "what its subject has consented to still counts"
    assert found.step == "rest"
    with pytest.raises(TandemError, match="line 2 is no mark"):
        session.marks()
    session.mark(MarkKind.END, "done")
    assert session_under_way(tmp_path) is None


def test_a_mark_that_the_disk_took_in_part_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = os.write
    monkeypatch.setattr(os, "write", lambda at, data: whole(at, data[:5]))
    with pytest.raises(OSError, match="No space left"):
        write_mark(tmp_path, MarkKind.EVENT, "x")


def test_a_session_that_is_named_and_cannot_be_read_is_not_taken_for_none(tmp_path: Path) -> None:
    session = begin(tmp_path, CUP, "k7pd")
    say_under_way(session)
    (session.path / "session.json").write_text("{")
    with pytest.raises(TandemError, match="there is no session"):
        session_under_way(tmp_path)
    shutil.rmtree(session.path)
    assert session_under_way(tmp_path) is None, "it was deleted"
