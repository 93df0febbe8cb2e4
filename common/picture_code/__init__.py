"""A time, drawn as black and white cells that a camera can see: how old a shown picture is, measured. Pure.

A screen before the camera (or a card in the simulated scene) shows the time as such a code; whoever gets the
picture reads the code back, and knows when what the picture shows was true, whatever the stamps say.
"""

from common.picture_code.cells import CODE_STEP_NS, count_of, resolve_ns
from common.picture_code.draw import draw_code, paste_code
from common.picture_code.read import FoundCode, newest_ns, read_codes

__all__ = [
    "CODE_STEP_NS", "FoundCode", "count_of", "draw_code", "newest_ns", "paste_code", "read_codes",
    "resolve_ns",
]  # fmt: skip
