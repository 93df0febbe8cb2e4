"""What every reader must do: values as they were, one clear error for what is broken, stamps repaired."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from common.errors import RecordingError
from common.quaternion import Array
from common.recording.formats.registry import FORMATS, format_of, read_nodes
from common.recording.node import NodeRecording

from .made import MAKERS, RATE_HZ, Session, foreign_mcap, session

SHORT = session(3.0)
LONG_AGO = session(3.0, start_s=1.7e9)


def values(node: NodeRecording) -> dict[str, Array]:
    found = {
        "acc": node.acc_m_s2, "gyr": node.gyr_rad_s, "mag": node.mag_ut,
        "quat": node.q_world_from_sensor, "position": node.position_m,
    }  # fmt: skip
    return {key: each for key, each in found.items() if each is not None and np.isfinite(each).any()}


def same_rotation(a: Array, b: Array) -> Array:
    """Quaternions a with the sign of b: q and -q are one rotation."""
    out: Array = a * np.sign(np.sum(a * b, axis=1, keepdims=True))
    return out


def check(node: NodeRecording, s: Session, quantities: str) -> None:
    found, expected = values(node), s.node(quantities)
    assert set(found) == set(expected)
    assert node.rate_hz == pytest.approx(RATE_HZ, rel=1e-6)
    for key, wanted in expected.items():
        read = same_rotation(found[key], wanted) if key == "quat" else found[key]
        np.testing.assert_allclose(read, wanted, rtol=1e-6, atol=1e-6, err_msg=key)


def test_each_format_has_a_file_here(tmp_path: Path) -> None:
    read = {format_of(maker(tmp_path, SHORT)).name for maker, _ in MAKERS.values()}
    assert read == {one.name for one in FORMATS}


@pytest.mark.parametrize("kind", MAKERS)
def test_the_values_are_those_of_the_file(kind: str, tmp_path: Path) -> None:
    maker, quantities = MAKERS[kind]
    (node,) = read_nodes([maker(tmp_path, SHORT)]).nodes.values()
    check(node, SHORT, quantities)
    assert node.notes == () or "repaired" not in "".join(node.notes)


@pytest.mark.parametrize(
    "kind", [k for k in MAKERS if k not in ("xsens_txt", "mat", "npz", "suit", "trc", "sto")]
)
def test_seconds_since_1970_lose_no_sample(kind: str, tmp_path: Path) -> None:
    maker, quantities = MAKERS[kind]
    (node,) = read_nodes([maker(tmp_path, LONG_AGO)]).nodes.values()
    check(node, LONG_AGO, quantities)
    assert node.start_s == pytest.approx(1.7e9, abs=1e-3)


@pytest.mark.parametrize("kind", MAKERS)
@settings(max_examples=6)
@given(data=st.data())
def test_a_torn_file_is_read_or_refused_in_words(
    kind: str, data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Cut off, or with bytes that are wrong: one clear error at most, which names the file."""
    folder = tmp_path_factory.mktemp("torn")
    path = MAKERS[kind][0](folder, SHORT)
    file = (
        path
        if path.is_file()
        else data.draw(st.sampled_from(sorted(p for p in path.iterdir() if p.is_file())))
    )
    whole = file.read_bytes()
    if data.draw(st.booleans()):
        file.write_bytes(whole[: data.draw(st.integers(0, len(whole)))])
    else:
        at = data.draw(st.integers(0, len(whole) - 1))
        file.write_bytes(whole[:at] + data.draw(st.binary(min_size=1, max_size=8)) + whole[at + 8 :])
    said = ""
    try:
        assert read_nodes([path]).nodes
    except RecordingError as error:
        said = str(error)
    assert not said or str(path) in said or str(file) in said


def test_what_is_no_recording(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="there is no such file"):
        read_nodes([tmp_path / "none.csv"])
    (tmp_path / "a.docx").write_text("x")
    with pytest.raises(RecordingError, match=r"a\.docx: cannot read a \.docx file; expected .*\.mvnx"):
        read_nodes([tmp_path / "a.docx"])
    with pytest.raises(RecordingError, match="cannot read a folder"):
        read_nodes([tmp_path])
    with pytest.raises(RecordingError, match=r"other\.mcap: "):
        read_nodes([foreign_mcap(tmp_path)])


def test_files_of_one_node_are_joined_and_those_that_clash_are_not(tmp_path: Path) -> None:
    maker, _ = MAKERS["sto"]
    npz = tmp_path / "torso.npz"
    np.savez(npz, acc=SHORT.acc, gyr=SHORT.gyr, t_s=SHORT.time_s)
    sto = maker(tmp_path, SHORT)
    (node,) = read_nodes([npz, sto]).nodes.values()
    check(node, SHORT, "acc gyr quat")
    with pytest.raises(
        RecordingError, match=r"its acc, gyr is in .* too; give one of the two nodes another name"
    ):
        read_nodes([npz, npz])
    read = read_nodes([npz, sto], names={"torso": "chest"})
    assert list(read.nodes) == ["chest"]
    with pytest.raises(RecordingError, match="--name head: there is no such node; there are torso"):
        read_nodes([npz], names={"head": "chest"})
    with pytest.raises(RecordingError, match="cannot be a node's name"):
        read_nodes([npz], names={"torso": "../chest"})
