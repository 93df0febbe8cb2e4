"""When a fault of the simulated suit acts."""

from __future__ import annotations

import math

from pydantic import Field

from common.config.section import Section


class TimeSpan(Section):
    """In seconds since the first SYNC."""

    from_s: float = Field(default=0.0, ge=0.0)
    until_s: float = math.inf
    """Excluded; the default is for good."""

    def includes(self, t_s: float) -> bool:
        """Whether the fault acts at that time."""
        return self.from_s <= t_s < self.until_s
