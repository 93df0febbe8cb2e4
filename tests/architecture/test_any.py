"""`Any` stays in the adapters of libraries that have no types; everything else is checked by mypy."""

import ast
from pathlib import Path

import pytest

from tests.architecture.imports import SourceTree

ADAPTERS = {
    "common/recording/formats/bags.py": "rosbags",
    "deploy/report/group.py": "typer",
    "deploy/sim/drives/server.py": "canopen",
    "deploy/sim/drives/wire.py": "canopen",
    "master/alarms/player.py": "sounddevice",
    "slave/camera/card.py": "mujoco",
    "slave/camera/room.py": "mujoco",
    "slave/camera/v4l2.py": "linuxpy",
    "slave/servos/dynamixel/bus.py": "dynamixel_sdk",
}
"""The files that may use `Any`, each with the library whose values it takes. typer is typed, but the type of
its context is in a private module."""


def uses_of_any(tree: SourceTree) -> dict[str, list[int]]:
    """The lines that import `Any`, or name it as an attribute of a module, by file."""
    found = {
        tree.where(module): [
            node.lineno
            for node in ast.walk(parsed)
            if isinstance(node, ast.ImportFrom | ast.Attribute) and _names_any(node)
        ]
        for module, parsed in tree.parsed.items()
    }
    return {path: lines for path, lines in found.items() if lines}


def _names_any(node: ast.ImportFrom | ast.Attribute) -> bool:
    if isinstance(node, ast.Attribute):
        return node.attr == "Any"
    return any(alias.name == "Any" for alias in node.names)


def test_only_adapters_use_any(tree: SourceTree) -> None:
    users = uses_of_any(tree)
    assert {path: lines for path, lines in users.items() if path not in ADAPTERS} == {}
    assert [path for path in ADAPTERS if path not in users] == [], (
        "they need Any no more: take them off the list"
    )


def test_each_adapter_imports_its_library(tree: SourceTree) -> None:
    imported = {(tree.where(each.source), each.target.partition(".")[0]) for each in tree.imports}
    assert set(ADAPTERS.items()) - imported == set()


@pytest.mark.parametrize(
    "source",
    [
        "from typing import Any",
        "from typing import TYPE_CHECKING, Any as Whatever",
        "import typing\ntree: typing.Any = 0",
        "def f():\n    import typing as t\n    return t.cast(t.Any, 0)",
    ],
)
def test_a_planted_any_is_found(tmp_path: Path, source: str) -> None:
    folder = tmp_path / "master"
    folder.mkdir()
    (folder / "a.py").write_text(source, "utf-8")
    (folder / "b.py").write_text('"""Any doubt raises CodecError."""', "utf-8")
    assert list(uses_of_any(SourceTree(tmp_path))) == ["master/a.py"]
