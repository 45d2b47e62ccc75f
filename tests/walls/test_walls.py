"""Walls of the house: which room may import which, read from the sources; no circles, no big files, no big folders."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from dataclasses import dataclass
from functools import cache
from graphlib import CycleError, TopologicalSorter
from itertools import permutations

import pytest

from experiments.workloads import WORKLOADS
from tests.folders import ROOT

WITHOUT_CIRCLES = ("atra", "experiments", "scenes")
"""Packages whose modules import each other in one direction only."""

MOST_LINES, MOST_FILES = 305, 13
"""About 300 of a file, and about twelve of a folder without its `__init__.py`."""

MOST_ARGUMENTS = 7
"""Positional arguments of a constructor; options are keywords."""


@dataclass(frozen=True)
class Wall:
    """What may not be imported, at the top of a module or inside of a function.

    Names are those of packages and modules, and stand for all below them. apart_from, suffix_apart: modules that may,
    by their names and by how these end. but: what may be imported nevertheless. faces: whether `__init__` of the
    package itself counts. reason: what a failure says.
    """

    of: str
    may_not_import: tuple[str, ...]
    apart_from: tuple[str, ...] = ()
    suffix_apart: str | None = None
    but: tuple[str, ...] = ()
    faces: bool = True
    reason: str = ""


WORKLOAD_ROOMS = tuple(workload.package for workload in WORKLOADS)

USERS = tuple(
    f"experiments.{room}" for room in ("report", "paper", "commands", "registry", "sweep", "launched", "worker")
)
"""Who runs methods and workloads, and who tells of what came of them."""

EVIDENCE = ("experiments.classification", "experiments.light", "experiments.law", "experiments.studies")
"""Wings of the harness, from the ground up: each imports only those that stand before it. The core of the harness names
them nowhere."""

GROUND = ("atra.errors", "atra.prim_ids", "atra.whole_numbers", "atra.choices")
"""Words that everything uses; they import each other alone."""

METHOD_ROOMS = ("raster", "packets", "alignment")

CORE = (
    "compiled", "embree", "geometry", "files", "exact", "hits", "all_hits", "tracing", "trees", "rays", *METHOD_ROOMS,
    "methods", "judge", "views", "compat",
)  # fmt: skip
"""Rooms of the library, from the ground up: each imports only those that stand before it."""

IN_FULL_LIGHT = ("atra.command.baking", "atra.command.picture", "atra.command.viewing")
"""Modules of the command that make pictures, lightmaps and pages."""

WINGS = ("light",)
"""They stand on the core, which does not know them. The command stands on all."""

SHARED_BY_METHODS = {
    ("alignment", "packets"): ("atra.packets",),
    ("alignment", "raster"): ("atra.raster.all_hits.undecided_kernels",),
    ("packets", "raster"): ("atra.raster.all_hits.undecided", "atra.raster.all_hits.undecided_kernels"),
}
"""What a method may import of another: aligned images are finished by packets, and samples near an edge are decided as
the rasteriser decides them, so that all methods count the same hits."""

LIGHT = ("atra.light", "atra.light.pictures", "atra.light.lightmaps", "atra.light.viewer")
"""Parts of the wing, from the ground up: scenes, lights and sky; pictures; lightmaps, which save as pictures do; the
viewer of both."""

COMPILED_ROOMS = ("atra.compiled", "atra.embree", "atra.trees", "atra.raster")
"""Rooms where every module may compile; elsewhere those whose names end in `_kernels` do."""


def below(package, *rooms):
    return tuple(f"{package}.{room}" for room in rooms)


WALLS = (
    Wall("atra", ("experiments", "scenes", "examples", "tests", "hydra", "omegaconf"), apart_from=("atra.command",),
         reason="the library knows no configuration and none of its users"),
    Wall("atra", ("atra.command",), apart_from=("atra.command",), reason="the library does not know its command"),
    Wall("atra", ("ctypes", "embreex", "llvmlite", "numba", "atra.embree.layout", "atra.embree.self_check"),
         apart_from=COMPILED_ROOMS, suffix_apart="_kernels",
         reason="only kernels compile, and only they and embree/ know the C API"),
    *(Wall(f"atra.{room}", below("atra", *CORE[number + 1 :], *WINGS), reason="a room imports only rooms before it")
      for number, room in enumerate(CORE)),
    *(Wall(f"atra.{room}", (f"atra.{other}",), but=SHARED_BY_METHODS.get((room, other), ()),
           reason=f"methods stand side by side: this one does not know {other}/")
      for room, other in permutations(METHOD_ROOMS, 2)),
    *(Wall("atra", (f"atra.{wing}",), apart_from=(f"atra.{wing}", *IN_FULL_LIGHT),
           reason="the core knows no wing") for wing in WINGS),
    Wall("atra.command.picture", LIGHT[2:], reason="pictures need no lightmaps and no page"),
    Wall(LIGHT[0], LIGHT[1:], apart_from=LIGHT[1:], faces=False, reason="scenes do not know what is made of them"),
    *(Wall(part, LIGHT[number + 1 :], reason="a part of the wing imports only those before it")
      for number, part in enumerate(LIGHT) if number),
    # Modules of the harness are below "experiments", too.
    Wall("experiments.harness", ("experiments",), but=("experiments.harness",),
         reason="the harness names no workload and no method; it is given both"),
    Wall("experiments.methods", ("experiments.workloads", "experiments.results", *USERS),
         reason="a method does not know what is measured with it"),
    Wall("experiments.workloads", USERS,
         reason="a workload knows nobody who runs or reports it"),
    Wall("experiments.drawing",
         below("experiments", "harness", "methods", "workloads", "results", "report", "paper"),
         reason="drawing knows no method, workload or peer"),
    Wall("experiments", ("matplotlib",),
         apart_from=("experiments.drawing.render", "experiments.drawing.axes", "experiments.law.figures"),
         reason="a figure is a value; one module and its axes draw them all"),
    Wall("experiments.results",
         ("experiments.drawing", "experiments.report", "experiments.paper", "matplotlib", *WORKLOAD_ROOMS),
         reason="results know no figure"),
    *(Wall(room, tuple(other for other in WORKLOAD_ROOMS if other != room), reason="a workload never imports another")
      for room in WORKLOAD_ROOMS),
    Wall("atra", ("viser",), apart_from=("atra.light.viewer.gate", "atra.light.viewer.page"),
         reason="only pages know viser"),
    Wall("experiments", EVIDENCE, apart_from=EVIDENCE, reason="the core of the harness knows no wing"),
    *(Wall(wing, EVIDENCE[number + 1 :], reason="a wing imports only wings before it")
      for number, wing in enumerate(EVIDENCE)),
    Wall("scenes", ("experiments", "hydra", "omegaconf"), reason="scenes know no experiment"),
)  # fmt: skip


def is_below(module, names):
    return any(module == name or module.startswith(f"{name}.") for name in names)


@cache
def modules(package):
    """Module name -> file, of all in the package, or of the one module of that name."""
    found = {}
    place = ROOT / package.replace(".", "/")
    for path in place.rglob("*.py") if place.is_dir() else [place.with_suffix(".py")]:
        parts = path.relative_to(ROOT).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    assert found
    return found


@cache
def tree(path):
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def imports(path):
    """All that a file imports: modules, and names in them as if they were modules."""
    found = set()
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.Import):
            found |= {name.name for name in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path} has a relative import in line {node.lineno}"
            found |= {f"{node.module}.{name.name}" for name in node.names}
    return frozenset(found)


def breaches(wall):
    return [
        f"{module} imports {name}"
        for module, path in modules(wall.of).items()
        if not is_below(module, wall.apart_from)
        if not (wall.suffix_apart and module.endswith(wall.suffix_apart))
        if wall.faces or module != wall.of
        for name in sorted(imports(path))
        if is_below(name, wall.may_not_import) and not is_below(name, wall.but)
    ]


@pytest.mark.parametrize("wall", WALLS, ids=lambda wall: f"{wall.of}: {wall.reason}")
def test_a_wall_stands(wall):
    assert not breaches(wall), wall.reason


def test_what_workloads_share_imports_none_of_them():
    registry = "experiments.workloads"
    shared = [one for one in modules(registry) if one != registry and not is_below(one, WORKLOAD_ROOMS)]
    assert "experiments.workloads.rounds" in shared
    for module in shared:
        assert not [name for name in imports(modules(registry)[module]) if is_below(name, WORKLOAD_ROOMS)], module


def loaded_by(code):
    """Modules of a new process that has run the code."""
    command = [sys.executable, "-c", f"{code}; import sys; print(*sys.modules)"]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.split()


def test_the_harness_loads_no_method_and_no_workload():
    """Not even by the way, as a package's `__init__` does that lies above an imported module."""
    loaded = loaded_by(f"import {', '.join(modules('experiments.harness'))}")
    names = {name for name in loaded if is_below(name, ("experiments",))}
    assert {name for name in names if not is_below(name, ("experiments.harness",))} == {"experiments"}


