"""How far another host's clock is from ours: the estimate (estimator), the talk it rests on (exchange)."""

from common.clock_sync.best import ROUND_TRIP, BestOffset
from common.clock_sync.estimator import (
    ANY_CLOCKS,
    NEVER_MEASURED,
    RAW_CLOCKS,
    UNKNOWN_NS,
    Offset,
    OffsetEstimator,
    RateLaw,
)
from common.clock_sync.exchange import MasterExchange, SlaveExchange

__all__ = [
    "ANY_CLOCKS",
    "NEVER_MEASURED",
    "RAW_CLOCKS",
    "ROUND_TRIP",
    "UNKNOWN_NS",
    "BestOffset",
    "MasterExchange",
    "Offset",
    "OffsetEstimator",
    "RateLaw",
    "SlaveExchange",
]
