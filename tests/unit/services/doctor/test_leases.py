"""What the doctor says of pairs."""

import pytest

from wetwell.services.doctor.leases import findings_of
from wetwell.services.lease.table import Member, Standing
from wetwell.services.lease.tenure import Lease

NOW_S = 1e9


def finding(ttl_s, age_s, expires_s=NOW_S + 1.0):
    """Of a pair whose other member was seen to stand by so long ago."""
    members = (Member("a/1", 0.0), Member("b/1", age_s))
    standing = Standing("detector/site", Lease("a/1", 7, NOW_S - 60.0, expires_s), NOW_S, members)
    (found,) = findings_of([standing], ttl_s)
    return found


@pytest.mark.parametrize(("ttl_s", "age_s"), [(1.5, 0.3), (60.0, 12.0)])
def test_a_member_that_looks_as_often_as_the_lease_is_renewed_stands_by(ttl_s, age_s):
    found = finding(ttl_s, age_s)
    assert found.level == "ok"
    assert found.text.endswith("b/1 stands by")


def test_one_that_was_not_seen_within_the_time_of_a_lease_does_not_stand_by():
    found = finding(1.5, 2.0)
    assert found.level == "warning"
    assert found.text.endswith("nobody stands by")
    assert "stands by when it has heard what it missed" in found.advice


def test_a_role_whose_lease_is_over_has_no_owner():
    found = finding(1.5, 0.3, NOW_S)
    assert found.level == "error"
    assert "nobody owns it; b/1 stands by" in found.text
