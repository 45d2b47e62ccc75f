"""Worker threads: how many run, and on which cores."""

import os
import sys
import threading

import pytest

import atra.compiled.threads
from atra.compiled.threads import WorkerPool

on_linux = pytest.mark.skipif(sys.platform != "linux", reason="only there threads are given cores")


def threads_of(pool, most_threads=99):
    """The native id of each worker of a run in which all are at work together."""
    expected = min(pool.threads, most_threads)
    together, ids = threading.Barrier(expected), dict[int, int]()

    def kernel(worker, counter):
        together.wait(timeout=30)
        ids[worker] = threading.get_native_id()

    pool.run(kernel, most_threads)
    return ids


@pytest.mark.parametrize("most_threads", [1, 2, 99])
def test_a_run_takes_all_threads_but_at_most_so_many_the_caller_among_them(most_threads):
    pool = WorkerPool(3)
    ids = threads_of(pool, most_threads)
    pool.close()
    assert sorted(ids) == list(range(min(3, most_threads)))
    assert ids[0] == threading.get_native_id()
    assert len(set(ids.values())) == len(ids)


@on_linux
def test_other_threads_are_kept_off_the_core_of_the_caller_wherever_it_runs(monkeypatch):
    given = {}
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {2, 5, 7})
    monkeypatch.setattr(os, "sched_setaffinity", given.__setitem__)
    pool = WorkerPool(3)
    ids = threads_of(pool)  # starts the threads, which have no core given before their first run ends
    for core, others in ((5, {2, 7}), (7, {2, 5}), (7, {2, 5})):
        monkeypatch.setattr(atra.compiled.threads, "core_of_caller", lambda core=core: core)
        threads_of(pool)
        assert given == {ids[1]: others, ids[2]: others}
    pool.close()


@on_linux
@pytest.mark.parametrize("cores", [{3}, {3, 4}], ids=["one", "fewer than threads"])
def test_threads_that_are_more_than_cores_may_run_on_all_of_them(cores, monkeypatch):
    given = {}
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: cores)
    monkeypatch.setattr(os, "sched_setaffinity", given.__setitem__)
    monkeypatch.setattr(atra.compiled.threads, "core_of_caller", lambda: 3)
    pool = WorkerPool(3)
    threads_of(pool)
    ids = threads_of(pool)
    pool.close()
    assert given == {ids[1]: cores, ids[2]: cores}


@on_linux
def test_where_cores_may_not_be_chosen_threads_run_all_the_same(monkeypatch):
    def refuse(*_):
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "sched_setaffinity", refuse)
    pool = WorkerPool(2)
    assert threads_of(pool).keys() == threads_of(pool).keys() == {0, 1}
    pool.close()
