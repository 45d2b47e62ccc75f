"""The program described in `tests.mutations`."""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import cache_from_source
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LIMIT_S = 1800.0
"""How long the tests of one mutation may take."""


class ListError(Exception):
    """The list of mutations does not fit the code or the tests; says which entry, and what to do."""


@dataclass(frozen=True)
class Mutation:
    """One fault.

    name: unique, in small letters with underscores. file: path from the root of the project. old: text that occurs in
    the file exactly once, as short as that allows, since code around it changes. new: what replaces it.
    breaks: what is wrong then, in one line. caught_by: the tests that must fail, each as "tests/test_x.py::test_name".
    """

    name: str
    file: str
    old: str
    new: str
    breaks: str
    caught_by: Sequence[str]

    def applied(self, root: Path) -> str:
        """The text of `file` with the fault. Raises ListError for an entry that does not fit."""
        path = root / self.file
        count = path.read_bytes().decode("utf-8").count(self.old) if path.is_file() and self.old else 0
        unfit = {
            "its name is not of small letters, digits and underscores": not re.fullmatch("[a-z0-9_]+", self.name),
            "it changes nothing": self.old == self.new,
            "caught_by names no test": not self.caught_by or not all("::" in test for test in self.caught_by),
            f"{self.file} holds {self.old!r} {count} times, expected once": count != 1,
        }
        for problem in (problem for problem, is_so in unfit.items() if is_so):
            raise ListError(f"mutation {self.name}: {problem}; bring its entry under tests/mutations/ up to date")
        return path.read_bytes().decode("utf-8").replace(self.old, self.new)


MUTATIONS = [
    Mutation(**entry)
    for name in ("kernels", "library", "harness")
    for entry in tomllib.loads(Path(__file__).with_name(f"{name}.toml").read_text(encoding="utf-8"))["mutations"]
]


def main(arguments: Sequence[str] | None = None, root: Path = ROOT, known: Sequence[Mutation] = MUTATIONS) -> int:
    """Run the program; returns its exit code: 0 all caught, 1 some not, 2 nothing could be judged."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.mutations", description="Put faults into a copy of the code."
    )
    parser.add_argument("--list", action="store_true", help="print the mutations, check that they fit, and end")
    parser.add_argument("--all-tests", action="store_true", help="slow tests, too (default: only fast ones)")
    parser.add_argument("--only", choices=[mutation.name for mutation in known], metavar="NAME", help="this one alone")
    options = parser.parse_args(arguments)
    mutations = [mutation for mutation in known if options.only in (None, mutation.name)]
    pytest_options = [] if options.all_tests else ["-m", "not slow"]
    try:
        texts = [mutation.applied(root) for mutation in mutations]
        if options.list:
            print(*(f"{mutation.name}: {mutation.breaks} ({mutation.file})" for mutation in mutations), sep="\n")
            return 0
        with tempfile.TemporaryDirectory(prefix="atra-mutations-", ignore_cleanup_errors=True) as folder:
            copy_project(root, Path(folder))
            tests = list(dict.fromkeys(test for mutation in mutations for test in mutation.caught_by))
            if (run := run_tests(Path(folder), tests, pytest_options)).returncode != 0:
                raise ListError(f"without a mutation its tests must pass, and did not:\n{run.stdout}")
            caught = [judge(Path(folder), *one, pytest_options) for one in zip(mutations, texts, strict=True)]
    except ListError as error:
        print(error, file=sys.stderr)
        return 2
    print(f"{sum(caught)} of {len(caught)} mutations were caught")
    return 0 if all(caught) else 1


def copy_project(root: Path, target: Path) -> None:
    """Copy the files and folders that git knows, with the compiled kernels that lie in them."""
    listed = subprocess.run(["git", "ls-files"], cwd=root, capture_output=True, encoding="utf-8", check=True).stdout
    for name in {line.partition("/")[0] for line in listed.splitlines()}:
        (shutil.copytree if (root / name).is_dir() else shutil.copy2)(root / name, target / name)


def run_tests(project: Path, tests: Sequence[str], options: Sequence[str]) -> subprocess.CompletedProcess[str]:
    """Run pytest in a copy of the project, whose own modules and kernels it uses."""
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    command = [sys.executable, "-m", "pytest", "-q", "--tb=no", "-rfE", "-p", "no:cacheprovider", *options, *tests]
    return subprocess.run(
        command, cwd=project, env=environment | {"PYTHONPATH": str(project)}, capture_output=True, encoding="utf-8",
        errors="replace", timeout=LIMIT_S,
    )  # fmt: skip


def judge(project: Path, mutation: Mutation, text: str, options: Sequence[str]) -> bool:
    """Whether the tests notice a mutation; says so. The file is afterwards as it was."""
    path, start = project / mutation.file, time.monotonic()
    bytecode = Path(cache_from_source(str(path)))
    content, times = path.read_bytes(), (path.stat().st_atime, path.stat().st_mtime)
    try:
        path.write_bytes(text.encode("utf-8"))
        bytecode.unlink(missing_ok=True)  # Python would run that of a file of the same size and second
        run = run_tests(project, mutation.caught_by, options)
        # pytest's exit codes: tests failed, passed, were not found; others mean that it could not run them.
        word = {1: "caught", 0: "survived", 5: "survived"}.get(run.returncode, f"not run\n{run.stdout}")
    except subprocess.TimeoutExpired:
        return print(f"{mutation.name}: timed out", flush=True) or False
    finally:
        path.write_bytes(content)
        bytecode.unlink(missing_ok=True)
        os.utime(path, times)
    failed = [line.partition(" ")[2].partition(" - ")[0] for line in run.stdout.splitlines() if line[:6] == "FAILED"]
    print(f"{mutation.name}: {word} in {time.monotonic() - start:.0f} s", *failed, sep="\n    ", flush=True)
    return word == "caught"


if __name__ == "__main__":
    sys.exit(main())
