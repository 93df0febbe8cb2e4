"""What each node still wants, by name and figures: a terminal says it in English, a page in its own words."""

from __future__ import annotations

HINTS = {
    "silent": "silent: look at its plug",
    "attitudes": "{found} attitudes",
    "alike": "{found} of {wanted}, all alike: put it upside down, on its edges",
    "turn_on": "{found} of {wanted}; turn it on",
    "keep_still": "{found} of {wanted}; keep still, {left} s",
    "lay_down": "{found} of {wanted}; lay it down",
    "no_magnetometer": "no magnetometer",
    "seen": "{percent} % of all directions",
    "sees": "{percent} % of all directions, {wanted} % wanted",
    "worn": "worn",
    "not_worn": "not moving by itself yet",
    "still": "still, {seconds} s",
    "moves": "moves",
    "neighbours": "moves with its neighbours",
    "moved": "moved enough",
    "moving": "moved {seconds} of {wanted} s",
}
"""English, with places for the figures. The page's own files name each as `calibrate.hint.NAME`."""
