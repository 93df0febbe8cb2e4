"""Tables of any logger: columns guessed, told, overridden; units converted or asked for; stamps repaired."""

from pathlib import Path

import numpy as np
import pytest

from common.errors import RecordingError
from common.quaternion import Array
from common.recording.formats.columns import meaning
from common.recording.formats.csv_file import parse_units
from common.recording.formats.registry import read_nodes
from common.recording.formats.samples import ReadOptions
from common.recording.node import NodeRecording

from .made import RATE_HZ, G, session, table

S = session(4.0)
READINGS = np.column_stack([S.acc, S.gyr])


@pytest.mark.parametrize(
    ("column", "expected"),
    [
        ("Acc_X", ("", "acc", "x", None)),
        ("accX", ("", "acc", "x", None)),
        ("ax", ("", "acc", "x", None)),
        ("AccX (m/s^2)", ("", "acc", "x", "m/s^2")),
        ("ACC.X [g]", ("", "acc", "x", "g")),
        ("acc_x_g", ("", "acc", "x", "g")),
        ("acc_x_m_s2", ("", "acc", "x", "m/s2")),
        ("linear_acceleration.x", ("", "acc", "x", None)),
        ("gyro_z_dps", ("", "gyr", "z", "dps")),
        ("Gyroscope X (deg/s)", ("", "gyr", "x", "deg/s")),
        ("wz", ("", "gyr", "z", None)),
        ("left_wrist_gyr_y", ("left_wrist", "gyr", "y", None)),
        ("thigh.gyro.y [rad/s]", ("thigh", "gyr", "y", "rad/s")),
        ("mag_x_uT", ("", "mag", "x", "ut")),
        ("Quat_q0", ("", "quat", "0", None)),
        ("qw", ("", "quat", "w", None)),
        ("Timestamp (us)", ("", "time", "", "us")),
        ("time_ms", ("", "time", "", "ms")),
        ("seconds_elapsed", ("", "time", "", "seconds")),
        ("t", ("", "time", "", None)),
    ],
)
def test_what_a_name_says(column: str, expected: tuple[str, str, str, str | None]) -> None:
    found = meaning(column)
    assert found is not None
    assert (found.node, found.quantity, found.axis, found.unit) == expected


@pytest.mark.parametrize(
    "column", ["FreeAcc_X", "Temperature (C)", "PacketCounter", "w", "RSSI", "Mat[1][1]", ""]
)
def test_what_a_name_does_not_say(column: str) -> None:
    assert meaning(column) is None


def read(path: Path, **options: object) -> tuple[NodeRecording, str]:
    found = read_nodes([path], ReadOptions(**options))  # type: ignore[arg-type]
    (node,) = found.nodes.values()
    return node, "\n".join(found.notes)


NAMES = "t,ax,ay,az,gx,gy,gz"


def test_a_unit_in_the_header_is_converted_and_told(tmp_path: Path) -> None:
    names = "time_ms;AccX (g);AccY (g);AccZ (g);GyroX (deg/s);GyroY (deg/s);GyroZ (deg/s)"
    rows = np.column_stack([1e3 * S.time_s, S.acc / G, np.degrees(S.gyr)])
    path = table(tmp_path / "a.csv", names, rows, ";")
    path.write_text(path.read_text().replace(".", ","))  # as a spreadsheet in German writes it
    node, notes = read(path)
    np.testing.assert_allclose(node.acc_m_s2, S.acc, atol=1e-6)
    np.testing.assert_allclose(node.gyr_rad_s, S.gyr, atol=1e-6)
    assert "acc is AccX (g), AccY (g), AccZ (g), in g, converted to m/s^2" in notes
    assert "gyr is GyroX (deg/s), GyroY (deg/s), GyroZ (deg/s), in deg/s, converted to rad/s" in notes


def test_what_is_assumed_is_told_and_can_be_overridden(tmp_path: Path) -> None:
    rows = np.column_stack([1e6 * S.time_s, S.acc / G, np.degrees(S.gyr)])
    path = table(tmp_path / "a.csv", NAMES, rows)
    _, notes = read(path)
    assert "taken as m/s^2 (its name tells no unit)" in notes
    assert "times are t, taken as us by their steps" in notes
    node, _ = read(path, units={"acc": "g", "gyr": "°/s"})
    np.testing.assert_allclose(node.acc_m_s2, S.acc, atol=1e-6)
    np.testing.assert_allclose(node.gyr_rad_s, S.gyr, atol=1e-6)
    # another order of the columns
    node, _ = read(path, columns={"acc": ("az", "ay", "ax")}, units={"acc": "g"})
    np.testing.assert_allclose(node.acc_m_s2, S.acc[:, ::-1], atol=1e-6)


