"""Columns of a workload, and what a record of it must hold, follow from types of results and from what is timed."""

from typing import NotRequired, TypedDict

from experiments.harness.column import REAL, WHOLE, Column, middle
from experiments.harness.records import Record
from experiments.workloads import WORKLOADS
from experiments.workloads.typed import HELP, Least, Times, Unlisted, Worst, columns_of, needs_of, workload


class Results(TypedDict):
    lost: Worst
    ids_equal: Least
    images: int
    embree_bytes: NotRequired[int]
    threads: Unlisted
    pictures: dict[str, str]


def first_frame(record: Record) -> float | None:
    return record.samples["own"][0]


def test_a_number_is_a_column_and_whatever_need_not_be_there_is_marked():
    columns = columns_of(Results)
    assert [(one.name, one.dtype, one.over, one.help) for one in columns] == [
        ("lost", WHOLE, max, HELP["lost"]), ("ids_equal", REAL, min, HELP["ids_equal"]),
        ("images", WHOLE, middle, HELP["images"]), ("embree_bytes", WHOLE, middle, HELP["embree_bytes"]),
    ]  # fmt: skip
    assert needs_of(Results) == ("lost", "ids_equal", "images", "threads", "pictures")


def test_samples_and_columns_follow_from_quantities_in_their_order():
    times = Times(
        {"first_frame_time_s": first_frame, "speedup{}": ("single", "own"), "packets_render_time{}_s": "packets"},
        judged="own", optional=frozenset(("packets",)), chosen=("speedup{}",),
    )  # fmt: skip
    made = workload("toy", __name__, lambda record: "", times, Results)
    ends = ("", "_low", "_high", "_half", "_rest", "_rest_low", "_rest_high")
    assert [one.name for one in made.columns[:8]] == ["first_frame_time_s", *(f"speedup{end}" for end in ends)]
    assert (made.samples(None), made.optional, made.judged) == ({"own", "single"}, {"packets"}, "own")
    record = Record("0", "ok", None, {}, {}, {}, {"own": [1.0, 2.0, 4.0], "single": [4.0, 4.0, 4.0]}, {"lost": 3})
    values = {one.name: one.value([record]) for one in made.columns}
    assert (values["first_frame_time_s"], values["speedup"], values["lost"]) == (1.0, 2.0, 3)
    assert values["packets_render_time_s"] is None


def test_what_is_counted_a_second_is_no_time():
    assert (Column("rays_per_s", REAL).shown, Column("atlas_s", REAL).shown) == (("", 1.0), ("ms", 1e3))


def test_every_help_is_of_a_column():
    assert set(HELP) <= {column.name for one in WORKLOADS for column in one.columns}
