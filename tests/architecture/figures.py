"""`python -m tests.architecture.figures` prints how large and how tangled the code is."""

import ast
from collections import defaultdict
from collections.abc import Mapping, Sequence

from tests.architecture.imports import PACKAGES, SourceTree, circles
from tests.architecture.rooms import against_the_order
from tests.architecture.sample import SAMPLE_PATH

MOST_SHARED_NAMES = 5
"""How many class names may have more than one meaning."""


def lines(tree: SourceTree) -> Mapping[str, int]:
    """Lines of Python in each package."""
    count = dict.fromkeys(PACKAGES, 0)
    for module, path in tree.paths.items():
        count[module.partition(".")[0]] += _line_count(path.read_text("utf-8"))
    return count


def shared_class_names(tree: SourceTree) -> Mapping[str, Sequence[str]]:
    """Names that are classes in more than one file, with those files; private names count too."""
    where: defaultdict[str, set[str]] = defaultdict(set)
    for module, parsed in tree.parsed.items():
        for node in ast.walk(parsed):
            if isinstance(node, ast.ClassDef):
                where[node.name].add(tree.where(module))
    return {name: sorted(files) for name, files in sorted(where.items()) if len(files) > 1}


def longest_files(tree: SourceTree, most: int = 8) -> list[tuple[int, str]]:
    """Line count and path of the longest files."""
    sizes = [
        (_line_count(path.read_text("utf-8")), tree.where(module)) for module, path in tree.paths.items()
    ]
    return sorted(sizes, reverse=True)[:most]


def longest_functions(tree: SourceTree, most: int = 8) -> list[tuple[int, str]]:
    """Line count and place of the longest functions, their docstrings included."""
    sizes = [
        (node.end_lineno - node.lineno + 1, f"{tree.where(module)}:{node.lineno} {node.name}")
        for module, parsed in tree.parsed.items()
        for node in ast.walk(parsed)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and node.end_lineno
    ]
    return sorted(sizes, reverse=True)[:most]


def _line_count(text: str) -> int:
    return text.count("\n")


def _row(title: str, figure: object, target: str) -> None:
    print(f"{title:<42} {figure!s:>9}   {target}")  # noqa: T201


def print_table(tree: SourceTree) -> None:
    """Print the figures, then what stands behind each that is not at its target."""
    count = lines(tree)
    rest = sum(count.values()) - count["deploy"]
    names = shared_class_names(tree)
    files, folders = circles(tree.files), circles(tree.folders)
    _row("figure", "now", "target")
    _row("lines of Python outside tests", sum(count.values()), "≤ 38000")
    for package in PACKAGES:
        _row(f"  {package}/", count[package], "")
    _row("lines of deploy/ over the rest", f"{count['deploy'] / rest:.2f}", "≤ 0.70")
    _row("circles of files / of folders", f"{len(files)} / {len(folders)}", "0 / 0")
    _row("imports against the order", len(against_the_order(tree)), "0")
    _row("files that a sample crosses", len(SAMPLE_PATH), "≤ 20")
    _row("class names with more than one meaning", len(names), "≤ 5")
    for ring in files + folders:
        _row("  circle", "", " ↔ ".join(ring))
    for name, places in names.items():
        _row(f"  {name}", len(places), " ".join(places))
    for title, rows in ("longest files", longest_files(tree)), ("longest functions", longest_functions(tree)):
        _row(title, "lines", "")
        for size, place in rows:
            _row("", size, place)


if __name__ == "__main__":
    print_table(SourceTree())
