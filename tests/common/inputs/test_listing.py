"""Which devices there are, and which of them is meant."""

from __future__ import annotations

from pathlib import Path

import pytest

from common.inputs.listing import ListedDevice, choose, list_devices

B = 48


def listed(path: str, name: str, *keys: int, place: str = "usb-1") -> ListedDevice:
    return ListedDevice(path, name, place, frozenset(keys), readable=True, repeats=False)


def put(root: Path, number: int, name: str, keys: str, ev: str = "3") -> None:
    device = root / f"sys/class/input/event{number}/device"
    (device / "capabilities").mkdir(parents=True)
    for file, text in (
        ("name", name),
        ("phys", f"usb-{number}"),
        ("capabilities/key", keys),
        ("capabilities/ev", ev),
    ):
        (device / file).write_text(f"{text}\n")
    (root / "dev/input").mkdir(parents=True, exist_ok=True)
    (root / f"dev/input/event{number}").touch()


def test_devices_are_read_from_sysfs_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    put(tmp_path, 10, "a pedal", "1 0 1000000000000", ev="120013")
    put(tmp_path, 9, "a mouse", "30000 0 0 0 0")
    mouse, pedal = list_devices(tmp_path)
    assert mouse == ListedDevice("/dev/input/event9", "a mouse", "usb-9", frozenset({272, 273}), True, False)
    assert pedal == ListedDevice("/dev/input/event10", "a pedal", "usb-10", frozenset({B, 128}), True, True)


def test_no_device_where_the_kernel_has_no_sysfs(tmp_path: Path) -> None:
    assert list_devices(tmp_path) == []


def test_the_device_of_a_name_is_the_one_that_has_the_key() -> None:
    devices = [
        listed("/dev/input/event1", "Foot", 272),
        listed("/dev/input/event2", "Foot", B),
        listed("/x", "Y", B),
    ]
    assert choose(devices, "Foot", {B}) == ("/dev/input/event2", "")


@pytest.mark.parametrize(
    ("devices", "words"),
    [
        ([], "no input device is named 'Foot'"),
        ([listed("/dev/input/event1", "Foot", 272)], "'Foot' has not the keys"),
        (
            [listed("/dev/input/event1", "Foot", B, place="usb-1/2"), listed("/dev/input/event2", "Foot", B)],
            "/dev/input/event1 at usb-1/2, /dev/input/event2 at usb-1; give a path below /dev/input/by-path",
        ),
    ],
)
def test_why_none_can_be_chosen(devices: list[ListedDevice], words: str) -> None:
    path, why = choose(devices, "Foot", {B})
    assert not path
    assert words in why
