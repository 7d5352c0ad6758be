from wetwell.services.lease.tenure import Lease, Tenure


def test_a_lease_is_taken_when_it_is_over_and_its_token_counts_up():
    first = Lease().taken("a", 100.0, 2.0)
    assert (first.holder, first.token, first.since_s, first.expires_s) == ("a", 1, 100.0, 102.0)
    assert first.taken("b", 101.999, 2.0) is None
    assert first.taken("a", 101.0, 2.0) is None  # nor twice by the same
    assert first.taken("b", 102.0, 2.0) == Lease("b", 2, 102.0, 104.0)


def test_a_lease_is_renewed_by_its_token_alone():
    first = Lease().taken("a", 100.0, 2.0)
    assert first.renewed(1, 101.0, 2.0) == Lease("a", 1, 100.0, 103.0)
    assert first.renewed(1, 500.0, 2.0).expires_s == 502.0  # over, but nobody took it
    assert first.renewed(1, 50.0, 2.0).expires_s == 102.0  # a clock of the server that was set back shortens nothing
    assert first.taken("b", 200.0, 2.0).renewed(1, 200.1, 2.0) is None


def test_a_lease_that_was_released_can_be_taken_at_once_and_not_by_the_same_token():
    released = Lease().taken("a", 100.0, 2.0).released(1)
    assert released.taken("b", 100.0, 2.0).token == 2
    assert released.taken("b", 100.0, 2.0).released(1) is None


def test_a_tenure_ends_before_its_lease_whatever_the_answer_took():
    tenure = Tenure.asked(1, asked_s=7.0, ttl_s=2.0)
    assert not tenure.is_over(8.9)
    assert tenure.is_over(8.99)
