"""A record's identity is the code that made it: what its method, its workload and the harness import, no more."""

import ast
import re
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from textwrap import dedent

import pytest

from atra.errors import InputError
from atra.light import Baker
from atra.raster.tracer import RasterTracer
from experiments.harness import identity as identities
from experiments.harness.identity import code_roots, current_environment, decides, identity, read_source
from experiments.harness.point import Point
from experiments.harness.processes.launching import run_worker
from experiments.harness.processes.worker import measure_point
from experiments.harness.rounds import measure_rounds
from experiments.harness.sources import Code, Source
from experiments.light.bake import BAKE
from experiments.methods import METHODS
from experiments.methods.aligned import ALIGNED
from experiments.methods.pixel import PIXEL
from experiments.methods.raster import RASTER
from experiments.workloads import WORKLOADS
from experiments.workloads.frame import FRAME
from tests.folders import ROOT
from tests.harness.processes.test_outcome import POINT
from tests.points import planned

OURS = ("atra", "experiments", "scenes")

Change = Callable[[str], str]


def point_of(method, workload):
    return replace(POINT, method=method, workload=workload)


EVERY_METHOD = [point_of(method, FRAME) for method in METHODS]
EVERY_WORKLOAD = [point_of(ALIGNED, workload) for workload in WORKLOADS]


@cache
def source(module):
    return read_source(module) if module.partition(".")[0] in OURS and decides(module) else None


CODE = Code(source)


@cache
def changed_code(changed, change):
    def read(module):
        found = source(module)
        return found if found is None or module not in changed else replace(found, text=change(found.text))

    return Code(read)


def one_more_line(text):
    return text + "\nCHANGED = 1\n"


@cache
def of_changed_code(point, changed, change):
    return changed_code(changed, change).sha256(code_roots(point))


def sha256(point, changed=(), change=one_more_line):
    """Identity of the code of a point whose modules have these changed sources."""
    return of_changed_code(point, frozenset(changed), change)


def modules(*points):
    return {module for point in points for module in CODE.modules(code_roots(point))}


def test_comments_docstrings_and_blank_lines_anywhere_change_nothing():
    def chatter(text):
        text = text.replace('"""', '"""Said in another way. ', 1)
        return re.sub(r"^(def |class |@|[A-Z_]+ = )", r"\n# a comment\n\n\1", text, flags=re.M) + "\n# the end\n"

    for point in (point_of(ALIGNED, FRAME), point_of(RASTER, BAKE)):
        everywhere = modules(point)
        assert any(chatter(one.text) != one.text for name in everywhere if (one := source(name)))
        assert sha256(point, everywhere, chatter) == sha256(point)


NO_BAKES = [one for one in (*EVERY_METHOD, *EVERY_WORKLOAD) if one.workload.name not in ("bake", "bake_rays")]


@pytest.mark.parametrize(("code", "user", "others"), [
    (RasterTracer, point_of(RASTER, FRAME), [point_of(PIXEL, FRAME)]), (Baker, point_of(RASTER, BAKE), NO_BAKES),
], ids=["rasteriser", "baker"])  # fmt: skip
def test_a_change_of_a_room_of_the_library_makes_other_records_of_its_users_alone(code, user, others):
    room = code.__module__.rpartition(".")[0]
    changed = {name for name in modules(user) - modules(*others) if name.startswith(f"{room}.")}
    assert code.__module__ in changed
    for module in changed:
        assert sha256(user, [module]) != sha256(user)
    assert [sha256(one, changed) for one in others] == [sha256(one) for one in others]


@pytest.mark.parametrize("code", [measure_rounds, measure_point, run_worker, Point], ids=lambda code: code.__name__)
def test_a_change_of_what_the_harness_measures_with_makes_other_records_of_every_point(code):
    for point in (*EVERY_METHOD, *EVERY_WORKLOAD):
        assert sha256(point, [code.__module__]) != sha256(point), (point.method.name, point.workload.name)


MEASURED_WITH: dict[str, set[str]] = {}
"""Workload -> those that import what measures it."""


def test_a_change_of_a_method_or_a_workload_leaves_the_records_of_others_valid():
    for point in EVERY_METHOD:
        measured_beside = {PIXEL.name, point.method.name}  # every frame is measured beside rays per pixel
        others = [one for one in EVERY_METHOD if point.method.name not in measured_beside | {one.method.name}]
        assert sha256(point, [point.method.module]) != sha256(point)
        assert [sha256(one, [point.method.module]) for one in others] == [sha256(one) for one in others]
    for point in EVERY_WORKLOAD:
        measure = point.workload.modules[-1:]
        assert sha256(point, measure) != sha256(point)
        others = [one for one in EVERY_WORKLOAD if not set(measure) & modules(one)]
        assert {one.workload.name for one in EVERY_WORKLOAD} - {one.workload.name for one in others} <= {
            point.workload.name, *MEASURED_WITH.get(point.workload.name, ())
        }  # fmt: skip
        assert [sha256(one, measure) for one in others] == [sha256(one) for one in others]


