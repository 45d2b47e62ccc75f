"""Walls of the house: which room may import which, read from the sources; no circles, no big files, no big folders."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

from experiments.workloads import WORKLOADS

pytestmark = pytest.mark.uncovered

ROOT = Path(__file__).resolve().parents[1]

WITHOUT_CIRCLES = ("atra", "experiments", "scenes")
"""Packages whose modules import each other in one direction only."""

MOST_LINES, MOST_FILES = 305, 13
"""About 300 of a file, and about twelve of a folder without its `__init__.py`."""

MOST_ARGUMENTS = 4
"""Of a constructor, beside its options."""


@dataclass(frozen=True)
class Wall:
    """What may not be imported, at the top of a module or inside of a function.

    Names are those of packages and modules, and stand for all below them. apart_from: who may. allowed: what all may
    import of these. reason: what a failure says.
    """

    of: str
    may_not_import: tuple[str, ...]
    apart_from: tuple[str, ...] = ()
    allowed: tuple[str, ...] = ()
    reason: str = ""


WORKLOAD_ROOMS = tuple(workload.room for workload in WORKLOADS)

USERS = tuple(
    f"experiments.{room}"
    for room in ("report", "paper", "viewer", "commands", "registry", "sweep", "sweeper", "worker")
)
"""Who runs methods and workloads, and who tells of what came of them."""

WALLS = (
    Wall(
        "atra",
        ("experiments", "scenes", "examples", "tests", "hydra", "omegaconf"),
        apart_from=("atra.command",),
        reason="the library knows no configuration and none of its users",
    ),
    Wall("atra", ("atra.command",), apart_from=("atra.command",), reason="the library does not know its command"),
    Wall(
        "atra",
        ("ctypes", "embreex", "llvmlite", "numba", "atra.embree.layout", "atra.embree.self_check"),
        apart_from=("atra.embree", "atra.kernels", "atra.alignment.culling_kernels"),
        reason="only embree/ and kernels/ know the C API and compile",
    ),
    Wall(
        "atra",
        ("atra.embree",),
        # Tracers and ray batches hold scenes and workspaces; options ask which packets are native and which qualities
        # there are; the doctor tells what is here.
        apart_from=("atra.embree", "atra.kernels", "atra.tracers", "atra.rays", "atra.options", "atra.command.doctor"),
        reason="only tracers, ray batches, options and the doctor use embree/, and of it what is not the C API",
    ),
    Wall(
        "atra.geometry",
        ("atra.alignment", "atra.cameras", "atra.embree", "atra.judge", "atra.planner", "atra.tracers"),
        reason="geometry is the first room",
    ),
    Wall(
        "atra.mesh_files",
        ("atra.alignment", "atra.cameras", "atra.embree", "atra.judge", "atra.kernels", "atra.planner", "atra.tracers"),
        reason="who reads meshes knows nobody who uses them",
    ),
    Wall(
        "atra.cameras",
        ("atra.alignment", "atra.embree", "atra.judge", "atra.kernels", "atra.planner", "atra.rays", "atra.tracers"),
        reason="who reads cameras knows nobody who uses them",
    ),
    Wall(
        "atra.alignment",
        ("atra.judge", "atra.planner", "atra.tracers"),
        reason="a plan knows nobody who traces or judges it",
    ),
    Wall(
        "atra.judge",
        ("atra.alignment", "atra.planner", "atra.tracers"),
        reason="the judge does not know how an image was made",
    ),
    Wall("atra", ("atra.render",), apart_from=("atra.render", "atra.bake"), reason="pictures stand on top of all else"),
    Wall("atra", ("atra.bake",), apart_from=("atra.bake",), reason="nothing but its users knows the baker"),
    Wall("atra.tracers", ("atra.planner",), reason="the planner chooses tracers, not they it"),
    Wall(
        "experiments.harness",
        ("experiments",),
        # Modules of its own are below "experiments", too.
        allowed=("experiments.harness",),
        reason="the harness names no workload and no method; it is given both",
    ),
    Wall(
        "experiments.methods",
        ("experiments.workloads", "experiments.results", *USERS),
        reason="a method does not know what is measured with it",
    ),
    Wall(
        "experiments.workloads",
        tuple(
            f"experiments.{room}" for room in ("report", "paper", "viewer", "commands", "registry", "sweep", "worker")
        ),
        reason="a workload knows nobody who runs or reports it",
    ),
    Wall(
        "experiments.drawing",
        tuple(f"experiments.{room}" for room in ("harness", "methods", "workloads", "results", "report", "paper")),
        reason="drawing knows no method, workload or peer",
    ),
    Wall(
        "experiments.results",
        ("experiments.drawing", "experiments.report", "experiments.paper", "matplotlib", *WORKLOAD_ROOMS),
        reason="results know no figure",
    ),
    *(
        Wall(room, tuple(other for other in WORKLOAD_ROOMS if other != room), reason="a workload never imports another")
        for room in WORKLOAD_ROOMS
    ),
    Wall(
        "experiments",
        ("viser",),
        apart_from=("experiments.viewer.camera_page", "experiments.viewer.page"),
        reason="only pages know viser",
    ),
    Wall("scenes", ("experiments", "hydra", "omegaconf"), reason="scenes know no experiment"),
)


def is_below(module: str, names: tuple[str, ...]) -> bool:
    return any(module == name or module.startswith(f"{name}.") for name in names)


@cache
def modules(package: str) -> dict[str, Path]:
    """Module name -> file, of all in the package."""
    found = {}
    for path in (ROOT / package.replace(".", "/")).rglob("*.py"):
        parts = path.relative_to(ROOT).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    assert found
    return found


@cache
def tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def imports(path: Path) -> frozenset[str]:
    """All that a file imports: modules, and names in them as if they were modules."""
    found = set()
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.Import):
            found |= {name.name for name in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path} has a relative import in line {node.lineno}"
            found |= {f"{node.module}.{name.name}" for name in node.names}
    return frozenset(found)


def breaches(wall: Wall) -> list[str]:
    return [
        f"{module} imports {name}"
        for module, path in modules(wall.of).items()
        if not is_below(module, wall.apart_from)
        for name in sorted(imports(path))
        if is_below(name, wall.may_not_import) and not is_below(name, wall.allowed)
    ]


@pytest.mark.parametrize("wall", WALLS, ids=lambda wall: f"{wall.of}: {wall.reason}")
def test_a_wall_stands(wall: Wall) -> None:
    assert not breaches(wall), wall.reason


def test_what_workloads_share_imports_none_of_them() -> None:
    registry = "experiments.workloads"
    shared = [one for one in modules(registry) if one != registry and not is_below(one, WORKLOAD_ROOMS)]
    assert "experiments.workloads.rounds" in shared
    for module in shared:
        assert not [name for name in imports(modules(registry)[module]) if is_below(name, WORKLOAD_ROOMS)], module


def test_the_harness_loads_no_method_and_no_workload() -> None:
    """Not even by the way, as a package's `__init__` does that lies above an imported module."""
    code = f"import sys, {', '.join(modules('experiments.harness'))}; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    loaded = {name for name in done.stdout.split() if is_below(name, ("experiments",))}
    assert {name for name in loaded if not is_below(name, ("experiments.harness",))} == {"experiments"}


