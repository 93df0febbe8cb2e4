"""The page's words: both languages say the same things, and everything that the page says has words."""

from __future__ import annotations

import gzip
import hashlib
import json
import re
from pathlib import Path

import pytest

from common.skeleton import load_skeleton
from common.skeleton.load import profile_names

CONSOLE = Path(__file__).parents[3] / "deploy" / "console"
PAGE = CONSOLE / "page"
WORDS = {name: json.loads((PAGE / f"{name}.json").read_text("utf-8")) for name in ("en", "zh")}


def test_both_languages_have_the_same_keys_and_places() -> None:
    assert WORDS["en"].keys() == WORDS["zh"].keys()
    for key, words in WORDS["en"].items():
        places = [sorted(re.findall(r"\{(\w+)\}", text)) for text in (words, WORDS["zh"][key])]
        assert places[0] == places[1], key
        assert words.strip(), key
        assert WORDS["zh"][key].strip(), key


def _keys(text: str, pattern: str) -> set[str]:
    return set(re.findall(pattern, text))


def test_every_key_that_the_page_names_has_words() -> None:
    scripts = "".join(path.read_text("utf-8") for path in PAGE.glob("*.js"))
    pages = "".join(path.read_text("utf-8") for path in PAGE.glob("*.html"))
    named = _keys(pages, r'data-(?:t|label)="([^"]+)"') | _keys(scripts, r'\bt\("([^"$]+)"')
    assert named - WORDS["en"].keys() == set()
    states = set(re.findall(r'^  (\w+): "(\w+)",$', (PAGE / "state.js").read_text("utf-8"), re.MULTILINE))
    for _, state in states:
        assert {f"state.{state}", f"do.{state}", f"why.{state}"} <= WORDS["en"].keys()


def test_only_a_hardware_stop_is_called_emergency_stop() -> None:
    for words in WORDS.values():
        said = {key for key, text in words.items() if re.search(r"emergency|急停", text, re.IGNORECASE)}
        assert said == {"stop.hardware"}


@pytest.mark.parametrize("profile", profile_names())
def test_every_part_of_a_name_has_words(profile: str) -> None:
    skeleton = load_skeleton(profile)
    parts = {part for name in (*skeleton.joint_names, *skeleton.segment_names) for part in name.split("_")}
    assert {part for part in parts if f"name.{part}" not in WORDS["zh"]} == set()


def modules(page: Path) -> set[str]:
    """All that a page may load, imports of imports too."""
    found, left = set[str](), ["app"]
    own = re.findall(rf'{page.stem}: "\./(\w+)\.js"', (PAGE / "app.js").read_text("utf-8"))
    left += own
    while left:
        name = left.pop()
        if name not in found:
            found.add(name)
            left += re.findall(r'(?:from|import\() ?"\./(\w+)\.js"', (PAGE / f"{name}.js").read_text("utf-8"))
    return found


@pytest.mark.parametrize(
    "page", [path for path in PAGE.glob("*.html") if "part of" in path.read_text("utf-8")]
)
def test_a_page_loads_at_most_sixteen_modules(page: Path) -> None:
    assert 8 < len(modules(page)) <= 16, page.name


def test_no_address_of_another_host() -> None:
    for path in (*PAGE.iterdir(), *(CONSOLE / "vendor").glob("*.css")):
        addresses = re.findall(r"https?://[^\s\"'`)]+", path.read_text("utf-8"))
        assert [a for a in addresses if not a.startswith("http://www.w3.org/")] == [], path.name


def test_the_libraries_are_what_their_sums_say() -> None:
    for line in (CONSOLE / "vendor" / "SHA256SUMS").read_text("utf-8").splitlines():
        digest, name = line.split()
        assert hashlib.sha256((CONSOLE / "vendor" / name).read_bytes()).hexdigest() == digest
        assert (CONSOLE / "vendor" / f"{name.split('.')[0]}.LICENSE").is_file()


def test_the_whole_page_is_small() -> None:
    """All that a browser loads, compressed as the console sends it: 250 kB at most."""
    files = [*PAGE.glob("*"), *(CONSOLE / "vendor").glob("*.js"), *(CONSOLE / "vendor").glob("*.css")]
    assert sum(len(gzip.compress(path.read_bytes(), 6)) for path in files) < 250_000