def test_what_only_tells_of_results_is_no_part_of_a_record():
    """Figures, terminal lines and pages, and the registries, by which everything would lead to everything."""
    found = modules(*EVERY_METHOD, *EVERY_WORKLOAD)
    assert not found & {"experiments.registry", "experiments.methods", "experiments.workloads"}
    rooms = tuple(f"experiments.{name}." for name in ("report", "paper", "commands", "results", "drawing"))
    # What a workload makes a picture with, which its record holds, decides what is in the record.
    names = found - {"experiments.drawing.shading"}
    assert not [name for name in names if name.startswith(rooms) or name.endswith((".shown", ".classification.claims"))]


@pytest.fixture
def identities_with(monkeypatch):
    """Modules -> identities of some points, as if the source of these modules had changed."""
    read, environment = identities.read_source, current_environment()

    def identities_of(points, changed=()):
        def now(module):
            found = read(module)
            return replace(found, text=one_more_line(found.text)) if found and module in changed else found

        with monkeypatch.context() as patched:
            patched.setattr(identities, "read_source", now)
            patched.setattr(identities, "_code", cache(identities._code.__wrapped__))
            patched.setattr(identities, "_sha256", cache(identities._sha256.__wrapped__))
            return [identity(point, environment) for point in points]

    return identities_of


def test_the_identity_of_a_point_follows_its_code(identities_with):
    before = identities_with([POINT, point_of(RASTER, FRAME)])
    after = identities_with([POINT, point_of(RASTER, FRAME)], [POINT.method.module])
    assert after[0] != before[0]
    assert after[1] == before[1]


def test_limits_are_no_part_of_a_point():
    environment = current_environment()
    others = [replace(POINT, time_limit_s=9.0), replace(POINT, memory_budget_gib=9.0)]
    others.append(replace(POINT, memory_budget_gib=None))
    assert {identity(one, environment) for one in others} == {identity(POINT, environment)}
    for name, value in (("rounds", 9), ("warmup", 9), ("frame_budget_s", 9.0), ("process", 9), ("width", 9)):
        assert identity(replace(POINT, **{name: value}), environment) != identity(POINT, environment)


def all_modules(package):
    paths = (ROOT / package.replace(".", "/")).rglob("*.py")
    return {".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__") for path in paths}


def test_colours_and_statistics_are_no_part_of_any_point(identities_with):
    points = (*EVERY_METHOD, *EVERY_WORKLOAD)
    changed = {"experiments.drawing.style"} | all_modules("experiments.results")
    assert "experiments.results.statistics" in changed
    assert identities_with(points, changed) == identities_with(points)


def test_scene_builders_are_no_part_of_a_point_whose_mesh_has_a_hash_and_light_is(identities_with):
    points = [*EVERY_METHOD, *(one for one in EVERY_WORKLOAD if not LIT & {one.workload.name})]
    assert identities_with(points, all_modules("scenes")) == identities_with(points)
    lit = [one for one in EVERY_WORKLOAD if LIT & {one.workload.name}]
    before = identities_with(lit)
    assert identities_with(lit, all_modules("scenes.generated") | {"scenes.loading", "scenes.special"}) == before
    changed = identities_with(lit, ["scenes.lit.lighting"])
    assert all(one != other for one, other in zip(changed, before, strict=True))