def test_walls_are_seen_to_fall() -> None:
    assert breaches(Wall("atra.tracers", ("atra.embree",)))  # at the top of a module
    assert breaches(Wall("atra.mesh_files", ("trimesh",)))  # inside of a function
    assert not breaches(Wall("atra.tracers", ("atra.embree",), apart_from=("atra.tracers",)))
    assert not breaches(Wall("atra.tracers", ("atra.embree",), allowed=("atra.embree",)))
    assert breaches(Wall("experiments", ("experiments.methods",), allowed=("experiments.methods.naming",)))


@pytest.mark.parametrize("package", WITHOUT_CIRCLES)
def test_modules_import_each_other_in_one_direction_only(package: str) -> None:
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
def test_a_file_is_not_too_long_to_read_at_a_sitting(path: Path) -> None:
    assert len(path.read_text(encoding="utf-8").splitlines()) <= MOST_LINES


@pytest.mark.parametrize(
    "folder", sorted({path.parent for name in WITHOUT_CIRCLES for path in modules(name).values()}), ids=str
)
def test_a_folder_is_not_too_full(folder: Path) -> None:
    assert len([path for path in folder.glob("*.py") if path.name != "__init__.py"]) <= MOST_FILES


def private_names(path: Path) -> Iterator[str]:
    """Names with an underscore that a file takes from other modules or from objects that are not its own `self`."""
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.ImportFrom):
            yield from (name.name for name in node.names if name.name.startswith("_"))
        elif isinstance(node, ast.Attribute) and node.attr.startswith("_") and not node.attr.endswith("__"):
            owner = node.value.func if isinstance(node.value, ast.Call) else node.value
            if not (isinstance(owner, ast.Name) and owner.id in ("self", "cls", "super")):
                yield node.attr


def test_names_that_others_use_are_public() -> None:
    found = [
        f"{module}: {name}"
        for module, path in modules("atra").items()
        if not is_below(module, ("atra.kernels",))
        for name in private_names(path)
    ]
    assert not found
    assert "_cache" in private_names(modules("atra")["atra.kernels.caching"])  # of Numba: such names are seen


def test_constructors_take_few_arguments_beside_their_options() -> None:
    too_many = [
        f"{module}, line {node.lineno}"
        for module, path in modules("atra").items()
        if not is_below(module, ("atra.embree",))
        for node in ast.walk(tree(path))
        if isinstance(node, ast.FunctionDef) and node.name == "__init__"
        if len({one.arg for one in (*node.args.args, *node.args.kwonlyargs)} - {"self", "options"}) > MOST_ARGUMENTS
    ]
    assert not too_many
