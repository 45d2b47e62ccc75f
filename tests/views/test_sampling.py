"""Offsets within the pixel for successive frames."""

import numpy as np
import pytest

import atra


def test_the_first_offset_is_the_pixel_centre_and_all_lie_in_the_pixel():
    offsets = atra.sub_pixel_offsets(4096)
    np.testing.assert_array_equal(offsets[0], (0.5, 0.5))
    assert offsets.min() >= 0.0
    assert offsets.max() < 1.0


@pytest.mark.parametrize("count", [4, 16, 64, 256])
def test_every_prefix_covers_the_pixel_evenly(count):
    offsets = atra.sub_pixel_offsets(count)
    # Any box with a corner in the origin holds its share of the offsets; at random it would miss by 0.5 / sqrt(n).
    grid = np.linspace(0.1, 1.0, 10)
    shares = [(offsets < (x, y)).all(axis=1).mean() - x * y for x in grid for y in grid]
    assert np.abs(shares).max() < 1.2 * np.log(count + 1) / count
    gaps = np.linalg.norm((offsets[:, None] - offsets + 0.5) % 1 - 0.5, axis=2)[~np.eye(count, dtype=bool)]
    assert gaps.min() > 0.4 / np.sqrt(count)


def test_a_later_start_goes_on_where_the_sequence_stopped():
    np.testing.assert_array_equal(atra.sub_pixel_offsets(5, first=3), atra.sub_pixel_offsets(8)[3:])


@pytest.mark.parametrize("count", [-1, 2.5, "3", None, True])
def test_what_is_no_whole_number_of_at_least_0_is_refused(count):
    with pytest.raises(atra.InputError, match=f"count is {count!r} and first is 0"):
        atra.sub_pixel_offsets(count)
    with pytest.raises(atra.InputError, match=f"count is 8 and first is {count!r}"):
        atra.sub_pixel_offsets(8, first=count)
