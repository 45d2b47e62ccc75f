"""The program described in `tests.mutations`."""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from tests.mutations import MUTATIONS
from tests.mutations.mutation import ListError, Mutation
from tests.mutations.running import FAST_TESTS, Verdict, check_list, copy_project, judge_mutation, run_tests

ROOT = Path(__file__).resolve().parents[2]


def main(arguments: Sequence[str] | None = None, root: Path = ROOT, known: Sequence[Mutation] = MUTATIONS) -> int:
    """Run the program; returns its exit code: 0 all caught, 1 some not, 2 nothing could be judged."""
    options = _parser().parse_args(arguments)
    try:
        mutations = _chosen(known, options.only)
        check_list(root, mutations)
        if options.list:
            for mutation in mutations:
                print(f"{mutation.name}: {mutation.breaks} ({mutation.file})")
            return 0
        with tempfile.TemporaryDirectory(prefix="atra-mutations-", ignore_cleanup_errors=True) as scratch:
            verdicts = _judge(root, Path(options.folder or scratch).resolve(), mutations, options)
    except ListError as error:
        print(error, file=sys.stderr)
        return 2
    if options.table:
        options.table.write_text(markdown_table(verdicts, options.all_tests), encoding="utf-8")
    caught = sum(verdict.word == "caught" for verdict in verdicts)
    print(f"{caught} of {len(verdicts)} mutations were caught by {_tests_meant(options.all_tests)}")
    return 0 if caught == len(verdicts) else 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m tests.mutations", description="Put faults into copies of the code."
    )
    parser.add_argument("--all-tests", action="store_true", help="slow tests, too (default: only fast ones)")
    parser.add_argument("--only", action="append", metavar="NAME", help="this mutation alone; may be given repeatedly")
    parser.add_argument("--list", action="store_true", help="print the mutations, check that they fit, and end")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="mutations tested at once (default: 1)")
    parser.add_argument("--timeout", type=float, default=1800, metavar="S", help="seconds for one (default: 1800)")
    parser.add_argument(
        "--table", type=Path, metavar="PATH", help="write a Markdown table of what caught which mutation"
    )
    parser.add_argument("--folder", type=Path, metavar="PATH", help="keep the copy with its compiled kernels here")
    return parser


def _chosen(known: Sequence[Mutation], names: Sequence[str] | None) -> list[Mutation]:
    unknown = set(names or ()) - {mutation.name for mutation in known}
    if unknown:
        raise ListError(f"unknown mutation {sorted(unknown)[0]!r}; --list prints the names of all")
    return [mutation for mutation in known if not names or mutation.name in names]


def _judge(root: Path, folder: Path, mutations: Sequence[Mutation], options: argparse.Namespace) -> list[Verdict]:
    """Verdicts in the order of the mutations. Raises ListError where the tests fail without a mutation."""
    of_pytest = () if options.all_tests else FAST_TESTS
    unmutated = folder / "unmutated"
    copy_project(root, unmutated)
    tests = list(dict.fromkeys(test for mutation in mutations for test in mutation.caught_by))
    print(f"{len(tests)} tests without a mutation: ", end="", flush=True)
    run = run_tests(unmutated, tests, *of_pytest)
    if run.exit_code != 0:
        raise ListError(f"they must pass, and did not:\n{run.output}")
    print("they pass", flush=True)

    def judge(mutation: Mutation) -> Verdict:
        verdict = judge_mutation(unmutated, mutation, of_pytest, options.timeout)
        print(f"{mutation.name}: {verdict.word} in {verdict.time_s:.0f} s", *verdict.tests(), sep="\n    ", flush=True)
        if verdict.word == "not run":
            print(verdict.output, flush=True)
        return verdict

    with ThreadPoolExecutor(max(options.jobs, 1)) as pool:
        return list(pool.map(judge, mutations))


def markdown_table(verdicts: Sequence[Verdict], all_tests: bool) -> str:
    """A row for each mutation: what it breaks, and which tests caught it."""
    lines = ["| mutation | file | what it breaks | caught by |", "|---|---|---|---|"]
    for verdict in verdicts:
        mutation = verdict.mutation
        said = "; ".join(verdict.tests()) if verdict.word == "caught" else f"**{verdict.word}**"
        lines.append(f"| {mutation.name} | `{mutation.file}` | {mutation.breaks} | {said} |")
    caught = sum(verdict.word == "caught" for verdict in verdicts)
    lines += ["", f"{caught} of {len(verdicts)} were caught by {_tests_meant(all_tests)}."]
    return "\n".join(lines) + "\n"


def _tests_meant(all_tests: bool) -> str:
    return "fast and slow tests" if all_tests else "fast tests"


if __name__ == "__main__":
    sys.exit(main())
