"""EDS files of drives, in the forms that makers use, and what a robot's file is refused for."""

from __future__ import annotations

from pathlib import Path

import pytest

from common.config.load import load_config
from common.errors import ConfigError
from common.skeleton import load_skeleton
from deploy.sim.drives.makers import epos
from deploy.sim.drives.wire import EDS
from slave.config import SlaveConfig
from slave.servos.canopen.config import CanopenConfig
from slave.servos.canopen.drive_config import DriveConfig
from slave.servos.canopen.eds import EdsError, read_eds
from slave.servos.canopen.eds_check import checked
from slave.servos.canopen.sdo import Read, Write
from tests.slave.servos.canopen.conftest import Wired

NURSING = load_skeleton("nursing")
JOINT = "left_elbow_pitch"
NEEDED = {
    "1000": ("0x0007", "ro", "0x00020192"), "1016sub1": ("0x0007", "rw", "0"), "1017": ("0x0006", "rw", "0"),
    "6007": ("0x0003", "rw", "0"), "605A": ("0x0003", "rw", "2"), "6040": ("0x0006", "rw", "0"),
    "6041": ("0x0006", "ro", ""), "6060": ("0x0002", "rw", "1"), "6061": ("0x0002", "ro", "1"),
    "6064": ("0x0004", "ro", ""), "607A": ("0x0004", "rw", "0"), "6502": ("0x0007", "ro", "0x3A5"),
}  # fmt: skip
"""A drive's least dictionary: data type, access, default."""
TYPES = {(0x1400, 2), (0x1800, 2)}
PDOS = {
    f"{index:04X}sub{sub}": ("0x0005" if sub == 0 or (index, sub) in TYPES else "0x0007", "rw", "0")
    for index in (0x1400, 0x1600, 0x1800, 0x1A00)
    for sub in range(4)
}


def eds(**changes: tuple[str, str, str] | None) -> str:
    """A file with these entries changed, or left out."""
    entries = {**NEEDED, **PDOS, **{name.removeprefix("o"): entry for name, entry in changes.items()}}
    head = "[DeviceInfo]\nVendorNumber=0x000000FB\nProductNumber=1615855616\n"
    sections = [
        f"[{name}]\nParameterName=x\nObjectType=0x7\nDataType={entry[0]}\nAccessType={entry[1]}\n"
        f"DefaultValue={entry[2]}\n"
        for name, entry in entries.items()
        if entry is not None
    ]
    return "\n".join([head, *sections])


def load(tmp_path: Path, text: str, more: str = "") -> SlaveConfig:
    """A robot of which one joint has a drive with that EDS; all others are simulated."""
    (tmp_path / "drive.eds").write_text(text, "latin-1")
    (tmp_path / "slave.toml").write_text(
        f'robot = "r"\n[link]\nlisten = ["tcp/127.0.0.1:1"]\n[servos.joints]\ncanopen = ["{JOINT}"]\n'
        f'mujoco = ["[!l]*", "left_[!e]*", "left_elbow_roll"]\n[servos.canopen.drives.{JOINT}]\nid = 5\n'
        f'bus = "left"\neds = "drive.eds"\n{more}'
    )
    return load_config(tmp_path / "slave.toml", SlaveConfig)


