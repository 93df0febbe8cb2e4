"""How far another host's clock is from ours: the estimate (estimator), the talk it rests on (exchange)."""

from common.offset.estimator import NEVER_MEASURED, UNKNOWN_NS, Offset, OffsetEstimator
from common.offset.exchange import MasterExchange, SlaveExchange

__all__ = ["NEVER_MEASURED", "UNKNOWN_NS", "MasterExchange", "Offset", "OffsetEstimator", "SlaveExchange"]
