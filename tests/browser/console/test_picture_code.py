"""The page's code is the same as `common.picture_code`: what one draws the other reads."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import simplejpeg

from common.picture_code import count_of, paste_code, read_codes
from common.picture_code.cells import cells_of

NODE = shutil.which("node")
PAGE = Path(__file__).parents[3] / "deploy" / "console" / "page"
pytestmark = pytest.mark.skipif(NODE is None, reason="no node here: apt install nodejs")


def run(script: str, given: object, tmp_path: Path) -> Any:
    module = tmp_path / "picture_code.mjs"
    shutil.copy(PAGE / "picture_code.js", module)
    head = 'const [code, fs] = [await import(process.argv[1]), await import("node:fs")];\n'
    whole = head + 'const given = JSON.parse(fs.readFileSync(0, "utf8"));\n' + script
    command = [str(NODE), "--input-type=module", "-e", whole, str(module)]
    done = subprocess.run(command, input=json.dumps(given), capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def test_cells_are_the_same(tmp_path: Path) -> None:
    counts = [0, 1, 2**31, 2**32 - 1, *np.random.default_rng(1).integers(0, 2**32, 50).tolist()]
    script = (
        "console.log(JSON.stringify(given.map((n) => [code.cellsOf(n), code.countIn(code.cellsOf(n))])));"
    )
    for count, (cells, back) in zip(counts, run(script, counts, tmp_path), strict=True):
        assert cells == cells_of(count).ravel().tolist()
        assert back == count
    times = [0.0, 1234.56789, 4e11]
    counted = run("console.log(JSON.stringify(given.map(code.countOf)));", times, tmp_path)
    assert counted == [count_of(round(each * 1e6)) for each in times]


def test_pictures_are_read_alike(tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    pictures = []
    for quality in (85, 50, 20):
        for px in (2, 3, 6):
            pixels = rng.integers(60, 220, (120, 160, 3), dtype=np.uint8) // 8 + 150
            for column in (3, 80):
                paste_code(pixels, int(rng.integers(0, 10**15)), (20, column), px) if px < 6 else None
            if px == 6:
                paste_code(pixels, int(rng.integers(0, 10**15)), (30, 40), px)
            jpeg = simplejpeg.encode_jpeg(pixels.astype(np.uint8), quality=quality, colorsubsampling="420")
            pictures.append(simplejpeg.decode_jpeg(jpeg))
    given = [np.dstack((each, np.full(each.shape[:2], 255, np.uint8))).ravel().tolist() for each in pictures]
    script = (
        "const read = (data) => code.readCodes({ data, width: 160, height: 120 });\n"
        "console.log(JSON.stringify(given.map(read)));"
    )
    answers = run(script, given, tmp_path)
    for picture, found in zip(pictures, answers, strict=True):
        wanted = sorted(code.count for code in read_codes(picture))
        assert sorted(found) == wanted
        assert wanted
