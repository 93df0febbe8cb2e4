"""Every page's links lead somewhere, and every file that a page names exists."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = sorted(
    page
    for page in ROOT.rglob("*.md")
    if not any(part.startswith(".") for part in page.relative_to(ROOT).parts[:-1])
)
LINK = re.compile(r"(?<!!)\[[^\]]*\]\(([^)\s]+)\)")
FILE = re.compile(r"`([\w./-]+/[\w./-]*\.(?:py|toml|dbc|eds|jinja|md)|[\w-]+\.py)`")


def names() -> list[str]:
    """The pages, as paths from the root."""
    return [page.relative_to(ROOT).as_posix() for page in PAGES]


def anchors(page: Path) -> set[str]:
    """The anchors that GitHub gives the page's headings."""
    headings = re.findall(r"^#+ (.+)$", page.read_text("utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def broken_links(page: Path) -> Iterator[str]:
    """Links to a file or a heading that is not there. Links to other sites are not followed."""
    for target in LINK.findall(page.read_text("utf-8")):
        if re.match(r"[a-z]+:", target):
            continue
        path, _, anchor = target.partition("#")
        to = (page.parent / path).resolve() if path else page
        if not to.exists() or (anchor and to.suffix == ".md" and anchor not in anchors(to)):
            yield target


def missing_files(page: Path) -> Iterator[str]:
    """Source files named in backticks that are neither below the page nor at that path from the root."""
    for name in FILE.findall(page.read_text("utf-8")):
        below = page.parent.rglob(name) if ".." not in name else iter(())
        if not any((base / name).exists() for base in (page.parent, ROOT)) and not any(below):
            yield name


@pytest.mark.parametrize("name", names())
def test_the_links_of_a_page_lead_somewhere(name: str) -> None:
    assert list(broken_links(ROOT / name)) == []


@pytest.mark.parametrize("name", [name for name in names() if name != "CHANGELOG.md"])
def test_the_files_that_a_page_names_exist(name: str) -> None:
    assert list(missing_files(ROOT / name)) == []


def test_a_planted_broken_link_and_a_planted_missing_file_are_found(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(
        "# One\n[a](#one) [b](#two) [c](gone.md) [d](https://x) `page.md` `common/gone.py` `gone.py`"
    )
    assert list(broken_links(page)) == ["#two", "gone.md"]
    assert list(missing_files(page)) == ["common/gone.py", "gone.py"]
