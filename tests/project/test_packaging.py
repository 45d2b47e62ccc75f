"""Installing: what the library imports is what it depends on, a script beside a clone imports the package and not the
clone's folder, and a wheel brings the command."""

import ast
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tomllib
import venv
from pathlib import Path
from zipfile import ZipFile

import pytest

ROOT = Path(__file__).resolve().parents[2]
OURS = {"atra", "experiments", "scenes", "examples"}
PACKAGES = {
    "DracoPy": "dracopy",
    "mapbox_earcut": "mapbox-earcut",
    "OpenEXR": "openexr",
    "PIL": "pillow",
    "hydra": "hydra-core",
    "lazy_loader": "lazy-loader",
}
"""Whose name is not that of their module."""

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def imported(*folders):
    """Packages that the sources below import, at the top of a module or inside of a function."""
    found = set()
    for path in (path for folder in folders for path in (ROOT / folder).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                found |= {alias.name.partition(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                found.add(str(node.module).partition(".")[0])
    return {PACKAGES.get(name, name) for name in found - OURS - sys.stdlib_module_names}


def named(requirements):
    return {re.match(r"[\w-]+", requirement)[0] for requirement in requirements}


FOR_SOME_TASKS = {
    "dracopy", "meshio", "msgspec", "openexr", "pillow", "pyoidn", "scipy", "viser", "websockets", "xatlas",
}  # fmt: skip
"""What the library asks for where some formats are read or written, charts made, maps denoised or pages shown."""


def test_the_library_depends_on_what_it_imports():
    embree = {"embreex"}  # whose wheel holds the Embree that is loaded
    assert named(PROJECT["dependencies"]) == (imported("atra") - FOR_SOME_TASKS) | embree


def test_the_harness_adds_what_it_imports():
    harness, extras = imported("experiments", "scenes", "examples"), PROJECT["optional-dependencies"]
    # requests comes with pooch, ray and submitit with their launchers; an example uses pvlib where it is
    extra = [one for name in ("fetch", "peers", "dask", "viewer") for one in extras[name]]
    optional = named([*extra, "requests", "ray", "submitit", "hydra_plugins", "pvlib"])
    parquet = {"pyarrow"}  # with which pandas reads and writes tables
    assert named(extras["harness"]) == (harness | parquet) - named(PROJECT["dependencies"]) - optional


def test_every_version_that_the_two_commands_install_is_stated():
    pinned = {re.sub("[-_]", "-", name.lower()) for name in named(constraint_lines())}
    extras = PROJECT["optional-dependencies"]
    asked = named(
        [*PROJECT["dependencies"], *extras["harness"], *extras["test"], *extras["fetch"], *extras["dask"]]
    ) - {"atra"}
    assert {name.replace("_", "-") for name in asked} <= pinned


def constraint_lines():
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    return [line for line in lines if not line.startswith("#")]


@pytest.mark.parametrize(("module", "needless"), [
    ("atra", {"trimesh", "pandas", "matplotlib"}),
    ("experiments.worker", {"trimesh", "pandas", "pyarrow", "matplotlib", "hydra", "rich"}),
])  # fmt: skip
def test_nothing_is_imported_that_costs_time_and_may_never_be_needed(module, needless):
    """A worker is started for every measured process."""
    code = f"import sys, {module}; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert module in done.stdout.split(), done.stderr
    assert needless.isdisjoint(done.stdout.split())


def make_environment(folder):
    """A virtual environment's Python. It sees the packages of this one, but not what path files install in it."""
    venv.create(folder, with_pip=False)
    python = folder / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")
    site = sysconfig.get_path("purelib", "venv", {"base": str(folder), "platbase": str(folder)})
    (Path(site) / "here.pth").write_text(f"{sysconfig.get_path('purelib')}\n", encoding="utf-8")
    return python


def install(python, *what):
    command = [sys.executable, "-m", "pip", "--python", str(python), "install", "-q", "--no-deps", "--ignore-installed"]
    done = subprocess.run([*command, "--no-build-isolation", *what], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def run(*command, folder, **variables):
    environment = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "PYTHONSAFEPATH")}
    return subprocess.run(command, cwd=folder, env=environment | variables, capture_output=True, text=True)


def test_a_script_beside_a_clone_imports_the_package_and_not_the_clone(tmp_path):
    clone = tmp_path / "atra"
    for name in ("atra", "atra_wings-0.dist-info", "conf", "experiments", "hydra_plugins", "scenes"):
        shutil.copytree(ROOT / name, clone / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "hatch_build.py", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, clone)
    python = make_environment(tmp_path / "venv")
    install(python, "-e", str(clone))
    script = tmp_path / "script.py"
    script.write_text("import atra\nprint(atra.__file__, atra.MISS)\n", encoding="utf-8")
    done = run(python, script, folder=tmp_path)
    assert done.stdout.split() == [str(clone / "atra" / "__init__.py"), str(0xFFFFFFFF)], done.stderr
    done = run(python.with_name("atra"), "method=nope", folder=tmp_path)
    assert done.returncode == 2
    assert "unknown method 'nope', expected one of aligned" in done.stderr
    assert done.stderr.startswith("atra: ")


WITHOUT_THE_HARNESS = """
import sys
class Missing:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {packages!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
sys.meta_path.insert(0, Missing())
"""


@pytest.fixture(scope="module")
def wheel_environment(tmp_path_factory):
    """The Python of an environment with the wheel and none of the harness's packages."""
    folder = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    done = subprocess.run(build, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    (wheel,) = folder.glob("atra-*.whl")
    names = {name.partition("/")[0] for name in ZipFile(wheel).namelist()}
    assert names == {"atra", next(name for name in names if name.endswith(".dist-info"))}
    python = make_environment(folder / "venv")
    install(python, str(wheel))
    packages = {"hydra", "omegaconf", "jinja2", "PIL", *named(PROJECT["optional-dependencies"]["harness"])}
    site = Path(run(python, "-c", "import atra; print(atra.__path__[0])", folder=folder).stdout.strip()).parent
    (site / "sitecustomize.py").write_text(WITHOUT_THE_HARNESS.format(packages=packages), encoding="utf-8")
    return python


@pytest.mark.slow
def test_the_wheel_s_command_tells_what_is_here(wheel_environment, tmp_path):
    done = run(wheel_environment.with_name("atra"), "doctor", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    *lines, last = done.stdout.splitlines()
    assert last == "ready to trace images"
    assert max(map(len, lines)) <= 80
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize("verb", ["sweep=horizontal", "measure", "fetch", "-m"])
def test_without_the_harness_its_verbs_say_what_to_install(wheel_environment, tmp_path, verb):
    done = run(wheel_environment.with_name("atra"), verb, folder=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (
        f"atra: {verb} needs the harness; in a clone of atra's repository, run: pip install -e '.[harness]'\n"
    )
