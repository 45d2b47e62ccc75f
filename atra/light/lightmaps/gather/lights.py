"""Lights of a bake: those of hybrid rendering, spots, emitting faces, and a panorama sky where rays are aimed at it."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, radians

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.geometry.view import Vector, checked_vector, unit_vector
from atra.light.checks import Colour, checked_number, set_fields
from atra.light.lightmaps.gather import tables_kernels as words
from atra.light.lights import Light, check_light, light_row, set_strength
from atra.light.sky import PanoramaSky, Sky


@dataclass(frozen=True)
class SpotLight:
    """A light at a point that shines into a cone.

    position: in the world. direction: the cone's axis. inner_degrees: angle from the axis where the light starts to
    fade smoothly. outer_degrees: angle from the axis where it ends, up to 90. colour: linear RGB. power: a factor; on
    the axis, a surface facing the light at distance 1 receives colour times power.
    """

    position: Vector
    direction: Vector
    inner_degrees: float = 20.0
    outer_degrees: float = 30.0
    colour: Colour = (1.0, 1.0, 1.0)
    power: float = 1.0

    def __post_init__(self) -> None:
        direction = checked_vector("direction of SpotLight", self.direction)
        unit_vector("direction of SpotLight", direction)
        outer = checked_number("outer_degrees of SpotLight", self.outer_degrees, 0.0, 90.0, above=True)
        inner = checked_number("inner_degrees of SpotLight", self.inner_degrees, 0.0, outer)
        position = checked_vector("position of SpotLight", self.position)
        set_fields(self, position=position, direction=direction, inner_degrees=inner, outer_degrees=outer)
        set_strength(self)


_LARGEST = 1e30
"""Upper limit of an estimated intensity; keeps float32 sums finite."""

BakeLight = Light | SpotLight


def check_bake_light(light: object) -> None:
    """Raise InputError for anything that is not a light."""
    if not isinstance(light, SpotLight):
        check_light(light)


@dataclass(frozen=True, eq=False)
class Aims:
    """A distribution of rays, proportional to brightness.

    shares: running sums up to 1, of faces or of cells of the sky. density: of a point on a face, or of a direction.
    row: (LIGHT_WORDS,) float32, the whole as one light.
    """

    shares: NDArray[np.float64]
    density: NDArray[np.float32]
    row: NDArray[np.float32]


def light_rows(lights: tuple[BakeLight, ...], others: list[NDArray[np.float32]]) -> NDArray[np.float32]:
    """(L, LIGHT_WORDS) float32 for kernels. others: rows of all emitting faces together, and of the sky, put at the
    end."""
    rows = np.zeros((len(lights) + len(others), words.LIGHT_WORDS), np.float32)
    for row, light in zip(rows, lights, strict=False):
        if isinstance(light, SpotLight):
            row[words.KIND], row[words.PLACE : words.SIZE] = (words.SPOT, light.position)
            row[words.ACROSS : words.UP] = unit_vector("direction of SpotLight", light.direction)
            row[words.CONE :] = cos(radians(light.inner_degrees)), cos(radians(light.outer_degrees))
        else:
            row[: words.COLOUR] = light_row(light)
        row[words.COLOUR : words.CONE] = light.power * np.array(light.colour)
    rows[len(lights) :] = np.array(others, np.float32).reshape(-1, words.LIGHT_WORDS)
    if not np.isfinite(rows).all():
        number = int(np.argmin(np.isfinite(rows).all(axis=1)))
        raise InputError(f"light {number} is {lights[number]!r:.200}, beyond what float32 can hold")
    return rows


def _row(kind: int, colour: NDArray[np.float64], place: NDArray[np.float64], spread: float) -> NDArray[np.float32]:
    row = np.zeros(words.LIGHT_WORDS)
    row[words.KIND], row[words.PLACE : words.SIZE], row[words.SIZE] = kind, place, spread
    row[words.COLOUR : words.CONE] = colour
    return np.clip(row, -_LARGEST, _LARGEST).astype(np.float32)


def aims_at_emitters(emission: NDArray[np.float32], corners: NDArray[np.float64]) -> tuple[NDArray[np.int32], Aims]:
    """(E,) int32, emitting faces, and their distribution. emission: (F, 3). corners: (F, 3, 3)."""
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2.0
    power = emission.astype(np.float64) @ np.array(words.LUMINANCE, np.float64) * areas
    faces = np.flatnonzero(power > 0.0)
    density = np.zeros(len(areas), np.float32)
    if not len(faces):
        return faces.astype(np.int32), Aims(np.zeros(0), density, np.zeros(words.LIGHT_WORDS, np.float32))
    share = power[faces] / power.sum()
    shares = np.cumsum(share)
    shares[-1] = 1.0
    density[faces] = share / areas[faces]
    centres = corners[faces].mean(axis=1)
    middle = share @ centres
    spread = float(np.sqrt(share @ ((centres - middle) ** 2).sum(axis=1)))
    colour = areas[faces] @ emission[faces].astype(np.float64) / np.pi
    return faces.astype(np.int32), Aims(shares, density, _row(words.EMITTERS, colour, middle, spread))


def aims_at_sky(sky: Sky) -> Aims | None:
    """The distribution over a panorama's texels; None for a black sky or a gradient, which scattered rays find as
    well."""
    if not isinstance(sky, PanoramaSky) or sky.power == 0.0:
        return None
    rows, columns, _ = sky.texels.shape
    bands = -np.diff(np.cos(np.linspace(0.0, np.pi, rows + 1))) * (2.0 * np.pi / columns)
    power = sky.texels.astype(np.float64) @ np.array(words.LUMINANCE, np.float64) * bands[:, None]
    if not power.sum() > 0.0:
        return None
    shares = np.cumsum(power.ravel()) / power.sum()
    shares[-1] = 1.0
    mean = sky.power * (sky.texels.astype(np.float64).sum(axis=1) * bands[:, None]).sum(axis=0) / (4.0 * np.pi)
    density = (power / power.sum() / bands[:, None]).astype(np.float32)
    return Aims(shares, density, _row(words.SKY, mean, np.zeros(3), 0.0))
