"""Checks of colours and numbers that users pass in; errors name the value and what was expected."""

from __future__ import annotations

from math import inf, isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.choices import check_choice, check_flags
from atra.compiled.instruction_sets import chosen_instruction_set
from atra.compiled.threads import resolve_threads
from atra.embree.scene import BUILD_QUALITIES, resolve_packet_width
from atra.errors import InputError
from atra.geometry.numbers import as_number, checked_vector
from atra.whole_numbers import is_whole_number

Colour = tuple[float, float, float]


def checked_number(name: str, value: Any, low: float, high: float = inf, above: bool = False) -> float:
    """`value` as a float from `low` to `high`; above: without `low` itself. Raises InputError naming it otherwise."""
    number = as_number(value)
    if not isfinite(number) or not low <= number <= high or (above and number == low):
        least = f"above {low:g}" if above else f"of at least {low:g}"
        most = "" if high == inf else f" and at most {high:g}"
        raise InputError(f"{name} is {value!r}, expected a finite number {least}{most}")
    return number


def check_rays(options: Any) -> None:
    """Raise InputError for options of scenes of rays that cannot be. options: has threads, packet_width, build_quality
    and robust."""
    resolve_threads(options.threads)
    chosen_instruction_set()
    resolve_packet_width(options.packet_width)
    check_choice("build_quality", options.build_quality, BUILD_QUALITIES)
    check_flags(robust=options.robust)


def check_clamp(options: Any) -> None:
    """Check the number `clamp` of options, and make it a float. Raises InputError."""
    if options.clamp is not None:
        set_fields(options, clamp=checked_number("clamp", options.clamp, 0.0, 1e30, above=True))


def check_whole(name: str, value: Any, low: int, high: float = inf) -> None:
    """Raise InputError, naming the value, unless it is a whole number from `low` to `high`."""
    if not is_whole_number(value) or not low <= value <= high:
        expected = f"of at least {low}" if high == inf else f"from {low} to {high}"
        raise InputError(f"{name} is {value!r}, expected a whole number {expected}")


def checked_colour(name: str, value: Any, high: float = inf) -> Colour:
    """`value` as linear RGB, three numbers from 0 to `high`; a single number is a grey. Raises InputError."""
    if isinstance(value, (int, float, np.number)):
        value = (value, value, value)
    colour = checked_vector(name, value)
    for channel in colour:
        checked_number(name, channel, 0.0, high)
    return colour


def checked_texels(name: str, value: Any, high: float = inf, channels: tuple[int, ...] = (3,)) -> NDArray[np.float32]:
    """`value` as a read-only (H, W, one of `channels`) float32 copy, linear light from 0 to `high`. Raises InputError
    naming the first texel outside."""
    texels = _float32(name, value)
    if texels.ndim != 3 or texels.shape[2] not in channels or texels.size == 0:
        expected = " or ".join(f"(H, W, {count})" for count in channels)
        raise InputError(f"{name} has shape {texels.shape}, expected {expected}")
    good = (texels >= 0.0) & (texels <= high) & np.isfinite(texels)
    if not good.all():
        y, x, _ = np.argwhere(~good)[0].tolist()
        most = "" if high == inf else f", at most {high:g}"
        raise InputError(f"{name} has {texels[y, x].tolist()} at column {x} of row {y}, expected numbers >= 0{most}")
    texels.setflags(write=False)
    return texels


def checked_image(name: str, value: Any) -> NDArray[Any]:
    """`value` as a read-only copy, (H, W, 3 or 4), uint8 or float32 in [0, 1]. Raises InputError naming the first texel
    outside."""
    given = np.asarray(value)
    if given.dtype != np.uint8 or given.ndim != 3 or given.shape[2] not in (3, 4) or given.size == 0:
        return checked_texels(name, value, 1.0, (3, 4))
    texels = given.copy() if given.flags.writeable else given  # what nobody can change needs no copy
    texels.setflags(write=False)
    return texels


def checked_rows(
    name: str, value: Any, shape: tuple[int | None, ...], each: str, low: float, high: float
) -> NDArray[np.float32]:
    """`value` as a read-only float32 copy with a row per `each`, numbers from `low` to `high`.

    shape: None stands for any length above 0. Raises InputError naming the first row outside.
    """
    rows = _float32(name, value)
    fits = [size > 0 if wanted is None else size == wanted for size, wanted in zip(rows.shape, shape, strict=False)]
    if rows.ndim != len(shape) or not all(fits):
        wanted = ", ".join("N" if size is None else str(size) for size in shape)
        raise InputError(f"{name} has shape {rows.shape}, expected ({wanted}), one row per {each}")
    good = ((rows >= low) & (rows <= high)).reshape(len(rows), -1).all(axis=1)
    if not good.all():
        number = int(np.argmin(good))
        found = rows[number].tolist()
        raise InputError(f"{name} of {each} {number} is {found}, expected numbers from {low:g} to {high:g}")
    rows.setflags(write=False)
    return rows


def _float32(name: str, value: Any) -> NDArray[np.float32]:
    try:
        with np.errstate(over="ignore"):  # inf is refused later
            return np.array(value, np.float32, order="C")
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} cannot be read as an array: {error}") from None


def set_fields(value: object, **fields: Any) -> None:
    """Set fields of a frozen dataclass, for its constructor."""
    for name, field in fields.items():
        object.__setattr__(value, name, field)


def check_fields(value: object, **bounds: Any) -> None:
    """Check fields of a frozen dataclass, for its constructor: colours of at most a number, numbers within two.

    bounds: of each field, as `checked_colour` and `checked_number` take them. Raises InputError naming field and class.
    """
    for name, bound in bounds.items():
        check, limits = (checked_number, bound) if isinstance(bound, tuple) else (checked_colour, (bound,))
        told = f"{name} of {type(value).__name__}"
        set_fields(value, **{name: check(told, getattr(value, name), *limits)})  # type: ignore[operator]
