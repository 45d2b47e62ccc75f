"""Time to equal error: the estimate of the error, the time that follows from it, and the figure."""

import numpy as np
import pandas as pd
import pytest

from experiments.light.equal_error import (
    BEFORE,
    FAST,
    MITSUBA,
    OURS,
    Found,
    block_differences,
    errors_figure,
    measured,
    relative_error,
)
from tests.drawn import save


def test_the_error_of_a_picture_is_its_relative_noise():
    random = np.random.default_rng(1)
    noise = 1.0 + 0.2 * random.standard_normal((5, 64, 64, 3))
    assert relative_error(3.0 * noise) == pytest.approx(0.2, rel=0.02)


def test_dark_pixels_count_as_a_fiftieth_of_the_mean():
    pictures = np.ones((2, 10, 10, 1))
    pictures[:, 0] = 0.0
    pictures[0, 0, 0] = 0.01
    # One pixel of a hundred deviates: variance 0.01^2 / 2, over (0.02 x mean)^2.
    mean = pictures.mean()
    assert relative_error(pictures) == pytest.approx(np.sqrt(0.01**2 / 2 / (0.02 * mean) ** 2 / 100))


def test_half_the_error_takes_four_times_as_long():
    found = Found({8: 1.0, 32: 4.0}, {8: 0.2, 32: 0.1}, np.zeros((1, 1, 3)))
    assert found.time_to(0.05) == pytest.approx(16.0)


def test_renderers_take_turns_and_keep_their_own_pictures():
    made = []

    def maker(name, value):
        def make(size):
            while True:
                made.append((name, size))
                yield lambda: np.full((2, 2, 3), value)

        return make

    found = measured({"one": maker("one", 1.0), "other": maker("other", 2.0)})
    assert made == [(name, size) for size in (8, 32) for _ in range(5) for name in ("one", "other")]
    assert {name: one.mean.tolist() for name, one in found.items()} == {
        "one": np.ones((2, 2, 3)).tolist(), "other": np.full((2, 2, 3), 2.0).tolist()
    }  # fmt: skip
    assert set(found["one"].errors.values()) == {0.0}


def test_blocks_that_differ_say_by_how_much():
    one, other = np.ones((32, 32, 3)), np.ones((32, 32, 3))
    one[:16, :16] = 1.1
    assert block_differences(one, other) == pytest.approx(np.array([[0.1, 0.0], [0.0, 0.0]]))


def test_the_figure_has_a_panel_for_each_scene_and_marks_for_each_renderer():
    row = {"threads": 1, "error_of_8": 0.2, "error_of_32": 0.1, "time_of_8_s": 1.0, "time_of_32_s": 4.0}
    renderers = OURS, FAST, BEFORE, *MITSUBA
    rows = [{**row, "scene": scene, "renderer": one} for scene in ("lamp", "window") for one in renderers]
    rows += [{**rows[0], "threads": 2, "scene": "another"}]
    figure = errors_figure(pd.DataFrame(rows))
    assert [panel.title for panel in figure.panels] == ["lamp", "window"]
    for panel in figure.panels:
        marked = [line for line in panel.lines if "marker" in line.style]
        assert [tuple(line.x) for line in marked] == [(1.0, 4.0)] * len(renderers)
        assert [tuple(line.y) for line in marked] == [(20.0, 10.0)] * len(renderers)
    save(figure)
