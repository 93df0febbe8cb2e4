"""The link between the two sides: one Zenoh session a process, live data first, nothing kept.

Read zenoh_config, inbox (foreign thread → loop), queries, waiting, link, then session.
"""

from common.link.link import Link
from common.link.link_session import LinkSession
from common.link.session import open_link, open_session

__all__ = ["Link", "LinkSession", "open_link", "open_session"]
