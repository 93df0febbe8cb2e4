"""The forms in which makers' tools write EDS and DCF files: one drive in each of them is the same drive.

The forms are those of public files and their readers' bug reports: carriage returns, Latin-1, UTF-8 and
UTF-16 marks, indented lines, comments behind values, quotes, keys and sections in another case, sections that
come twice, lines that are none, `$NodeId` on either side, DCF values, compact arrays and PDOs.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.skeleton import load_skeleton
from slave.servos.canopen.config import CanopenConfig
from slave.servos.canopen.drive_config import DriveConfig
from slave.servos.canopen.eds import Eds, EdsError, read_eds
from slave.servos.canopen.eds_check import checked
from slave.servos.canopen.sdo import Write
from slave.servos.canopen.setup_checks import SetupRefusedError
from tests.slave.servos.canopen.test_eds import NEEDED, PDOS, eds

Form = Callable[[str], bytes]
NURSING = load_skeleton("nursing")
PLAIN = eds(
    o1014=("0x0007", "rw", "$NODEID+0x80"), o1018sub0=("0x0005", "ro", "4"), o6040=("0x0006", "rww", "0")
)


def latin(change: Callable[[str], str]) -> Form:
    return lambda text: change(text).encode("latin-1")


def indented(text: str) -> str:
    return "\n".join(line if line.startswith("[") else f"  \t{line}" for line in text.splitlines())


def commented(text: str) -> str:
    lines = [f"{line} ; as delivered" if "=" in line else line for line in text.splitlines()]
    return "; a tool's own head\n# and another's\n" + "\n".join(lines)


def other_case(text: str) -> str:
    for word in ("DeviceInfo", "DataType", "AccessType", "DefaultValue", "sub", "ObjectType", "VendorNumber"):
        text = text.replace(word, word.upper())
    return text.replace("=rw\n", "=RW\n").replace("=0x", "=0X").replace("$NODEID+0x80", "0x80 + $NodeId")


def junk(text: str) -> str:
    return f"exported on a Monday\n\n{text}\nthe end\n[Comments]\nLines=1\nLine1=100 % of 5 A = 1\n[] \n[x\n"


def twice(text: str) -> str:
    """The tool wrote an object's head again behind its values, and a section that is not one of an object."""
    return f"{text}\n[6041]\nParameterName=Statusword, once more\n[Tools]\nItems=0\n[Tools]\nItems=1\n"


def dcf(text: str) -> str:
    """Values that a person set stand beside the defaults; those that nobody set are empty."""
    text = text.replace("DefaultValue=0x00020192", "DefaultValue=0\nParameterValue=0x00020192")
    return text + "\n[DeviceComissioning]\nNodeID=5\nNodeName=elbow\nBaudrate=1000\n[6060]\nParameterValue=\n"


FORMS: dict[str, Form] = {
    "plain": latin(str),
    "carriage returns": latin(lambda text: text.replace("\n", "\r\n")),
    "Latin-1": latin(lambda text: text.replace("ParameterName=x", "ParameterName=Größe in °")),
    "UTF-8 with its mark": lambda text: text.replace("ParameterName=x", "ParameterName=°").encode(
        "utf-8-sig"
    ),
    "UTF-16": lambda text: text.encode("utf-16"),
    "indented": latin(indented),
    "comments": latin(commented),
    "another case": latin(other_case),
    "junk": latin(junk),
    "twice": latin(twice),
    "quotes": latin(lambda text: text.replace("=0x7\n", '="0x7"\n').replace("=ro\n", '="ro"\n')),
    "DCF": latin(dcf),
    "spaces": latin(lambda text: text.replace("=", " = ").replace("[", "[ ").replace("]", " ]")),
    "no end": latin(lambda text: text.rstrip("\n")),
}


def read(folder: Path, data: bytes, name: str = "drive.eds") -> Eds:
    (folder / name).write_bytes(data)
    return read_eds(folder / name)


@pytest.mark.parametrize("form", FORMS)
def test_a_drive_is_the_same_in_every_form(form: str, tmp_path: Path) -> None:
    expected, found = read(tmp_path, FORMS["plain"](PLAIN)), read(tmp_path, FORMS[form](PLAIN))
    assert found.vendor == 0xFB
    assert found.product == 1615855616
    assert len(found.entries) == len({**NEEDED, **PDOS}) + 2
    for place, entry in expected.entries.items():
        there = found.entries[place]
        assert (there.access, there.bits, there.value) == (entry.access, entry.bits, entry.value), place
    assert found.value((0x1014, 0), 5) == 0x85


def drive(eds: Path, encoder: int | None = None, node_id: int = 5) -> DriveConfig:
    return DriveConfig(id=node_id, bus="left", eds=eds, encoder=encoder)