def test_importing_the_library_loads_no_wing_and_no_command_and_a_wing_is_loaded_by_its_own_name():
    loaded = loaded_by("import atra; [getattr(atra, name) for name in atra.__all__]")
    assert "atra.packets.pixel" in loaded
    assert not [name for name in loaded if is_below(name, tuple(f"atra.{room}" for room in (*WINGS, "command")))]
    for name in ("atra.light", "experiments.classification.shafts.scene", "experiments.light.sun.tiles"):
        assert name in loaded_by(f"import {name}")


def test_the_core_of_the_harness_names_no_wing_not_even_in_a_text():
    """Wings register by entry points."""
    core = [path for name, path in modules("experiments").items() if not is_below(name, EVIDENCE)]
    assert len(core) > 100
    named = [path for path in core if re.search(rf"({'|'.join(EVIDENCE)})\b", path.read_text(encoding="utf-8"))]
    assert not named


def test_walls_are_seen_to_fall():
    assert breaches(Wall("atra.tracing", ("atra.embree",)))  # at the top of a module
    assert breaches(Wall("atra.files.formats", ("trimesh",)))  # inside of a function
    assert not breaches(Wall("atra.tracing", ("atra.embree",), apart_from=("atra.tracing",)))
    assert not breaches(Wall("atra.tracing", ("atra.embree",), but=("atra.embree",)))
    assert breaches(Wall("atra.alignment", ("atra.packets",)))
    assert breaches(Wall("atra.light", LIGHT[1:], apart_from=LIGHT[1:]))  # its face
    assert breaches(Wall("atra.packets", ("numba",)))
    assert breaches(Wall("experiments", ("experiments.methods",), but=("experiments.methods.naming",)))
    assert not breaches(Wall("atra.packets", ("numba",), suffix_apart="_kernels"))


