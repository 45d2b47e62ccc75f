"""Lights: points, spheres, spots and suns."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, inf, radians, tan
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.geometry.numbers import Vector, checked_vector, unit_vector
from atra.light.checks import Colour, check_fields, set_fields
from atra.light.lights_kernels import ACROSS, KIND, LIGHT_WORDS, PLACE, POINT, SIZE, SPHERE, SPOT, SUN, UP

_WHITE: Colour = (1.0, 1.0, 1.0)


@dataclass(frozen=True)
class Sun:
    """A light at infinity.

    direction: the way its light travels. angle_degrees: half its apparent angle, 0 to 45. colour: linear RGB. power: a
    factor; a surface facing the sun reflects its albedo times colour times power.
    """

    direction: Vector
    angle_degrees: float = 0.25
    colour: Colour = _WHITE
    power: float = 1.0

    def __post_init__(self) -> None:
        _check(self, angle_degrees=(0.0, 45.0))


@dataclass(frozen=True)
class PointLight:
    """A light at a point.

    position: in the world. colour: linear RGB. power: a factor; a surface facing the light at distance 1 receives
    colour times power.
    """

    position: Vector
    colour: Colour = _WHITE
    power: float = 1.0

    def __post_init__(self) -> None:
        _check(self)


@dataclass(frozen=True)
class SphereLight:
    """A spherical light that is itself invisible.

    position: of its centre, in the world. radius: scene units. colour: linear RGB. power: a factor; far away, a surface
    facing it receives colour times power over the squared distance to its centre.
    """

    position: Vector
    radius: float
    colour: Colour = _WHITE
    power: float = 1.0

    def __post_init__(self) -> None:
        _check(self, radius=(0.0, inf, True))


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
    colour: Colour = _WHITE
    power: float = 1.0

    def __post_init__(self) -> None:
        _check(self, outer_degrees=(0.0, 90.0, True))
        check_fields(self, inner_degrees=(0.0, self.outer_degrees))


Light = Sun | PointLight | SphereLight | SpotLight


def _check(light: Any, **bounds: Any) -> None:
    """Check where a light stands and shines, its colour and power, and further fields as `check_fields` does."""
    for name in ("position", "direction"):
        if hasattr(light, name):
            told = f"{name} of {type(light).__name__}"
            set_fields(light, **{name: checked_vector(told, getattr(light, name))})
            if name == "direction":
                unit_vector(told, light.direction)
    check_fields(light, colour=1e12, power=(0.0, 1e12), **bounds)


def light_row(light: Light) -> NDArray[np.float32]:
    """(LIGHT_WORDS,) float32, a light for kernels, without colour and power: they scale the finished picture."""
    row = np.zeros(LIGHT_WORDS, np.float32)
    if isinstance(light, Sun):
        to_light = -unit_vector("direction of Sun", light.direction)
        across = unit_vector("across", np.cross(to_light, np.eye(3)[np.argmin(np.abs(to_light))]))
        row[KIND], row[PLACE:SIZE], row[SIZE] = SUN, to_light, tan(radians(light.angle_degrees))
        row[ACROSS:UP], row[UP:] = across, np.cross(to_light, across)
    elif isinstance(light, SphereLight):
        row[KIND], row[PLACE:SIZE], row[SIZE] = SPHERE, light.position, light.radius
    elif isinstance(light, SpotLight):
        row[KIND], row[PLACE:SIZE] = SPOT, light.position
        row[ACROSS:UP] = unit_vector("direction of SpotLight", light.direction)
        row[UP : UP + 2] = cos(radians(light.inner_degrees)), cos(radians(light.outer_degrees))
    else:
        row[KIND], row[PLACE:SIZE] = POINT, light.position
    return row
