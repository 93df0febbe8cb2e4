"""The rooms import one way, without circles; each check finds a planted violation."""

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.architecture.imports import PACKAGES, ROOT, SourceTree, circles
from tests.architecture.rooms import (
    IMPURE,
    ORDER,
    against_the_order,
    between_siblings,
    impure,
)


def test_imports_follow_the_order_of_the_rooms(tree: SourceTree) -> None:
    assert against_the_order(tree) == []


def test_no_circle_of_files_or_folders(tree: SourceTree) -> None:
    assert circles(tree.files) == []
    assert circles(tree.folders) == []


def test_experiments_and_ops_do_not_import_their_siblings(tree: SourceTree) -> None:
    assert between_siblings(tree) == []


def test_only_adapters_touch_a_bus_a_link_or_a_clock(tree: SourceTree) -> None:
    assert impure(tree) == []


def test_every_room_and_adapter_named_is_there() -> None:
    assert [room for level in ORDER for room in level if not any((ROOT / room).glob("**/*.py"))] == []
    assert [pattern for pattern in IMPURE if not any(ROOT.glob(pattern))] == []
    assert {path.parent.name for path in ROOT.glob("*/__init__.py")} <= set(PACKAGES)


Plant = Callable[..., SourceTree]


@pytest.fixture
def plant(tmp_path: Path) -> Plant:
    """Returns a function that writes files, by path, and reads the tree that they make."""

    def write(**files: str) -> SourceTree:
        for name, source in files.items():
            path = tmp_path / (name.replace("__", "/") + ".py")
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(source, "utf-8")
        return SourceTree(tmp_path)

    return write


@pytest.mark.parametrize(
    ("source_file", "source", "target_file"),
    [
        ("common__wire__a", "import master.app", "master__app"),
        ("common__wire__a", "def f():\n    from slave import guard", "slave__guard"),
        ("common__wire__a", "if TYPE_CHECKING:\n    from deploy.cli import app", "deploy__cli"),
        ("common__wire__a", "from common.link import session", "common__link__session"),
        ("common__clock", "from common.wire import codec", "common__wire__codec"),
        ("master__suit__a", "from slave.guard.guard import Guard", "slave__guard__guard"),
        ("master__suit__a", "from master.orientation import vqf", "master__orientation__vqf"),
        ("master__suit__a", "from ..pipeline import Pipeline", "master__pipeline"),
        ("slave__guard__a", "from slave import config", "slave__config"),
        ("slave__guard__a", "import importlib\nimportlib.import_module('deploy.cli')", "deploy__cli"),
        ("slave__camera__a", "command = ['python', '-m', 'deploy.cli']", "deploy__cli"),
        (
            "deploy__harness__a",
            "from deploy.experiments.trial import plan",
            "deploy__experiments__trial__plan",
        ),
        ("deploy__harness__a", "from deploy.calibrate import run", "deploy__calibrate__run"),
        ("deploy__cli", "from tests.fakes import bus", "common__clock"),
    ],
)
def test_a_planted_wrong_import_is_found(
    plant: Plant, source_file: str, source: str, target_file: str
) -> None:
    assert len(against_the_order(plant(**{target_file: "", source_file: source}))) == 1


def test_right_imports_pass(plant: Plant) -> None:
    tree = plant(
        common__clock="",
        master__app="import common.clock",
        deploy__cli="import common.clock, master.app\nfrom . import b\nimport canopen",
    )
    assert against_the_order(tree) == []


def test_a_planted_circle_of_files_is_found(plant: Plant) -> None:
    tree = plant(
        master__a="from master import b",
        master__b="if TYPE_CHECKING:\n    import master.c",
        master__c="import master.a",
    )
    assert circles(tree.files) == [("master.a", "master.b", "master.c")]


def test_a_planted_circle_of_folders_is_found(plant: Plant) -> None:
    tree = plant(
        slave__camera__a="from slave.servos import b",
        slave__servos__b="",
        slave__servos__c="from slave.camera import d",
        slave__camera__d="",
    )
    assert circles(tree.folders) == [("slave/camera", "slave/servos")]


@pytest.mark.parametrize("room", ["experiments", "ops"])
def test_a_planted_import_between_siblings_is_found(plant: Plant, room: str) -> None:
    tree = plant(
        **{
            f"deploy__{room}__one__a": f"from deploy.{room}.one import b\nfrom deploy.{room}.two import c",
            f"deploy__{room}__one__b": "",
            f"deploy__{room}__two__c": "",
        }
    )
    assert between_siblings(tree) == [f"deploy/{room}/one/a.py:2 imports deploy.{room}.two.c"]


def test_a_planted_clock_in_a_pure_file_is_found(plant: Plant) -> None:
    tree = plant(slave__guard__a="import time", slave__camera__b="import asyncio")
    assert impure(tree) == ["slave/guard/a.py:1 imports time"]
