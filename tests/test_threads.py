"""What fits has one thread for matrix products, and leaves the others as they were."""

import inspect

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from joda import compare, refine
from joda.diagnosis.adding import add_effect
from joda.diagnosis.improvement import improved
from joda.diagnosis.learning.term_selection import learn
from joda.diagnosis.verdict import diagnosed
from joda.threads import one_blas_thread


def threads():
    return {one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"}


def test_within_there_is_one_and_afterwards_as_many_as_before():
    np.eye(2) @ np.eye(2)
    with threadpool_limits(3, "blas"):
        before = threads()
        assert one_blas_thread(threads)() == {1}
        assert threads() == before
        with pytest.raises(ZeroDivisionError):
            one_blas_thread(lambda: 1 / 0)()
        assert threads() == before


@pytest.mark.parametrize("function", [add_effect, compare, diagnosed, improved, learn, refine])
def test_whatever_fits_begins_with_that(function):
    made = one_blas_thread(lambda: None)
    assert inspect.unwrap(function) is not function
    assert function.__code__ is made.__code__
