"""Work for all cores: the cases of a parametrised test are worked on ahead, while earlier ones are judged."""

import contextlib
import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from typing import Any, TypeVar

import pytest

T = TypeVar("T")


def chosen_cases(request: pytest.FixtureRequest, *names: str) -> list[tuple[Any, ...]]:
    """The parameters `names` of the tests of the asking module that were chosen to run, in order."""
    chosen = [
        tuple(item.callspec.params[name] for name in names)
        for item in request.session.items
        if isinstance(item, pytest.Function)
        and item.path == request.path
        and hasattr(item, "callspec")
        and set(names) <= set(item.callspec.params)
    ]
    return list(dict.fromkeys(chosen))


@contextlib.contextmanager
def on_all_cores(work: Callable[..., T], cases: Sequence[tuple[Any, ...]]) -> Iterator[list[Future[T]]]:
    """Call `work` with the arguments of each case, in processes of their own, one for each core."""
    with ProcessPoolExecutor(os.cpu_count(), multiprocessing.get_context("spawn")) as pool:
        futures = [pool.submit(work, *case) for case in cases]
        try:
            yield futures
        finally:
            for future in futures:
                future.cancel()
