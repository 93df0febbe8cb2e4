from common.process.throttle import Throttle


def test_one_passes_a_period() -> None:
    throttle = Throttle(period_ns=100)
    times = [0, 1, 99, 100, 101, 250, 349, 350]
    assert [t for t in times if throttle.passes(t)] == [0, 100, 250, 350]
