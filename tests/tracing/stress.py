"""Four threads that call one object in any order, and what a single thread finds."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Hashable
from typing import Any

import numpy as np

import atra
from atra.exact.surface import shared_pool
from tests.tracing.test_lifetimes import in_threads

SECONDS = float(os.environ.get("ATRA_THREAD_SECONDS", "2"))
"""Least seconds of each test; `ATRA_THREAD_SECONDS=60 pytest -m slow -k test_thread_stress` is the long form."""

MOST_WAIT_S = 120.0
"""Seconds after which a test that gets nowhere fails."""

Call = Callable[[Any, np.random.Generator], Any]
"""A call of the object that all threads share; it checks what that returns."""


class Expected:
    """What a single thread finds, found when it is first asked for."""

    def __init__(self, find: Callable[..., Any]) -> None:
        self._find, self._found, self._lock = find, dict[Hashable, Any](), threading.Lock()

    def __call__(self, *question: Any) -> Any:
        with self._lock:
            if question not in self._found:
                self._found[question] = self._find(*question)
            return self._found[question]


def stress(make: Callable[..., Any], calls: dict[str, Call], refusals: tuple[str, ...] = ("closed",)) -> None:
    """Four threads call the shared object; one call in seventy or so closes it and makes another.

    calls: by name; they go on until ten of the first have succeeded, however busy the machine is. refusals: parts of
    the messages of errors that are right.
    """
    shared_pool(2).run(lambda *worker: None)  # all images share its threads, which stay
    before, current, done = set(threading.enumerate()), [make().__enter__()], []
    end, first = time.monotonic() + SECONDS, next(iter(calls))

    def is_enough() -> bool:
        now = time.monotonic()
        return now > end + MOST_WAIT_S or (now > end and done.count(first) >= 10)

    def work(seed: int) -> None:
        random = np.random.default_rng(seed)
        while not is_enough():
            what = random.choice([*calls, "close"])
            try:
                if what != "close":
                    calls[what](current[0], random)
                    done.append(what)
                elif random.random() < 0.1:
                    current[0].close()
                    current[0] = make().__enter__()
            except atra.AtraError as error:
                if not any(refusal in str(error) for refusal in refusals):
                    raise

    in_threads(*(lambda seed=seed: work(seed) for seed in range(4)), timeout_s=SECONDS + 2 * MOST_WAIT_S)
    assert done.count(first) >= 10, {what: done.count(what) for what in calls}
    current[0].close()
    current.clear()
    for thread in set(threading.enumerate()) - before:
        thread.join(30)
        assert not thread.is_alive()


def any_of(values: tuple[Any, ...], random: np.random.Generator) -> Any:
    return values[random.integers(len(values))]


def rebuild(one: Any, random: np.random.Generator) -> None:
    one.build()


def pose(one: Any, random: np.random.Generator) -> None:
    one.update(one.mesh)
