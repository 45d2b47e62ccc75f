"""Methods of tracing that fail on demand."""

from __future__ import annotations


class Injected(Exception):
    """What a test makes go wrong."""


class Failing:
    """A method, or what it prepared, that raises in a step, "prepare" or "draw", when its work is done or before."""

    def __init__(self, inner, step, after=True):
        self._inner, self._step, self._after = inner, step, after

    def __getattr__(self, name):
        return getattr(self._inner, name)

    def prepare(self, *arguments):
        prepared = self._do("prepare", *arguments)
        return Failing(prepared, self._step, self._after)

    def draw(self, *arguments):
        self._do("draw", *arguments)

    def _do(self, step, *arguments):
        if step == self._step and not self._after:
            raise Injected
        done = getattr(self._inner, step)(*arguments)
        if step == self._step:
            raise Injected
        return done
