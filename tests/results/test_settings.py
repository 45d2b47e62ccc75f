"""Points that differ in a setting never look alike: not in the table, a figure, the page or the terminal."""

import io
import re
from dataclasses import fields, replace
from functools import cache

import pytest
from rich.console import Console

from experiments.harness.configuration import Chosen
from experiments.harness.options import types_of
from experiments.harness.point import Point
from experiments.harness.points import measure, plan_points
from experiments.methods import METHODS
from experiments.methods.aligned import ALIGNED
from experiments.report.facts import workload_tables
from experiments.results.settings import settings, settings_that_vary
from experiments.results.table import columns, make_table, make_tables
from experiments.results.terminal import print_sweep
from experiments.workloads import WORKLOADS
from experiments.workloads.build.shown import build_figure
from experiments.workloads.frame.grid_figure import grid_times
from experiments.workloads.frame_figures import split_times
from experiments.workloads.memory.shown import memory_figure
from tests.drawn import build_row, make_rows, memory_row, time_row
from tests.results.test_table import MEASURED
from tests.sweeps import Runner, configuration

OTHERWISE_TOLD = {"scene", "triangles", "method", "workload", "scene_source", "scene_path"}
OPTIONS = {"options", "workload_options"}
EFFORT = {"process", "rounds", "warmup", "frame_budget_s", "time_limit_s", "memory_budget_gib"}

OF_OPTIONS = {one.name: (one, kind.options) for kind in (*WORKLOADS, *METHODS) for one in fields(kind.options)}


def two_values(name):
    """Two values of an option, as a record's configuration holds them, and the second one in words."""
    field, options = OF_OPTIONS[name]
    hint, null, words = str(types_of(options)[name]), field.metadata.get("null"), name.replace("_", " ")
    if name.endswith("_sha256"):
        return "ab" * 32, "cd" * 32, f"{words.removesuffix(' sha256')} cdcdcdcd"
    if "bool" in hint:
        return False, True, f"{words} on"
    kinds = {"int": (1, 8), "float": (0.25, 0.5), "str": ("one", "two")}
    first, second = (field.metadata.get("choices") or next(kinds[kind] for kind in kinds if kind in hint))[:2]
    return (first, second, f"{words} {second}") if null is None else (first, None, f"{words} {null}")


# The same of settings that are no options, and where the words are others.
VALUES = {name: two_values(name) for name in OF_OPTIONS if name not in ("offsets", "geometry")} | {
    "subdivided": (0, 1, "subdivided 1"),
    "copies": (1, 4, "copies 4"),
    "mesh_sha256": ("ab" * 32, "cd" * 32, "mesh cdcdcdcd"),
    "view": ("own", "turned", "view turned"),
    "eye": ([0.0, 1.0, 3.0], [0.0, 1.5, 3.0], "eye 0, 1.5, 3"),
    "target": ([0.0, 1.0, 0.0], [0.0, 1.0, 1e-9], "target 0, 1, 1e-09"),
    "up": ([0.0, 1.0, 0.0], [0.0, 1.0, 1.0], "up 0, 1, 1"),
    "fov_y_degrees": (45.0, 60.0, "fov y degrees 60.0"),
    "width": (8, 16, "width 16"),
    "height": (4, 8, "height 8"),
    "offsets": ([[0.5, 0.5]], [[0.5, 0.5], [0.0, 1.0]], "offsets [[0.5, 0.5], [0.0, 1.0]]"),
    "geometry": ("copied", "instanced", "instanced geometry"),
    "threads": (1, 2, "threads 2"),
    "build_quality": ("high", "low", "low build quality"),
    "ties": ("any", "lowest", "ties lowest"),
    "instruction_set": ("avx2", "sse4.2", "instructions up to sse4.2"),
}
BESIDE = ("separate", "visible_first", "rasteriser", *(f"{name}_primary" for name in MEASURED.samples))
"""Series that workloads have of their own."""
WORKLOAD_OF = {field.name: workload for workload in WORKLOADS for field in fields(workload.options)}
OF_METHODS = {field.name for method in METHODS for field in fields(method.options)}
QUICK = ("split_x", "culling", "packet_width", "view", "threads", "what", "bounces", "shaft_cells")
"""Settings of points, methods and workloads, of each some; where drawing takes time, those of the others are slow."""


def cases(names):
    return pytest.mark.parametrize(
        "name", [pytest.param(name, marks=() if name in QUICK else pytest.mark.slow) for name in names]
    )


def records_that_differ_in(name):
    return [record_with(name, value) for value in VALUES[name][:2]]


@cache
def tables_that_differ_in(name):
    return make_tables(records_that_differ_in(name))


@cache
def headings_of(name):
    """The columns of the page where points differ in this setting."""
    (table,) = workload_tables(tables_that_differ_in(name).points)
    return [heading.name for heading in table.headings]