def test_names_that_say_nothing_are_asked_for(tmp_path: Path) -> None:
    path = table(tmp_path / "a.csv", "c0,c1,c2,c3,c4,c5", READINGS)
    with pytest.raises(
        RecordingError, match=r"none of the columns c0, c1, .* give them, as --columns acc=A,B,C"
    ):
        read(path)
    columns = {"acc": ("c0", "c1", "c2"), "gyr": ("c3", "c4", "c5")}
    with pytest.raises(RecordingError, match=r"has no column of times; give one .* or --rate HZ"):
        read(path, columns=columns)
    node, _ = read(path, columns=columns, rate_hz=RATE_HZ)
    np.testing.assert_allclose(node.gyr_rad_s, S.gyr, atol=1e-6)
    with pytest.raises(RecordingError, match="has no column 'c9'; it has c0, c1"):
        read(path, columns={**columns, "acc": ("c0", "c1", "c9")}, rate_hz=RATE_HZ)


def test_two_nodes_in_one_table(tmp_path: Path) -> None:
    names = "time_s," + ",".join(
        f"{n}_{q}_{a}" for n in ("left_hand", "head") for q in ("acc", "gyr") for a in "xyz"
    )
    path = table(tmp_path / "a.csv", names, np.column_stack([S.time_s, READINGS, -READINGS]))
    nodes = read_nodes([path]).nodes
    assert list(nodes) == ["left_hand", "head"]
    np.testing.assert_allclose(nodes["head"].gyr_rad_s, -S.gyr, atol=1e-6)


def spoilt(time: Array, rows: Array, how: str) -> tuple[Array, Array]:
    time = time.copy()
    if how == "duplicate":
        time[200] = time[199]
    elif how == "burst":
        time[100:108] = time[107]
    elif how == "one wrong stamp":
        time[50] = 1.7e9
    elif how == "first stamp":
        time[0] = -1.7e9
    elif how == "gap":
        keep = np.r_[0:150, 170 : len(time)]
        return time[keep], rows[keep]
    return time, rows


@pytest.mark.parametrize(
    ("how", "told"),
    [
        ("duplicate", "1 repeated"),
        ("burst", "repeated"),
        ("one wrong stamp", "1 going back"),
        ("first stamp", "taken as a clock that was set"),
        ("gap", "20 samples are missing"),
    ],
)
def test_no_session_is_lost_to_its_stamps(tmp_path: Path, how: str, told: str) -> None:
    time, rows = spoilt(S.time_s, READINGS, how)
    path = table(tmp_path / "a.csv", NAMES.replace("t,", "time_s,", 1), np.column_stack([time, rows]))
    node, notes = read(path)
    assert told in notes
    missing = np.isnan(node.gyr_rad_s).any(axis=1)
    assert missing.sum() == (20 if how == "gap" else 0)
    np.testing.assert_allclose(node.gyr_rad_s[~missing], rows[:, 3:], atol=1e-6)


def test_torn_lines_are_left_out_and_counted(tmp_path: Path) -> None:
    path = table(tmp_path / "a.csv", NAMES, np.column_stack([S.time_s, READINGS]))
    lines = path.read_text().splitlines()
    lines[100] = lines[100][:20]
    path.write_text("\n".join([*lines, "1.0,2.0"]) + "\n")
    node, notes = read(path)
    assert "2 torn lines left out" in notes
    assert np.isnan(node.gyr_rad_s).any(axis=1).sum() == 1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "expected a line of column names"),
        ("1,2,3\n4,5,6\n7,8,9\n", "expected a line of column names"),
        ("t,ax,ay,az,gx,gy,gz\n0,1,2,3,4,5,6\n", "lines are not rows of 7 numbers"),
        ("t,ax (g),ay (m/s^2),az (g)\n0,1,2,3\n1,1,2,3\n2,1,2,3\n", "tell different units"),
        (
            "t,ax (bar),ay (bar),az (bar)\n0,1,2,3\n1,1,2,3\n2,1,2,3\n",
            "'bar' is no unit of acc; expected one of m/s",
        ),
    ],
)
def test_what_cannot_be_read_is_one_clear_line(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "a.csv"
    path.write_text(text)
    with pytest.raises(RecordingError, match=message) as refused:
        read(path)
    assert str(refused.value).startswith(str(path))
    assert "\n" not in str(refused.value)


def test_units_are_parsed() -> None:
    assert parse_units(["acc=g,gyr=deg/s", "time=ms"]) == {"acc": "g", "gyr": "deg/s", "time": "ms"}
    with pytest.raises(RecordingError, match="--units acc=furlong: expected a quantity and its unit"):
        parse_units(["acc=furlong"])