def test_a_file_with_the_least_that_is_needed_is_taken_and_what_is_missing_known(tmp_path: Path) -> None:
    config = load(tmp_path, eds())
    canopen = config.servos.used(CanopenConfig)
    assert canopen is not None
    share = config.servos.share(CanopenConfig, config.skeleton, config.encoders)
    (settings,) = canopen.settings(share.skeleton)
    assert settings.eds == tmp_path / "drive.eds"
    plan = checked(settings, read_eds(tmp_path / "drive.eds"))
    assert plan.mode == 8
    assert [said.split(":")[0] for said in plan.left_out] == [
        "6065h and 6066h", "607Dh", "6085h", "60C2h",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("changes", "more", "said"),
    [
        ({"o6502": ("0x0007", "ro", "0x0E")}, "", "neither cyclic synchronous position mode (8) nor"),
        ({"o6502": ("0x0007", "ro", "0x40")}, "", "cannot interpolate"),
        ({"o605A": None}, "", "lacks 605Ah (object 605A:0: not in drive.eds)"),
        ({"o1016sub1": None}, "", "cannot notice that the slave has died"),
        ({"o1016sub1": ("0x0006", "rw", "0")}, "", "wrong length: drive.eds says 16 bits"),
        ({"o607A": None}, "", "has no target of its mode (607Ah:0): name the drive's own EDS"),
        ({"o6060": ("0x0002", "ro", "1")}, "", "its configuration: object 6060:0: drive.eds says that"),
        ({"o1600sub0": ("0x0005", "const", "1")}, "", "none of its own takes controlword and target"),
        ({}, "mode = 7\n", "has mode 8 only, by 6502h = 0x3a5: set mode = 8"),
    ],
)  # fmt: skip
def test_a_drive_that_cannot_be_used_is_refused_before_anything_is_opened(
    tmp_path: Path, changes: dict[str, tuple[str, str, str] | None], more: str, said: str
) -> None:
    with pytest.raises(ConfigError) as raised:
        load(tmp_path, eds(**changes), more)
    assert said in str(raised.value)
    assert f"servos.canopen.drives.{JOINT}.eds" in str(raised.value)


@pytest.mark.parametrize("text", ["", "no file of that kind", "[1018]\nObjectType=0x9\n"])
def test_a_file_that_is_none_is_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(ConfigError, match="EDS file"):
        load(tmp_path, text)


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(EdsError, match="a readable EDS file"):
        read_eds(tmp_path / "nothing.eds")


def test_numbers_and_names_are_read_as_makers_write_them(tmp_path: Path) -> None:
    file = tmp_path / "drive.eds"
    file.write_text(
        "[1000]\nObjectType=7\nDataType=7\nAccessType=RO\nDefaultValue=131474\n"
        "[1400]\nObjectType=0x9\nSubNumber=3\n[1400SUB1]\nDataType=0x0007\nDefaultValue=$NODEID + 0x200\n"
        "[1a00Sub0]\nAccessType=const\nDefaultValue=\n[6041]\nAccessType=wo\nParameterValue=017\nDefaultValue=1\n"
        "[Comments]\nLine1=100 % of \xb0\n",
        "latin-1",
    )
    found = read_eds(file)
    assert found.value((0x1000, 0)) == 0x20192
    assert (0x1400, 0) not in found.entries
    assert found.value((0x1400, 1)) == 0x200
    assert found.value((0x1A00, 0)) is None
    assert found.value((0x6041, 0)) == 15
    assert "cannot be read" in found.refusal(Read(0x6041, 0, 0, 0, "x"))
    assert "cannot be written" in found.refusal(Write(0x1A00, 0, 1, 0))
    assert found.vendor is None


def test_the_simulated_drive_s_own_file_fits() -> None:
    drive = CanopenConfig().settings(NURSING)[0]
    assert checked(drive, read_eds(EDS)).left_out == []


def test_a_drive_of_another_maker_than_its_file_says_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "drive.eds"
    file.write_text(eds(), "latin-1")
    drives = CanopenConfig().drives_of(NURSING)
    drives[JOINT] = DriveConfig(id=drives[JOINT].id, bus=drives[JOINT].bus, eds=file)
    wired = Wired(CanopenConfig(drives=drives))
    wired.start()
    wired.until(lambda: wired.drives.failed, 2.0)
    assert (
        "is another drive than its eds says: 1018h:1 is 0x0, drive.eds says 0xfb"
        in (wired.drives.not_running[JOINT])
    )


def test_what_the_file_says_is_not_there_is_not_asked_for(tmp_path: Path) -> None:
    file = tmp_path / "drive.eds"
    file.write_text(eds(), "latin-1")
    drives = CanopenConfig().drives_of(NURSING)
    drives[JOINT] = DriveConfig(id=drives[JOINT].id, bus=drives[JOINT].bus, eds=file)
    wired = Wired(CanopenConfig(drives=drives))
    drive = wired.peer.drives[wired.index(JOINT)]
    drive.become(epos(drive.id))
    wired.start()
    wired.until(lambda: wired.drives.running, 2.0)
    assert "607Dh" in wired.drives.left_out[JOINT], "the drive has it, but its file does not"
    assert drive.value(0x607D, 1) != wired.peer.drives[0].value(0x607D, 1)