def test_every_room_of_the_library_has_its_place_in_the_order():
    rooms = {module.split(".")[1] for module in modules("atra") if "." in module}
    assert rooms == {*CORE, *WINGS, "command", *(name.removeprefix("atra.") for name in GROUND)}


def test_the_words_that_everything_uses_import_nothing_of_the_library_but_each_other():
    for name in GROUND:
        assert not [
            one for one in imports(modules("atra")[name]) if is_below(one, ("atra",)) and not is_below(one, GROUND)
        ]


def test_a_file_of_kernels_declares_some():
    found = [module for module in modules("atra") if module.endswith("_kernels")]
    assert len(found) > 30
    assert not [
        name
        for name in found
        if not any(is_below(one, ("numba", "atra.compiled.store")) for one in imports(modules("atra")[name]))
    ]


@pytest.mark.parametrize("package", WITHOUT_CIRCLES)
def test_modules_import_each_other_in_one_direction_only(package):
    known = modules(package)
    graph = {
        module: {name if name in known else name.rpartition(".")[0] for name in imports(path)} & known.keys()
        for module, path in known.items()
    }
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        pytest.fail(" <- ".join(error.args[1]))


@pytest.mark.parametrize("path", [path for name in WITHOUT_CIRCLES for path in modules(name).values()], ids=str)
def test_a_file_is_not_too_long_to_read_at_a_sitting(path):
    assert len(path.read_text(encoding="utf-8").splitlines()) <= MOST_LINES


@pytest.mark.parametrize(
    "folder", sorted({path.parent for name in WITHOUT_CIRCLES for path in modules(name).values()}), ids=str
)
def test_a_folder_is_not_too_full(folder):
    assert len([path for path in folder.glob("*.py") if path.name != "__init__.py"]) <= MOST_FILES


NAMED_TUPLE = ("_replace", "_asdict", "_fields")
"""Public in spite of their underscore."""

OF_VISER = ("_impl",)
"""The viewer needs identifiers of controls, for which viser has no public name."""


def private_names(path):
    """Names with an underscore that a file takes from other modules or from objects that are not its own `self`."""
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.ImportFrom):
            yield from (name.name for name in node.names if name.name.startswith("_"))
        elif isinstance(node, ast.Attribute) and node.attr.startswith("_") and not node.attr.endswith("__"):
            owner = node.value.func if isinstance(node.value, ast.Call) else node.value
            own = isinstance(owner, ast.Name) and owner.id in ("self", "cls", "super")
            if not own and node.attr not in (*NAMED_TUPLE, *OF_VISER):
                yield node.attr


def test_names_that_others_use_are_public():
    found = [
        f"{module}: {name}"
        for module, path in modules("atra").items()
        if not is_below(module, ("atra.compiled",))
        for name in private_names(path)
    ]
    assert not found
    assert "_cache" in private_names(modules("atra")["atra.compiled.store"])  # of Numba: such names are seen


def test_constructors_take_few_positional_arguments():
    too_many = [
        f"{module}, line {node.lineno}"
        for module, path in modules("atra").items()
        if not is_below(module, ("atra.embree",))
        for node in ast.walk(tree(path))
        if isinstance(node, ast.FunctionDef) and node.name == "__init__"
        if len({one.arg for one in node.args.args} - {"self"}) > MOST_ARGUMENTS
    ]
    assert not too_many


def test_the_harness_uses_hydra_by_its_public_names_and_leaves_the_command_line_as_it_is():
    paths = [*modules("experiments").values(), ROOT / "hydra_plugins" / "atra_points.py", ROOT / "run.py"]
    private = re.compile(r"hydra\._internal|class_name_to_class|sys\.argv(\[.*\])? = |del sys\.argv")
    assert not [path for path in paths if private.search(path.read_text(encoding="utf-8"))]
