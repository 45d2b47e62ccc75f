"""Lights: points, spheres, spots and suns."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import cos, radians, tan
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.geometry.numbers import Vector, as_vector, checked_vector, unit_vector
from atra.light.checks import Colour, checked_colour, checked_number, set_fields
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
        direction = checked_vector("direction of Sun", self.direction)
        unit_vector("direction of Sun", direction)
        angle = checked_number("angle_degrees of Sun", self.angle_degrees, 0.0, 45.0)
        set_fields(self, direction=direction, angle_degrees=angle)
        set_strength(self)


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
        set_fields(self, position=checked_vector("position of PointLight", self.position))
        set_strength(self)


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
        position = checked_vector("position of SphereLight", self.position)
        set_fields(
            self, position=position, radius=checked_number("radius of SphereLight", self.radius, 0.0, above=True)
        )
        set_strength(self)


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


Light = Sun | PointLight | SphereLight | SpotLight


_Lamp = TypeVar("_Lamp")


def light_from(light: _Lamp, origin: NDArray[np.float64]) -> _Lamp:
    """The light with a position that counts from `origin`, (3,) float64; a sun has none."""
    if not isinstance(light, PointLight | SphereLight | SpotLight):
        return light
    return replace(light, position=as_vector(np.asarray(light.position) - origin))


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
    elif isinstance(light, PointLight):
        row[KIND], row[PLACE:SIZE] = POINT, light.position
    else:
        raise AssertionError(light)
    return row


def set_strength(light: Any) -> None:
    """Check colour and power of a light."""
    name = type(light).__name__
    colour = checked_colour(f"colour of {name}", light.colour, 1e12)
    set_fields(light, colour=colour, power=checked_number(f"power of {name}", light.power, 0.0, 1e12))


def check_light(light: object) -> None:
    """Raise InputError for anything that is not a light."""
    if not isinstance(light, Light):
        raise InputError(f"a light is {light!r:.100}, expected Sun, PointLight, SphereLight or SpotLight")
