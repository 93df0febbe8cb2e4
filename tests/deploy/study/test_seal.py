"""A seal names the file and the part that was changed, whatever was changed."""

from __future__ import annotations

import json
import random
import shutil
import threading
from pathlib import Path

import pytest
from typer.testing import CliRunner

from common.errors import TandemError
from common.recording import McapRecorder
from deploy import cli
from deploy.study.blocks import BLOCK, blocks_of
from deploy.study.seal import SEAL, seal, signer, verify

NOW_NS = 1_700_000_000_000_000_000


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("made")
    (folder / "session.json").write_text('{"subject": "k7pd"}')
    (folder / "deep").mkdir()
    (folder / "deep" / "notes.txt").write_bytes(random.Random(1).randbytes(3 * BLOCK + 5))
    wall_ns = NOW_NS
    with McapRecorder(folder / "master.mcap", {"role": "master"}, 0.001, wall=lambda: wall_ns) as recorder:
        for number in range(30):
            wall_ns = NOW_NS + number * 100_000_000
            recorder.put("suit/frames", random.Random(number).randbytes(500), number)
            while recorder.counters.written < number:
                threading.Event().wait(0.001)
    return folder


@pytest.fixture
def folder(made: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(made, tmp_path / "session"))


def test_a_sealed_folder_is_as_it_was(folder: Path) -> None:
    head = seal(folder)
    assert verify(folder) == (head, [])
    assert verify(folder, head)[1] == []
    with pytest.raises(TandemError, match="sealed already"):
        seal(folder)


def test_blocks_cover_a_file_without_a_gap(folder: Path) -> None:
    for name in ("master.mcap", "deep/notes.txt", "session.json"):
        at = 0
        for block in blocks_of(folder / name):
            assert block.offset == at
            at += block.length
        assert at == (folder / name).stat().st_size
    chunks = [block for block in blocks_of(folder / "master.mcap") if block.times_ns is not None]
    assert len(chunks) > 10
    assert chunks[0].times_ns is not None
    assert chunks[0].times_ns[0] == NOW_NS


@pytest.mark.parametrize("name", ["master.mcap", "deep/notes.txt", "session.json"])
@pytest.mark.parametrize("seed", range(8))
def test_one_changed_byte_is_placed(folder: Path, name: str, seed: int) -> None:
    seal(folder)
    blocks = blocks_of(folder / name)
    data = bytearray((folder / name).read_bytes())
    place = random.Random(seed).randrange(len(data))
    data[place] ^= 1 << seed
    (folder / name).write_bytes(data)
    _, [broken] = verify(folder)
    assert broken.name == name
    assert broken.offset is not None
    assert broken.length is not None
    assert broken.offset <= place < broken.offset + broken.length
    chunk = next(b for b in blocks if b.offset <= place < b.offset + b.length)
    assert ("chunk of messages" in broken.words) == (chunk.times_ns is not None and name == "master.mcap")


def test_what_is_missing_added_cut_or_grown_is_named(folder: Path) -> None:
    seal(folder)
    (folder / "session.json").unlink()
    (folder / "more.txt").write_text("later")
    with (folder / "master.mcap").open("ab") as stream:
        stream.write(b"x")
    found = {broken.name: broken.words for broken in verify(folder)[1]}
    assert found["session.json"] == "is missing"
    assert found["more.txt"] == "was added after sealing"
    assert "bytes, was sealed with" in found["master.mcap"]


@pytest.mark.parametrize("name", [".hidden", "deep/.hidden", "deep/seal.json", ".kept/notes.txt"])
def test_hidden_files_and_inner_seals_are_sealed(folder: Path, name: str) -> None:
    (folder / ".kept").mkdir()
    (folder / name).write_text("a")
    seal(folder)
    (folder / name).write_text("b")
    assert [broken.name for broken in verify(folder)[1]] == [name]
    (folder / name).unlink()
    assert [(broken.name, broken.words) for broken in verify(folder)[1]] == [(name, "is missing")]


def test_a_hidden_file_or_a_link_that_was_added_is_named(folder: Path) -> None:
    seal(folder)
    (folder / ".more").write_text("later")
    (folder / "link").symlink_to("nowhere")
    (folder / "other").symlink_to(folder.parent)
    assert [broken.name for broken in verify(folder)[1]] == [".more", "link", "other"]


def test_a_renamed_file_is_missing_and_added(folder: Path) -> None:
    seal(folder)
    (folder / "session.json").rename(folder / "another.json")
    assert [broken.name for broken in verify(folder)[1]] == ["another.json", "session.json"]


