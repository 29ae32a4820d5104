"""Contexts with one thread of BLAS, which may overlap in several threads."""

from concurrent.futures import ThreadPoolExecutor

import numpy.linalg  # noqa: F401
import pytest
import scipy.linalg  # noqa: F401
from threadpoolctl import threadpool_info, threadpool_limits

from hipuq.threads import one_thread


def numbers() -> set[int]:
    return {one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"}


@pytest.fixture(autouse=True)
def two_threads():
    with threadpool_limits(limits=2, user_api="blas"):
        assert numbers() == {2}
        yield


@pytest.mark.parametrize("first", [0, 1])
def test_contexts_overlap_in_two_threads(first):
    """Whichever is left first, the limit stays until both are, and then goes."""
    with ThreadPoolExecutor(1) as one, ThreadPoolExecutor(1) as other:
        threads, contexts = (one, other), (one_thread(), one_thread())
        for thread, context in zip(threads, contexts, strict=True):
            thread.submit(context.__enter__).result()
            assert numbers() == {1}
        for k, left in ((first, {1}), (1 - first, {2})):
            threads[k].submit(contexts[k].__exit__, None, None, None).result()
            assert numbers() == left


def test_what_was_there_comes_back_after_an_error():
    with pytest.raises(ArithmeticError), one_thread(), one_thread():
        assert numbers() == {1}
        raise ArithmeticError
    assert numbers() == {2}


def test_many_threads_at_once():
    def work(_: int) -> bool:
        with one_thread():
            return numbers() == {1}

    with ThreadPoolExecutor(4) as pool:
        assert all(pool.map(work, range(40)))
    assert numbers() == {2}
