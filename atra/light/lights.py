"""Lights of hybrid rendering: points, spheres, and a sun, of any colour and power."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians, tan

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.geometry.view import Vector, checked_vector, unit_vector
from atra.light.checks import Colour, checked_colour, checked_number
from atra.light.lights_kernels import ACROSS, KIND, LIGHT_WORDS, PLACE, POINT, SIZE, SPHERE, SUN, UP

_WHITE: Colour = (1.0, 1.0, 1.0)


@dataclass(frozen=True)
class Sun:
    """Light from very far away. direction: the way it travels. angle_degrees: half the angle under which it appears, in
    [0, 45]. colour times power: what a surface facing it receives, so that it returns its albedo times that."""

    direction: Vector
    angle_degrees: float = 0.25
    colour: Colour = _WHITE
    power: float = 1.0

    def __post_init__(self) -> None:
        direction = checked_vector("direction of Sun", self.direction)
        unit_vector("direction of Sun", direction)
        object.__setattr__(self, "direction", direction)
        angle = checked_number("angle_degrees of Sun", self.angle_degrees, 0.0, 45.0)
        object.__setattr__(self, "angle_degrees", angle)
        _check_strength(self)


@dataclass(frozen=True)
class PointLight:
    """Light from a point. colour times power: what a surface facing it at distance 1 receives."""

    position: Vector
    colour: Colour = _WHITE
    power: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "position", checked_vector("position of PointLight", self.position))
        _check_strength(self)


@dataclass(frozen=True)
class SphereLight:
    """Light from a sphere that nobody sees. colour times power: what a surface facing it receives, times the square of
    the distance to its middle where that is large."""

    position: Vector
    radius: float
    colour: Colour = _WHITE
    power: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "position", checked_vector("position of SphereLight", self.position))
        object.__setattr__(self, "radius", checked_number("radius of SphereLight", self.radius, 0.0, above=True))
        _check_strength(self)


Light = Sun | PointLight | SphereLight


def light_row(light: Light) -> NDArray[np.float32]:
    """(LIGHT_WORDS,) float32, as kernels read it; without colour and power, which are added to a finished picture."""
    row = np.zeros(LIGHT_WORDS, np.float32)
    if isinstance(light, Sun):
        to_light = -unit_vector("direction of Sun", light.direction)
        across = unit_vector("across", np.cross(to_light, np.eye(3)[np.argmin(np.abs(to_light))]))
        row[KIND], row[PLACE:SIZE], row[SIZE] = SUN, to_light, tan(radians(light.angle_degrees))
        row[ACROSS:UP], row[UP:] = across, np.cross(to_light, across)
    elif isinstance(light, SphereLight):
        row[KIND], row[PLACE:SIZE], row[SIZE] = SPHERE, light.position, light.radius
    else:
        row[KIND], row[PLACE:SIZE] = POINT, light.position
    return row


def _check_strength(light: Light) -> None:
    name = type(light).__name__
    object.__setattr__(light, "colour", checked_colour(f"colour of {name}", light.colour, 1e12))
    object.__setattr__(light, "power", checked_number(f"power of {name}", light.power, 0.0, 1e12))


def check_light(light: object) -> None:
    """Raise InputError for what is no light."""
    if not isinstance(light, Light):
        raise InputError(f"a light is {light!r:.100}, expected Sun, PointLight or SphereLight")
