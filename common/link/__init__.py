"""The link between the two sides: one Zenoh session a process, live data first, nothing kept.

Read configuration (what Zenoh is told), inbox (foreign thread → loop), queries, waiting, then session.
"""

from common.link.session import Link, open_link

__all__ = ["Link", "open_link"]
