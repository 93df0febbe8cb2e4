"""The figures that may not grow, and the declared path of a sample."""

import pytest

from tests.architecture.figures import MOST_SHARED_NAMES, print_table, shared_class_names
from tests.architecture.imports import ROOT, SourceTree
from tests.architecture.sample import SAMPLE_PATH


def test_class_names_have_one_meaning(tree: SourceTree) -> None:
    names = shared_class_names(tree)
    assert len(names) <= MOST_SHARED_NAMES, names


def test_each_file_of_the_sample_path_is_used_by_another_of_it(tree: SourceTree) -> None:
    assert [path for path in SAMPLE_PATH if not (ROOT / path).is_file()] == []
    modules = {path.removesuffix(".py").replace("/", ".") for path in SAMPLE_PATH}
    used: set[str] = set()
    for module in modules:
        # an import of a package reaches the file that defines what the package offers
        through = {
            file for target in tree.files.get(module, ()) for file in {target, *tree.files.get(target, ())}
        }
        if through & modules:
            used |= {module, *through & modules}
    assert modules - used == set()


def test_the_table_prints(tree: SourceTree, capsys: pytest.CaptureFixture[str]) -> None:
    print_table(tree)
    assert "class names with more than one meaning" in capsys.readouterr().out