def record_with(name, value):
    """A record of the aligned method, or of the first that has the option, and of the workload that knows the
    setting."""
    values = {key: first for key, (first, _, _) in VALUES.items()} | {name: value}
    workload = WORKLOAD_OF.get(name, WORKLOADS[0])
    configuration = MEASURED.configuration | {
        key: values[key] for key in values.keys() - OF_METHODS - WORKLOAD_OF.keys()
    }
    method = next((one for one in METHODS if one.has(name) and not ALIGNED.has(name)), ALIGNED)
    configuration["method"] = method.name
    configuration["method_options"] = {field.name: values[field.name] for field in fields(method.options)}
    configuration["workload"] = workload.name
    configuration["workload_options"] = {field.name: values[field.name] for field in fields(workload.options)}
    ran = {key: result for key, result in MEASURED.results.items() if key != "packet_width"}
    samples = MEASURED.samples | {key: [1.0, 2.0, 3.0] for key in BESIDE}
    return replace(MEASURED, point_id=str(value), configuration=configuration, samples=samples, results=ran)


def test_every_field_of_a_point_and_every_option_is_a_setting_or_told_otherwise_or_effort():
    assert {field.name for field in fields(Point)} - set(settings()) == OTHERWISE_TOLD | OPTIONS | EFFORT
    assert OF_METHODS | WORKLOAD_OF.keys() <= set(settings()) == VALUES.keys() <= columns().keys()


@pytest.mark.parametrize("method", [one for one in METHODS if fields(one.options)], ids=lambda method: method.name)
def test_an_option_left_open_does_not_pass_for_one_that_the_method_lacks(tmp_path, method):
    (planned,) = plan_points([configuration(tmp_path, method=Chosen(method, method.options()))])
    row = make_table([measure(planned, Runner())]).iloc[0]
    assert row[[field.name for field in fields(method.options)]].notna().all()


@pytest.mark.parametrize("name", settings())
def test_two_points_that_differ_in_a_setting_differ_in_its_column(name):
    table = tables_that_differ_in(name).points
    assert settings_that_vary(table) == [name]
    assert settings_that_vary(table, besides=[name]) == []


@cases(settings())
def test_the_page_shows_a_setting_that_varies_and_the_terminal_a_best_for_each_of_its_values(tmp_path, name):
    assert headings_of(name).count(name) == 1
    assert name in OF_METHODS or name not in headings_of("split_x")
    shown = io.StringIO()
    print_sweep(tables_that_differ_in(name), tmp_path, Console(file=shown, width=200))
    rows = [line for line in shown.getvalue().splitlines() if re.match(r"[ │]+box[ ,]", line)]
    assert len(rows) == (1 if name in ("split_x", "split_y") else 2) or name in ("offsets", "sample_rays")


TOLD_APART = {"split_x", "geometry", "culling"}
"""By the figures themselves: the abscissa, and a line for each."""
OF_OTHERS = {name for name in OF_METHODS if not ALIGNED.has(name)}
FIGURES = {
    split_times: (time_row(1, 0.08), set(settings()) - TOLD_APART - WORKLOAD_OF.keys() - OF_OTHERS),
    build_figure: (build_row(1, 0.02, 0.04), ("threads", "build_quality")),
    memory_figure: (memory_row(1, 1, 2, 3), ("threads", "build_quality")),
    grid_times: (time_row(1, 0.08), ("threads", "build_quality")),
}


@pytest.mark.parametrize("make", FIGURES, ids=lambda make: make.__name__)
def test_a_figure_over_splits_draws_no_two_values_of_a_setting_as_one_line(make):
    row, names = FIGURES[make]
    for name in names:
        figure = make(make_rows(*(row | {name: value} for value in tables_that_differ_in(name).points[name])))
        # A map of each form of the geometry stands beside the other.
        titles = {re.sub(", culling (off|on)$", "", panel.title) for panel in figure.panels}
        assert len(titles) == 2, name
        assert f"box (10 triangles), {VALUES[name][2]}" in titles


def test_another_view_is_not_told_again_by_its_eye():
    first, second = records_that_differ_in("view")
    second.configuration["eye"] = [9.0, 9.0, 9.0]
    assert settings_that_vary(make_table([first, second])) == ["view"]


def test_instances_are_not_told_again_by_their_culling():
    first, second = records_that_differ_in("geometry")
    first.configuration["method_options"]["culling"] = True
    assert settings_that_vary(make_table([first, second])) == ["geometry"]


def test_a_method_that_lacks_a_setting_is_told_so(tmp_path):
    pixel = MEASURED.configuration | {"method": "pixel", "method_options": {"packet_width": 8}}
    shown = io.StringIO()
    records = [*records_that_differ_in("packet_rows"), replace(MEASURED, configuration=pixel)]
    print_sweep(make_tables(records), tmp_path, Console(file=shown, width=200))
    assert "packets of 8 per pixel, no packet rows" in shown.getvalue()


def test_scenes_have_cameras_of_their_own():
    first, second = records_that_differ_in("eye")
    second.configuration["scene"] = "another"
    assert settings_that_vary(make_table([first, second])) == []
