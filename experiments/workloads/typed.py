"""Typed workloads: columns, and what a record must hold, follow from types of results and from what is timed.

A result is a field of a `TypedDict`; a quantity is made of samples. The help of both stands in `help.toml`.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, NotRequired, get_args, get_origin, get_type_hints

import numpy as np

from experiments.harness.column import REAL, WHOLE, Column, dtype_of, middle
from experiments.harness.options import NoOptions
from experiments.harness.point import Workload, no_canary
from experiments.harness.records import Record
from experiments.results.statistics import Series, choosing_column, mean_of, reporting_columns, statistics_columns

HELP: dict[str, str] = tomllib.loads(Path(__file__).with_name("help.toml").read_text(encoding="utf-8"))
"""Name of a column -> what it holds: a phrase that stands alone."""

Mean = Annotated[float, mean_of]
"""A number of which a point has the geometric mean of its processes, as its interval is of that."""

Worst = Annotated[int, max]
"""A number of which a point has that of its worst process."""

Least = Annotated[float, min]
"""A number of which a point has the least of its processes."""

Unlisted = Annotated[int, None]
"""A number that every record holds and that is no column of the workload's."""


def columns_of(*kinds: type) -> tuple[Column, ...]:
    """A column for every number among the fields of these `TypedDict`s."""
    numbers = ((name, dtype_of(plain), hint) for kind in kinds for name, plain, hint in _fields(kind))
    return tuple(
        Column(name, dtype, HELP[name], over=over)
        for name, dtype, hint in numbers
        if dtype in (WHOLE, REAL) and (over := _over(hint)) is not None
    )


def needs_of(*kinds: type) -> tuple[str, ...]:
    """The fields of these `TypedDict`s that a measured record holds at least."""
    return tuple(name for kind in kinds for name, _, hint in _fields(kind) if get_origin(hint) is not NotRequired)


def _fields(kind: type) -> Iterator[tuple[str, Any, Any]]:
    """Name, type, and type with all that is said of it."""
    plain = get_type_hints(kind)
    for name, hint in get_type_hints(kind, include_extras=True).items():
        yield name, plain[name], hint


def _over(hint: Any) -> Any:
    """How values of several processes become one; None for a number without a column."""
    (inner,) = get_args(hint) if get_origin(hint) is NotRequired else (hint,)
    return inner.__metadata__[0] if hasattr(inner, "__metadata__") else middle


def series(name: str) -> Series:
    """A record -> its samples of `name`, None where it has none."""

    def read(record: Record) -> Any:
        values = record.samples.get(name)
        return None if values is None else np.asarray(values, np.float64)

    return read


def over(upper: Series, lower: Series) -> Series:
    """A record -> the ratios of two series, round by round; None where it has not both."""

    def ratios(record: Record) -> Any:
        above, below = upper(record), lower(record)
        return None if above is None or below is None else above / below

    return ratios


Quantity = str | tuple[str, str] | Callable[[Record], Any]
"""Samples of this name; the ratio of two, round by round; or a function of a record."""


@dataclass(frozen=True)
class Times:
    """What a workload times in rounds.

    quantities: names of columns -> what they are made of. Where {} stands in a name, the ends of the interval do, too;
    a name without is one number of a record, of the type that its function returns.
    judged: the samples whose spread flag a point. optional: samples of which a record holds one at least.
    chosen: quantities by which the best of several points is chosen, in some processes, and reported, in the others.
    canary: what a record says of the machine alone.
    """

    quantities: Mapping[str, Quantity]
    judged: str | None = None
    optional: frozenset[str] = frozenset()
    chosen: tuple[str, ...] = ()
    canary: Callable[[Record], float | None] = no_canary

    @property
    def samples(self) -> frozenset[str]:
        """Names of the samples that every record holds."""
        given = [made_of for made_of in self.quantities.values() if not callable(made_of)]
        names = (name for made_of in given for name in ([made_of] if isinstance(made_of, str) else made_of))
        return frozenset(names) - self.optional

    @property
    def columns(self) -> tuple[Column, ...]:
        """In the order of the quantities."""
        return tuple(column for name, made_of in self.quantities.items() for column in self._columns(name, made_of))

    def _columns(self, name: str, made_of: Quantity) -> Iterator[Column]:
        stem = name.format("")
        help = HELP[stem]
        if stem == name:
            assert callable(made_of)
            yield Column(name, dtype_of(get_type_hints(made_of)["return"]), help, made_of)
            return
        read = made_of if callable(made_of) else series(made_of) if isinstance(made_of, str) else _ratio(*made_of)
        yield from statistics_columns(name, help, read)
        if name in self.chosen:
            yield choosing_column(f"{stem}_half", help, read)
            yield from reporting_columns(stem, help, read)


def _ratio(upper: str, lower: str) -> Series:
    return over(series(upper), series(lower))


def workload(
    name: str, package: str, headline: Callable[[Record], str], *parts: type | Times, options: type = NoOptions,
    **fields: Any,
) -> Workload:  # fmt: skip
    """A workload whose columns, samples and needs follow from its parts, which have the order of the columns.

    parts: `TypedDict`s of results, and `Times`; the first `Times` is judged. fields: more fields of `Workload`; they
    replace those that follow from the parts.
    """
    times = [part for part in parts if isinstance(part, Times)]
    kinds = [part for part in parts if not isinstance(part, Times)]
    samples = frozenset[str]().union(*(part.samples for part in times))
    follow: dict[str, Any] = {"samples": lambda point: samples, "needs": needs_of(*kinds)}
    if times:
        follow |= {field: getattr(times[0], field) for field in ("judged", "optional", "canary")}
    columns = [part.columns if isinstance(part, Times) else columns_of(part) for part in parts]
    return Workload(name, options, sum(columns, ()), headline, package, **(follow | fields))
