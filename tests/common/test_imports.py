"""deploy → master, slave → common, and never the other way; read from the source, nothing is run."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
MAY_IMPORT = {
    "common": {"common"},
    "master": {"common", "master"},
    "slave": {"common", "slave"},
    "deploy": {"common", "master", "slave", "deploy"},
}
PURE = [
    "common/wire/codec.py",
    "common/wire/fields.py",
    "common/wire/messages.py",
    "common/process/pacing.py",
    "common/process/mailbox.py",
    "common/latency/stages.py",
    "common/clock_sync/estimator.py",
    "common/clock_sync/exchange.py",
    "common/quaternion.py",
    "common/skeleton/kinematics.py",
    "common/reach/nearest.py",
    "common/reach/chart.py",
    "common/reach/reach.py",
    "common/wire/topics.py",
    "common/process/throttle.py",
    "common/link/endpoint.py",
]
RIM = {"asyncio", "zenoh", "can", "time", "socket", "uvloop", "mujoco", "serial"}


def imported(source: str, package: str) -> Iterator[tuple[int, str]]:
    """Line and top-level name of every import, wherever it stands."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield node.lineno, alias.name.partition(".")[0]
        elif isinstance(node, ast.ImportFrom):
            yield node.lineno, package if node.level else (node.module or "").partition(".")[0]
        elif (
            isinstance(node, ast.Call)
            and getattr(node.func, "attr", getattr(node.func, "id", "")) in {"import_module", "__import__"}
            and node.args
            and isinstance(node.args[0], ast.Constant)
        ):
            yield node.lineno, str(node.args[0].value).partition(".")[0]


def violations(root: Path) -> list[str]:
    """Every import between the folders that goes the wrong way, or reaches into the tests."""
    wrong = []
    for folder, allowed in MAY_IMPORT.items():
        for path in sorted((root / folder).rglob("*.py")):
            for line, name in imported(path.read_text("utf-8"), folder):
                if name in {*MAY_IMPORT, "tests"} - allowed:
                    wrong.append(f"{path.relative_to(root)}:{line} imports {name}")
    return wrong


def test_imports_go_one_way() -> None:
    assert violations(ROOT) == []


def test_every_folder_with_code_is_watched() -> None:
    assert all(any((ROOT / folder).rglob("*.py")) for folder in MAY_IMPORT)
    packages = {p.parent.name for p in ROOT.glob("*/__init__.py")}
    assert packages <= set(MAY_IMPORT)


@pytest.mark.parametrize("path", PURE)
def test_the_pure_files_touch_no_rim(path: str) -> None:
    names = {name for _, name in imported((ROOT / path).read_text("utf-8"), "common")}
    assert names & RIM == set()


@pytest.mark.parametrize(
    ("path", "source", "said"),
    [
        ("common/a.py", "import master.app", "imports master"),
        ("common/deep/a.py", "def f():\n    from slave import guard", "deep/a.py:2 imports slave"),
        ("common/a.py", "if TYPE_CHECKING:\n    from deploy.cli import app", "imports deploy"),
        ("master/a.py", "from slave.guard import Guard", "imports slave"),
        ("slave/a.py", "import common, master", "imports master"),
        ("slave/a.py", "import importlib\nimportlib.import_module('deploy.cli')", "imports deploy"),
        ("deploy/a.py", "from tests.fakes import bus", "imports tests"),
    ],
)
def test_a_planted_wrong_import_is_found(tmp_path: Path, path: str, source: str, said: str) -> None:
    planted = tmp_path / path
    planted.parent.mkdir(parents=True)
    planted.write_text(source, "utf-8")
    (found,) = violations(tmp_path)
    assert said in found


def test_right_imports_are_let_be(tmp_path: Path) -> None:
    (tmp_path / "deploy").mkdir()
    (tmp_path / "deploy/a.py").write_text("import common.x, master, slave\nfrom . import b\nimport canopen")
    assert violations(tmp_path) == []
