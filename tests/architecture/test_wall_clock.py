"""No time-out counts by the wall clock."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_no_time_out_counts_by_the_wall_clock() -> None:
    """The date of a host may be set at any time: only recordings and logs read it."""
    reads = re.compile(r"\btime\.time(_ns)?\(|\bdatetime\.(now|utcnow|today)\(|from time import .*\btime\b")
    sources = [p for folder in ("common", "master", "slave") for p in (ROOT / folder).rglob("*.py")]
    assert len(sources) > 50
    users = {p.relative_to(ROOT).as_posix() for p in sources if reads.search(p.read_text("utf-8"))}
    # a certificate is valid from one date to another: read once, before anything is opened
    allowed = {"common/link/certificates.py"}
    assert {u for u in users - allowed if not u.startswith("common/recording/")} == set()
