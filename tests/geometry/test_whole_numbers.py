"""Wherever a whole number is asked for, Python's and NumPy's integers will do, and nothing else."""

import numpy as np
import pytest

import atra
from atra.compiled.threads import resolve_threads
from atra.whole_numbers import is_whole_number
from tests.machine import WIDEST
from tests.meshes import EYE_AT_ORIGIN, random_triangles

MESH = random_triangles(1, 0)
CAMERA = atra.Camera(**EYE_AT_ORIGIN, width=8, height=8)
NO_WHOLE_NUMBERS = [8.0, True, np.True_, "8", (8,)]


def test_integers_are_whole_numbers_and_bools_floats_and_words_are_none():
    assert all(map(is_whole_number, [8, np.int8(8), np.uint64(8)]))
    assert not any(map(is_whole_number, NO_WHOLE_NUMBERS))


@pytest.mark.parametrize("kind", [np.int8, np.uint8])
def test_a_tracer_takes_numpys_integers_and_keeps_pythons(kind):
    with atra.AlignedTracer(
        MESH, CAMERA, (kind(2), kind(1)), packet_width=kind(WIDEST), packet_rows=kind(1), threads=kind(1)
    ) as tracer:
        tracer.trace()
    assert type(tracer.packet_width) is type(tracer.threads) is int
    assert type(resolve_threads(kind(3))) is int


@pytest.mark.parametrize("value", [value for value in NO_WHOLE_NUMBERS if not isinstance(value, tuple)])
@pytest.mark.parametrize("name", ["threads", "packet_width", "packet_rows"])
def test_a_tracer_refuses_anything_else_with_the_value(name, value):
    with pytest.raises(atra.InputError, match=f"{name} is {value!r}, "):
        atra.AlignedTracer(MESH, CAMERA, (2, 1), **{"threads": 1, name: value})
