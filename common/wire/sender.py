"""Who sent a message, from the key on which it arrived: an operator's keys hold the operator's name. Pure.

Access control permits a certificate's holder only the keys of its own name. So a name in a key is proved
where `[link.access]` is set; a name in a message is only said.
"""

from __future__ import annotations

from urllib.parse import quote, unquote

_NOBODY = "-"


def operator_chunk(operator: str) -> str:
    """The name as a part of a key: whatever Zenoh gives a meaning (`/ * $ ? # @`) is percent-encoded."""
    if operator == _NOBODY:
        return "%2D"
    return quote(operator, safe="", errors="replace") or _NOBODY


def operator_of(key: str) -> str | None:
    """The operator to whom a key belongs; empty: somebody without a name. None: no operator's key.

    Each name has one spelling: `%61nna` is nobody's key, so nobody passes for anna by it.
    """
    parts = key.split("/")
    if len(parts) != 5 or parts[0] != "tandem" or parts[2] != "operator":
        return None
    operator = "" if parts[3] == _NOBODY else unquote(parts[3], errors="replace")
    return operator if operator_chunk(operator) == parts[3] else None
