from hypothesis import given
from hypothesis import strategies as st

from common.wire.lease import lease_id


@given(st.integers(1, 2**63 - 1))
def test_an_id_fits_32_bits_is_stable_and_is_not_the_token(token: int) -> None:
    assert 0 < lease_id(token) < 2**32
    assert lease_id(token) == lease_id(token)


def test_no_lease_has_no_id_and_leases_differ() -> None:
    assert lease_id(0) == 0
    assert len({lease_id(token) for token in range(1, 10_000)}) == 9_999