def test_a_link_is_not_sealed_and_none_stands_for_a_file(folder: Path, tmp_path: Path) -> None:
    (folder / "link").symlink_to(folder / "session.json")
    with pytest.raises(TandemError, match="is a link"):
        seal(folder)
    (folder / "link").unlink()
    seal(folder)
    (folder / "session.json").rename(tmp_path / "moved.json")
    (folder / "session.json").symlink_to(tmp_path / "moved.json")
    assert [broken.words for broken in verify(folder)[1]] == ["is a link now, and was a file"]


@pytest.mark.parametrize("what", ["sealed", "times"])
def test_the_time_of_the_seal_and_of_each_chunk_are_sealed(folder: Path, what: str) -> None:
    seal(folder)
    tree = json.loads((folder / SEAL).read_text())
    if what == "sealed":
        tree["sealed"] = "2020-01-01T00:00:00Z"
    else:
        blocks = next(file for file in tree["files"] if file["name"] == "master.mcap")["blocks"]
        next(block for block in blocks if block["times_ns"])["times_ns"][0] += 1
    (folder / SEAL).write_text(json.dumps(tree))
    assert [broken.name for broken in verify(folder)[1]] == [SEAL]


def test_a_name_that_is_no_text_is_sealed(folder: Path) -> None:
    (folder / "\udcff.bin").write_bytes(b"a")
    seal(folder)
    assert verify(folder)[1] == []
    (folder / "\udcff.bin").write_bytes(b"b")
    assert len(verify(folder)[1]) == 1


def test_a_changed_seal_and_a_new_seal_are_seen(folder: Path) -> None:
    head = seal(folder)
    tree = json.loads((folder / SEAL).read_text())
    tree["files"][0]["blocks"][0]["sha256"] = "0" * 64
    (folder / SEAL).write_text(json.dumps(tree))
    assert [b.name for b in verify(folder)[1]].count(SEAL) == 1
    (folder / SEAL).unlink()
    (folder / "session.json").write_text('{"subject": "another"}')
    again = seal(folder)
    assert verify(folder)[1] == [], "nothing in the folder shows it: the head noted elsewhere does"
    assert again != head
    assert [b.name for b in verify(folder, head)[1]] == [SEAL]


@pytest.mark.parametrize(
    "text", ["", "[]", "{}", '{"version": 1, "head": "x", "files": [{}]}', '{"version": 7}']
)
def test_what_is_no_seal_is_refused(folder: Path, text: str) -> None:
    (folder / SEAL).write_text(text)
    with pytest.raises(TandemError):
        verify(folder)


def test_a_folder_without_a_seal_or_files(tmp_path: Path) -> None:
    with pytest.raises(TandemError, match="not sealed"):
        verify(tmp_path)
    with pytest.raises(TandemError, match="no files"):
        seal(tmp_path)


def test_a_signature_is_the_host_s_and_of_this_head(
    folder: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    keys = tmp_path_factory.mktemp("keys")
    for command in (
        ("authority", keys),
        ("make", keys, "operator:nurse-1"),
        ("make", keys, "operator:other"),
    ):
        made = CliRunner().invoke(cli.app, ["keys", *map(str, command)])
        assert made.exit_code == 0, made.output
    seal(folder, key=keys / "operator-nurse-1.key")
    assert signer(folder) == "operator:nurse-1"
    assert verify(folder)[1] == []
    assert verify(folder, by="operator:nurse-1")[1] == []
    [other] = verify(folder, by="operator:other")[1]
    assert other.words == "signed by operator:nurse-1, and operator:other is expected"
    written = json.loads((folder / SEAL).read_text())
    stripped = {key: value for key, value in written.items() if key not in ("signature", "certificate")}
    (folder / SEAL).write_text(json.dumps(stripped))
    assert verify(folder)[1] == [], "nobody expects a signature"
    for found in (verify(folder, signed=True)[1], verify(folder, by="operator:nurse-1")[1]):
        [unsigned] = found
        assert unsigned.words == "unsigned, and a signature is expected"
    for forged in (
        {**written, "certificate": (keys / "operator-other.pem").read_text()},
        {**written, "signature": "00" + written["signature"][2:]},
        {**written, "signature": "no hex"},
        {**written, "certificate": "none"},
    ):
        (folder / SEAL).write_text(json.dumps(forged))
        assert signer(folder) is None
        assert [broken.name for broken in verify(folder)[1]] == [SEAL]


def test_a_key_that_cannot_sign_seals_nothing(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(TandemError, match="cannot be read"):
        seal(folder, key=tmp_path / "none.key")
    assert not (folder / SEAL).exists()
