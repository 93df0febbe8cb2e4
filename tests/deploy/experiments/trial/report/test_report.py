"""The report's files: what stands in them, that they stand alone, and that equal findings are equal files."""

from __future__ import annotations

import base64
import csv
import html.parser
import io
import json
import re
from dataclasses import replace
from pathlib import Path

import pytest

from deploy.experiments.trial.cell.folder import Folder
from deploy.experiments.trial.cell.result import Cell, CellStatus
from deploy.experiments.trial.report.write import CSV, HTML, JSON, write
from tests.deploy.experiments.trial.made_up import PLAN, cell, cells


def reported(path: Path, kept: list[Cell]) -> Folder:
    folder = Folder(path)
    folder.begin(PLAN)
    for one in kept:
        folder.keep(one)
    write(folder)
    return folder


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return reported(tmp_path_factory.mktemp("whole"), cells()).path


class Links(html.parser.HTMLParser):
    """Collects whatever a browser would fetch, and checks that elements close."""

    def __init__(self) -> None:
        super().__init__()
        self.fetched: list[str] = []
        self.open: list[str] = []
        self.tags: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        self.fetched += [v for k, v in attrs if k in ("src", "href", "srcset", "action", "data") and v]
        if tag not in ("meta", "link", "img", "br"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_the_page_is_well_formed_and_fetches_nothing(whole: Path) -> None:
    page, links = (whole / HTML).read_text("utf-8"), Links()
    links.feed(page)
    assert links.open == []
    assert links.fetched
    assert all(link.startswith("data:") for link in links.fetched)
    assert "script" not in links.tags
    assert "@import" not in page
    assert "url(" not in page


def test_every_setup_and_every_measured_figure_stands_in_the_page(whole: Path) -> None:
    page = re.sub(r"<[^>]+>", " ", (whole / HTML).read_text("utf-8"))
    for words in (
        "same-instant tracking error",
        "tcp with predict over 4g",
        "Reaching and handing over",
        "bound ±",
    ):
        assert words in page
    assert "This report is incomplete" not in page
    assert "held after 7.2 s" in page


def test_pictures_have_labelled_axes_and_need_nothing_from_elsewhere(whole: Path) -> None:
    page = (whole / HTML).read_text("utf-8")
    pictures = [base64.b64decode(p).decode("utf-8") for p in re.findall(r"svg\+xml;base64,([^\"]+)", page)]
    assert len(pictures) == 6
    assert any("one way, ms" in p for p in pictures)
    assert any("RMSE, °" in p for p in pictures)
    for picture in pictures:
        hrefs = re.findall(r'(?:href|src)="([^"]*)"', picture)
        assert all(href.startswith("#") for href in hrefs)


def test_reports_of_the_same_cells_compare_as_the_same_text(whole: Path, tmp_path: Path) -> None:
    other = reported(tmp_path / "other", list(reversed(cells()))).path
    one, two = (json.loads((path / JSON).read_text("utf-8"))["compared"] for path in (whole, other))
    assert json.dumps(one) == json.dumps(two)
    assert (whole / CSV).read_bytes() == (other / CSV).read_bytes()
    text = json.dumps(one)
    assert not re.search(r"20\d\d-\d\d-\d\d", text), "a time would make every report differ"
    assert (whole / JSON).read_text("utf-8") == json.dumps(
        json.loads((whole / JSON).read_text("utf-8")), indent=1, sort_keys=True, ensure_ascii=False
    ) + "\n"


def test_json_holds_medians_with_their_spread(whole: Path) -> None:
    setups = json.loads((whole / JSON).read_text("utf-8"))["compared"]["setups"]
    assert len(setups) == 8
    figure = setups["4g/udp/predict"]["figures"]["rmse_deg"]
    assert figure["low"] <= figure["median"] <= figure["high"]
    assert figure["count"] == 3


def test_csv_has_a_line_a_cell_and_no_figure_where_none_was_measured(tmp_path: Path) -> None:
    first, second, *_ = PLAN.cells()
    folder = reported(
        tmp_path, [cell(first), Cell(second, CellStatus.FAILED, "the robot, alas, is not heard")]
    )
    lines = list(csv.DictReader(io.StringIO((folder.path / CSV).read_text("utf-8"))))
    assert len(lines) == 2
    by_status = {line["status"]: line for line in lines}
    assert float(by_status["done"]["rmse_deg"]) > 0
    assert by_status["failed"]["rmse_deg"] == ""
    assert by_status["failed"]["why"] == "the robot, alas, is not heard"


def test_what_is_not_there_yet_is_said(tmp_path: Path) -> None:
    some = reported(tmp_path / "some", cells()[:5])
    assert "5 of 24 cells are there" in (some.path / HTML).read_text("utf-8")
    none = reported(tmp_path / "none", [])
    assert "0 of 24 cells are there" in (none.path / HTML).read_text("utf-8")


def test_words_from_a_robot_are_text_and_never_markup(tmp_path: Path) -> None:
    foul = Cell(PLAN.cells()[0], CellStatus.FAILED, "<script>alert('x')</script>")
    page = (reported(tmp_path, [foul]).path / HTML).read_text("utf-8")
    assert "<script>" not in page
    assert "&lt;script&gt;" in page


def test_what_never_came_is_told_in_the_verdict(tmp_path: Path) -> None:
    never = [replace(one, values={**one.values, "flow_s": None}) for one in cells()]
    folder = reported(tmp_path, never).path
    assert "never" in (folder / HTML).read_text("utf-8").partition("What suits which care task")[0]
    targets = json.loads((folder / JSON).read_text("utf-8"))["compared"]["targets"]
    [flow] = [target for target in targets if target["name"] == "flow after outage"]
    assert (flow["measured"], flow["outcome"], flow["why"][:6]) == (None, "failed", "8 of 8")


def test_cells_that_failed_are_told_in_the_verdict(tmp_path: Path) -> None:
    first, *others = cells()
    folder = reported(tmp_path, [Cell(first.key, CellStatus.FAILED, "the robot is not heard"), *others]).path
    verdict = (folder / HTML).read_text("utf-8").partition("What suits which care task")[0]
    assert "1 failed" in verdict
    compared = json.loads((folder / JSON).read_text("utf-8"))["compared"]
    [flow] = [target for target in compared["targets"] if target["name"] == "flow after outage"]
    assert (flow["outcome"], "1 failed" in flow["why"]) == ("failed", True)


def test_a_busy_machine_is_told_on_top(tmp_path: Path) -> None:
    one = cell(PLAN.cells()[0])
    busy = Cell(one.key, one.status, values={**one.values, "ticks_missed": 7.25})
    assert "missed up to 7.2 %" in (reported(tmp_path, [busy]).path / HTML).read_text("utf-8")
