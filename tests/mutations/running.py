"""Running the tests on copies of the project, one of them with a fault."""

from __future__ import annotations

import filecmp
import os
import shutil
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import psutil

from tests.mutations.mutation import ListError, Mutation

_PASSED, _FAILED, _NOTHING_CHOSEN = 0, 1, 5
"""Exit codes of pytest. All others mean that tests could not be run."""

_TOLD = ("FAILED ", "ERROR ")
"""How pytest begins the lines that name a test that failed."""

FAST_TESTS = ("-m", "not slow")
"""What pytest is told to leave the slow tests out."""


@dataclass(frozen=True)
class Run:
    """One run of pytest. exit_code: pytest's, None where it was stopped at the time limit. failed: names of the tests
    that failed, with their parameters. output: what pytest printed."""

    exit_code: int | None
    failed: tuple[str, ...]
    output: str


@dataclass(frozen=True)
class Verdict:
    """What became of one mutation: "caught", "survived", "timed out", or "not run" where pytest could not run the
    tests. failed: the tests that caught it. time_s: how long that took."""

    mutation: Mutation
    word: str
    failed: tuple[str, ...]
    time_s: float
    output: str

    def tests(self) -> list[str]:
        """The tests that failed, and how many cases of each."""
        cases = Counter(test.removeprefix("tests/").partition("[")[0] for test in self.failed)
        return [f"`{test}`" + (f" ({count} cases)" if count > 1 else "") for test, count in cases.items()]


def check_list(root: Path, mutations: Sequence[Mutation]) -> None:
    """Raise ListError, with a line for each, for mutations that do not fit the files below `root`, or share a name."""
    problems = []
    for place, mutation in enumerate(mutations):
        if any(mutation.name == other.name for other in mutations[:place]):
            problems.append(f"mutation {mutation.name}: an earlier one has the same name")
        try:
            _read_mutated(root, mutation)
        except ListError as error:
            problems.append(str(error))
    if problems:
        raise ListError("\n".join(problems))


def copy_project(root: Path, target: Path) -> None:
    """Make `target` hold the files that git knows or would add below `root`, as they are now.

    Files that are there already and have not changed stay untouched, so compiled kernels beside them stay valid.
    Raises ListError where git cannot list the files.
    """
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.run(command, cwd=root, capture_output=True, check=False)
    if listed.returncode != 0:
        raise ListError(f"git cannot list the files of {root}: {os.fsdecode(listed.stderr).strip()}")
    names = {name for name in os.fsdecode(listed.stdout).split("\0") if name and (root / name).is_file()}
    for name in names:
        source, copy = root / name, target / name
        if not (copy.is_file() and filecmp.cmp(source, copy, shallow=False)):
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(source, copy)
    for path in list(target.rglob("*")):
        if path.is_file() and "__pycache__" not in path.parts and path.relative_to(target).as_posix() not in names:
            path.unlink()


def run_tests(project: Path, tests: Sequence[str], *options: str, limit_s: float | None = None) -> Run:
    """Run pytest in a copy of the project. tests: their names. options: of pytest. limit_s: seconds until all processes
    of it are stopped."""
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    environment["PYTHONPATH"] = str(project)  # the copy, not the checkout that an editable install points to
    command = [sys.executable, "-m", "pytest", "-q", "--tb=no", "-rfE", "-p", "no:cacheprovider", *options, *tests]
    with subprocess.Popen(
        command, cwd=project, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, encoding="utf-8",
        errors="replace",
    ) as process:  # fmt: skip
        try:
            output, _ = process.communicate(timeout=limit_s)
            exit_code: int | None = process.returncode
        except subprocess.TimeoutExpired:
            _kill_with_children(process.pid)
            output, _ = process.communicate()
            exit_code = None
        except BaseException:
            _kill_with_children(process.pid)
            raise
    told = [line.partition(" ")[2].partition(" - ")[0] for line in output.splitlines() if line.startswith(_TOLD)]
    return Run(exit_code, tuple(told), output)


def judge_mutation(unmutated: Path, mutation: Mutation, options: Sequence[str], limit_s: float) -> Verdict:
    """Run the tests that must catch a mutation on a copy of `unmutated` that has it; the copy is removed again.

    The copy shares all other files, compiled kernels among them, so only those kernels are compiled that the mutation
    changes.
    """
    copy = unmutated.with_name(mutation.name)
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(unmutated, copy, copy_function=_link)
    try:
        mutated = _read_mutated(copy, mutation)
        (copy / mutation.file).unlink()  # the file is shared: written to, it would change in `unmutated`, too
        (copy / mutation.file).write_text(mutated, encoding="utf-8", newline="")
        _set_time_apart(copy / mutation.file, (unmutated / mutation.file).stat().st_mtime)
        start = time.monotonic()
        run = run_tests(copy, mutation.caught_by, *options, limit_s=limit_s)
        words = {_PASSED: "survived", _NOTHING_CHOSEN: "survived", _FAILED: "caught", None: "timed out"}
        word = words.get(run.exit_code, "not run")
        return Verdict(mutation, word, run.failed, time.monotonic() - start, run.output)
    finally:
        shutil.rmtree(copy, ignore_errors=True)


def _read_mutated(root: Path, mutation: Mutation) -> str:
    try:
        with (root / mutation.file).open(encoding="utf-8", newline="") as file:
            return mutation.applied(file.read())
    except FileNotFoundError:
        raise ListError(
            f"mutation {mutation.name}: there is no file {mutation.file}; bring its entry under tests/mutations/ up to "
            "date"
        ) from None


def _set_time_apart(path: Path, before_s: float) -> None:
    """Python runs kept bytecode of a file of the same size and the same second, and so of the file before."""
    os.utime(path, (before_s + 10.0, before_s + 10.0))


def _link(source: str, target: str) -> None:
    try:
        os.link(source, target)
    except OSError:  # a file system without links
        shutil.copy2(source, target)


def _kill_with_children(pid: int) -> None:
    try:
        process = psutil.Process(pid)
        for one in [*process.children(recursive=True), process]:
            one.kill()
    except psutil.NoSuchProcess:
        pass