def left_out(eds: Eds, config: DriveConfig) -> list[str]:
    drives = CanopenConfig().drives_of(NURSING)
    drives["left_elbow_pitch"] = config
    index = NURSING.joint_names.index("left_elbow_pitch")
    return checked(CanopenConfig(drives=drives).settings(NURSING)[index], eds).left_out


COMPACT = """
[1016]
ParameterName=Consumer heartbeat time
ObjectType=0x8
DataType=0x0007
AccessType=rw
CompactSubObj=2
[1016Value]
NrOfEntries=1
2=0x7F0064
[1600]
ObjectType=0x9
DataType=0x0007
AccessType=rw
CompactSubObj=8
[1600Value]
NrOfEntries=2
1=0x60400010
2=0x607A0020
[1600Name]
NrOfEntries=1
1=first
[1A00]
ObjectType=0x8
DataType=0x0007
AccessType=rw
CompactSubObj=8
"""


def test_compact_arrays_are_spread_over_their_subindices(tmp_path: Path) -> None:
    gone = {f"o{name}": None for name in PDOS if name.startswith(("1600", "1A00"))}
    found = read(tmp_path, (eds(o1016sub1=None, **gone) + COMPACT).encode())
    assert found.value((0x1016, 0)) == 2
    assert (found.value((0x1016, 1)), found.value((0x1016, 2))) == (None, 0x7F0064)
    assert found.value((0x1600, 2)) == 0x607A0020
    assert found.refusal(Write(0x1600, 0, 1, 0)) == "", "the number of a mapping's entries is written too"
    assert "cannot be written" in found.refusal(Write(0x1016, 0, 1, 0))
    assert (0x1600, 9) not in found.entries
    assert len(left_out(found, drive(tmp_path / "drive.eds"))) == 4, "as with every subindex by itself"


def test_compact_pdos_have_no_sections_of_their_own(tmp_path: Path) -> None:
    gone = {f"o{name}": None for name in PDOS}
    told = "[DeviceInfo]\nCompactPDO=0x17\nNrOfRXPDO=4\nNrOfTXPDO=0x4\n"
    found = read(tmp_path, (eds(**gone) + told).encode())
    assert found.refusal(Write(0x1403, 2, 1, 1)) == ""
    assert (0x1403, 4) not in found.entries, "bit 3 of 17h is clear"
    assert (0x1404, 1) not in found.entries
    assert len(left_out(found, drive(tmp_path / "drive.eds"))) == 4
    without = read(tmp_path, (eds(**gone)).encode())
    with pytest.raises(SetupRefusedError, match="does not take a PDO mapping"):
        left_out(without, drive(tmp_path / "drive.eds"))


def test_an_object_that_no_pdo_holds_is_not_mapped(tmp_path: Path) -> None:
    text = eds().replace("[6064]\n", "[6064]\nPDOMapping=0\n")
    found = read(tmp_path, text.encode())
    with pytest.raises(SetupRefusedError, match=r"object 6064:0: drive\.eds says that no PDO holds it"):
        left_out(found, drive(tmp_path / "drive.eds"))


def test_limits_that_makers_write_wrong_refuse_nothing(tmp_path: Path) -> None:
    text = eds().replace("[1016sub1]\n", "[1016sub1]\nLowLimit=0\nHighLimit=65535\n")
    assert len(left_out(read(tmp_path, text.encode()), drive(tmp_path / "drive.eds"))) == 4


def test_an_encoder_that_the_drive_has_not_is_refused(tmp_path: Path) -> None:
    found = read(tmp_path, eds().encode())
    with pytest.raises(SetupRefusedError, match=r"has no encoder at the joint, .* \(2000h:0\)"):
        left_out(found, drive(tmp_path / "drive.eds", encoder=0x2000))


@pytest.mark.parametrize("text", ["<?xml version='1.0'?>\n<ISO15745ProfileContainer/>", "\n <x/>"])
def test_xml_is_said_to_be_xml(text: str, tmp_path: Path) -> None:
    with pytest.raises(EdsError, match=r"this is XML \(XDD\): export an EDS"):
        read(tmp_path, text.encode(), "drive.xdd")


@given(data=st.data(), form=st.sampled_from(sorted(FORMS)))
def test_a_torn_file_is_read_or_refused_in_words(
    data: st.DataObject, form: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    whole = bytearray(FORMS[form](PLAIN + COMPACT))
    at = data.draw(st.integers(0, len(whole) - 1))
    torn = whole[: data.draw(st.integers(at, len(whole)))]
    torn[at : at + 4] = data.draw(st.binary(max_size=8))
    folder = tmp_path_factory.mktemp("torn")
    with suppress(EdsError, SetupRefusedError):
        left_out(read(folder, bytes(torn)), drive(folder / "drive.eds"))
