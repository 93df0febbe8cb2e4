"""The figures that may not grow, and the declared path of a sample."""

import pytest

from tests.architecture.figures import MOST_SHARED_NAMES, print_table, shared_class_names
from tests.architecture.imports import ROOT, SourceTree
from tests.architecture.sample import SAMPLE_PATH


def test_class_names_have_one_meaning(tree: SourceTree) -> None:
    names = shared_class_names(tree)
    assert len(names) <= MOST_SHARED_NAMES, names


def test_each_file_of_the_sample_path_is_reached_from_a_process(tree: SourceTree) -> None:
    assert [path for path in SAMPLE_PATH if not (ROOT / path).is_file()] == []
    modules = {path.removesuffix(".py").replace("/", ".") for path in SAMPLE_PATH}
    reached: set[str] = set()
    waiting = ["master.app", "slave.app"]
    while waiting:
        module = waiting.pop()
        if module not in reached:
            reached.add(module)
            waiting.extend(tree.files.get(module, ()))
    assert modules - reached == set()
    assert "deploy.cli" not in reached


def test_the_table_prints(tree: SourceTree, capsys: pytest.CaptureFixture[str]) -> None:
    print_table(tree)
    assert "class names with more than one meaning" in capsys.readouterr().out
