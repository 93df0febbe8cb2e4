"""Questions and answers of chosen sizes, to find the largest message that the path to a robot carries. Pure.

Some paths, such as tunnels whose ICMP is filtered, drop large packets silently. Then small messages
pass, and a stream of large ones, such as video over tcp, stalls everything on the same connection.
"""

from __future__ import annotations

from common.errors import CodecError

_SIZE_BYTES = 4
LARGEST_BYTES = 16_384
"""No answer is larger, whatever is asked for."""


def probe(question_bytes: int, answer_bytes: int) -> bytes:
    """A question of so many bytes (4 at least) that asks for an answer of so many."""
    return answer_bytes.to_bytes(_SIZE_BYTES, "big") + bytes(max(0, question_bytes - _SIZE_BYTES))


def answer_probe(question: bytes) -> bytes:
    """As many bytes as asked for. Raises CodecError where the question holds no size."""
    if len(question) < _SIZE_BYTES:
        raise CodecError(f"a probe of {len(question)} bytes, expected {_SIZE_BYTES} or more")
    return bytes(min(int.from_bytes(question[:_SIZE_BYTES], "big"), LARGEST_BYTES))