LIT = {"render", "bake", "classification"}
"""Workloads that ask what a scene is made of and where its light comes from, which no hash of a mesh tells."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "workload"), [("aligned", "frame"), ("raster", "gather"), ("raster", "bake"), ("bvh", "classification")]
)
def test_every_function_that_runs_while_a_point_is_measured_is_part_of_its_code(method, workload, monkeypatch):
    # A method's file that another test used has left a finder, which Python asks at every import.
    ours_at_imports = [one for one in sys.meta_path if type(one).__module__.startswith("experiments.")]
    monkeypatch.setattr(sys, "meta_path", [one for one in sys.meta_path if one not in ours_at_imports])
    small = {"size": 32, "samples": 1} if workload == "bake" else {}
    point = planned(method, workload, (32, 32), measure={"rounds": 1, "warmup": 0}, asked=small).point
    ran = set()

    def note(frame, event, argument):
        if event == "call" and frame.f_code.co_name != "<module>":
            ran.add(str(frame.f_globals.get("__name__")))

    measure_point(point)  # compiles, which would take very long below
    sys.setprofile(note)
    try:
        measure_point(point)
    finally:
        sys.setprofile(None)
    ours = {name for name in ran if name.partition(".")[0] in OURS}
    assert point.workload.modules[-1] in ours
    ours = {name for name in ours if not name.startswith("scenes.")}  # the hash of the mesh tells of these
    missing = ours - modules(point)
    assert not missing, sorted(missing)


def test_package_faces_do_nothing_when_they_are_loaded():
    """A face that runs only on the way to a module below it does not count, so it may not have any effect."""
    harmless = (ast.Import, ast.ImportFrom, ast.Assign, ast.AnnAssign, ast.FunctionDef, ast.ClassDef)
    for package in OURS:
        for path in (ROOT / package).rglob("__init__.py"):
            for node in ast.parse(path.read_text(encoding="utf-8")).body:
                is_text = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
                assert is_text or isinstance(node, harmless), f"{path}, line {node.lineno}"


def made_up(**sources):
    """Code of modules `a`, `a.b`, written `a`, `a__b`; those that others are below are packages."""
    texts = {name.replace("__", "."): dedent(text) for name, text in sources.items()}

    def read(module):
        is_face = any(name.startswith(f"{module}.") for name in texts)
        return Source(module, texts[module], is_face) if module in texts else None

    return Code(read)


LIBRARY = {
    "lib": """
        '''The face.'''
        from lib.near import near
        from lib.far import far as distant
        def own(): return near()
    """,
    "lib__near": "def near(): return 1",
    "lib__far": "import lib.deep\ndef far(): return 2",
    "lib__deep": "import numpy",
}


@pytest.mark.parametrize(("source", "expected"), [
    ("from lib import near", {"lib.near"}),
    ("from lib import distant", {"lib.far", "lib.deep"}),
    ("from lib import own", {"lib", "lib.near", "lib.far", "lib.deep"}),
    ("from lib import deep", {"lib.deep"}),
    ("from lib.far import far", {"lib.far", "lib.deep"}),
    ("import lib.deep", {"lib.deep"}),
    ("def late():\n    from lib.near import near", {"lib.near"}),
    ("class A:\n    def late(self):\n        import lib.near", {"lib.near"}),
    ("if TYPE_CHECKING:\n    import lib.near", set()),
    ("import lib", {"lib", "lib.near", "lib.far", "lib.deep"}),
    ("from lib import *", {"lib", "lib.near", "lib.far", "lib.deep"}),
    ("SAYS = 'lib.near'", set()),
    ("import numpy, os.path", set()),
])  # fmt: skip
def test_what_a_module_imports_counts_and_of_a_package_face_the_names_that_are_taken(source, expected):
    assert made_up(**LIBRARY, user=source).modules(["user"]) == expected | {"user"}


def test_modules_of_a_package_may_import_each_other_by_relative_names():
    code = made_up(lib="from .near import near", lib__near="from . import deep", lib__deep="from .deep import x")
    assert code.modules(["lib.near"]) == {"lib.near", "lib.deep"}


@pytest.mark.parametrize(("other", "is_the_same"), [
    ("# why\n\nLIMIT = 3  # three\ndef f(x):\n\n    return x", True),
    ("LIMIT = 3\n'''Of x.'''\ndef f(x):\n    '''As it is.'''\n    return x", True),
    ("LIMIT = (\n    3\n)\ndef f(x): return x", True),
    ("LIMIT = 4\ndef f(x): return x", False),
    ("LIMIT = 3\ndef f(x): return -x", False),
    ("LIMIT = 3\ndef f(x): return 'x'", False),
    ("LIMIT = 3\ndef f(x=1): return x", False),
    ("LIMIT = 3.0\ndef f(x): return x", False),
    ("LIMIT = 3\n@cached\ndef f(x): return x", False),
])  # fmt: skip
def test_what_runs_makes_the_hash_and_not_how_it_is_written(other, is_the_same):
    one = made_up(user="LIMIT = 3\ndef f(x):\n    return x").sha256(["user"])
    assert (made_up(user=other).sha256(["user"]) == one) is is_the_same


def test_a_method_of_which_there_is_no_source_is_refused():
    with pytest.raises(InputError, match="module 'nowhere' has no source"):
        identity(replace(POINT, method=replace(RASTER, module="nowhere")), current_environment())
