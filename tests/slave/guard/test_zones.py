"""`[[guard.zones]]`: mistakes are named, with what was expected; a sound one is accepted."""

from pathlib import Path
from typing import Any

import pytest

from common.config.load import check_config
from common.errors import ConfigError
from common.skeleton import load_skeleton
from slave.guard import GuardConfig

BED: dict[str, Any] = {
    "name": "bed", "shape": "box", "center_m": [0.75, 0.0, 0.6], "size_m": [0.9, 2.0, 0.2], "margin_cm": 5.0
}  # fmt: skip
HEAD: dict[str, Any] = {
    "name": "head", "shape": "sphere", "center_m": [0.6, 0.5, 0.9], "radius_m": 0.12, "max_speed_m_s": 0.25
}  # fmt: skip
WALL: dict[str, Any] = {
    "name": "wall", "shape": "half_space", "point_m": [-0.6, 0.0, 0.0], "free_side": [1.0, 0.0, 0.0]
}  # fmt: skip
RAIL: dict[str, Any] = {
    "name": "rail", "shape": "capsule", "from_m": [0.6, 0, 1], "to_m": [0.6, 1, 1], "radius_m": 0.02
}  # fmt: skip


def lines(*zones: dict[str, Any], **keys: Any) -> list[str]:
    table = {"zones": list(zones), **keys}
    try:
        mistakes = check_config(Path("slave.toml"), table, GuardConfig).mistakes_for(load_skeleton("nursing"))
    except ConfigError as error:
        mistakes = error.mistakes
    return [f"{m.key.removeprefix('guard.')} = {m.value!r}: {m.expected}" for m in mistakes]


def test_sound_zones_are_accepted() -> None:
    assert lines(BED, HEAD, WALL, RAIL) == []
    assert lines({**BED, "center_m": [0.2, 0.0, 0.9], "enter": True, "max_speed_m_s": 0.1}) == []


@pytest.mark.parametrize(
    ("zones", "keys", "key", "expected"),
    [
        ([{**BED, "size_m": [1.0, 2.0]}], {}, "zones.0.size_m", "at least 3 items"),
        ([{**BED, "size_m": [1.0, 2.0, 0.0]}], {}, "zones.0.size_m.2", "greater than 0"),
        ([{**HEAD, "radius_m": "big"}], {}, "zones.0.radius_m", "valid number"),
        ([{**HEAD, "radius": 1.0}], {}, "zones.0.radius", "no such key"),
        ([{**HEAD, "max_speed_m_s": 0.0}], {}, "zones.0.max_speed_m_s", "greater than 0"),
        ([{**BED, "shape": "ball"}], {}, "zones.0.shape", "'box', 'capsule', 'sphere', 'half_space'"),
        ([{**WALL, "free_side": [0.0, 0.0, 0.0]}], {}, "zones.0.free_side", "not all three 0"),
        ([{**RAIL, "to_m": [0.6, 0, 1]}], {}, "zones.0.to_m", "another point"),
        ([BED, {**WALL, "name": "bed"}], {}, "zones.1.name", "another name"),
        ([{**BED, "enter": True}], {}, "zones.0.enter", "max_speed_m_s with it"),
        ([{**BED, "center_m": [0.2, 0.0, 0.9]}], {}, "zones.0", "in the zero pose, "),
        ([{**BED, "margin_cm": 20.0, "center_m": [0.55, 0.0, 0.8]}], {}, "zones.0", "cm from it"),
        ([], {"self_margin_cm": 6.0}, "self_margin_cm", "at most 4.5: in the zero pose, "),
        ([], {"self_margin_cm": -1.0}, "self_margin_cm", "greater than or equal to 0"),
    ],
)  # fmt: skip
def test_a_mistake_names_key_value_and_what_was_expected(
    zones: list[dict[str, Any]], keys: dict[str, Any], key: str, expected: str
) -> None:
    (line,) = lines(*zones, **keys)
    assert line.startswith(f"{key} = ")
    assert expected in line
