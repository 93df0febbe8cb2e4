"""The import graph of the four packages, read from the source; no module is run."""

import ast
from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = ("common", "master", "slave", "deploy")
Graph = Mapping[str, set[str]]


@dataclass(frozen=True, slots=True)
class Import:
    """One import, or one string that names a module of the tree, such as in `python -m NAME`."""

    source: str
    target: str
    line: int


class SourceTree:
    """Every module of the four packages below `root`, parsed."""

    def __init__(self, root: Path = ROOT) -> None:
        self.root = root
        self.paths = {
            _module(path.relative_to(root)): path
            for package in PACKAGES
            for path in sorted((root / package).rglob("*.py"))
        }
        self.parsed = {name: ast.parse(path.read_text("utf-8")) for name, path in self.paths.items()}

    @cached_property
    def imports(self) -> list[Import]:
        """Every import in the tree, wherever it stands; those under `TYPE_CHECKING` count too."""
        return [
            Import(name, target, line)
            for name in self.paths
            for line, target in sorted(set(self._targets(name)))
        ]

    @cached_property
    def files(self) -> Graph:
        """Which module imports which other module of the tree."""
        graph: defaultdict[str, set[str]] = defaultdict(set)
        for each in self.imports:
            if each.target in self.paths and each.target != each.source:
                graph[each.source].add(each.target)
        return graph

    @cached_property
    def folders(self) -> Graph:
        """Which folder imports which other folder; a folder is the files directly in it."""
        graph: defaultdict[str, set[str]] = defaultdict(set)
        for source, targets in self.files.items():
            graph[self.folder(source)] |= {self.folder(target) for target in targets} - {self.folder(source)}
        return graph

    def folder(self, module: str) -> str:
        """The folder of a module, as a path from the root."""
        return self.paths[module].parent.relative_to(self.root).as_posix()

    def where(self, module: str) -> str:
        """The file of a module, as a path from the root."""
        return self.paths[module].relative_to(self.root).as_posix()

    def _targets(self, name: str) -> Iterator[tuple[int, str]]:
        is_package = self.paths[name].name == "__init__.py"
        package = name.split(".") if is_package else name.split(".")[:-1]
        for node in ast.walk(self.parsed[name]):
            if isinstance(node, ast.Import):
                yield from ((node.lineno, alias.name) for alias in node.names)
            elif isinstance(node, ast.ImportFrom):
                above = package[: len(package) - node.level + 1] if node.level else []
                base = ".".join([*above, *([node.module] if node.module else [])])
                for alias in node.names:
                    inner = f"{base}.{alias.name}"
                    yield node.lineno, inner if inner in self.paths else base
            elif isinstance(node, ast.Constant) and node.value in self.paths and "." in str(node.value):
                yield node.lineno, str(node.value)
            elif isinstance(node, ast.Call) and _called(node) in {"import_module", "__import__"}:
                yield from ((node.lineno, str(a.value)) for a in node.args if isinstance(a, ast.Constant))


def circles(graph: Graph) -> list[tuple[str, ...]]:
    """The sets of nodes that reach one another (strongly connected, by Tarjan), each sorted."""
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found: list[tuple[str, ...]] = []

    def visit(node: str) -> None:
        index[node] = low[node] = len(index)
        stack.append(node)
        for target in sorted(graph.get(node, ())):
            if target not in index:
                visit(target)
                low[node] = min(low[node], low[target])
            elif target in stack:
                low[node] = min(low[node], index[target])
        if low[node] == index[node]:
            ring = stack[stack.index(node) :]
            del stack[stack.index(node) :]
            if len(ring) > 1:
                found.append(tuple(sorted(ring)))

    for node in sorted(graph):
        if node not in index:
            visit(node)
    return sorted(found)


def _module(path: Path) -> str:
    parts = path.with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _called(node: ast.Call) -> str:
    return str(getattr(node.func, "attr", getattr(node.func, "id", "")))
