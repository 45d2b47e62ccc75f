"""A request: all that a picture depends on, as one frozen value, so that no picture is half of one, half of another."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from math import cos, radians, sin, sqrt

from atra.geometry.camera import Camera
from atra.geometry.numbers import Vector

FRAMES = ("hybrid", "path")
SHADES = ("material", "normal", "depth", "prim_id", "occlusion", "wrong")
OF_HITS = ("normal", "depth", "prim_id", "wrong")
"""Shades that show primary hits, for which one sample is enough."""

COLUMNS = 64
"""Picture widths are multiples of this, so each can be cut into up to as many columns of cells."""

SPLITS = (2, 4, 8, 16, 32, 64)

_WIDEST = 5.0
"""Largest ratio of the sides of a picture; a browser that opens may briefly report any page size."""

_LIGHTING = frozenset({"sun_power", "sun_colour", "sky_power"})

_SHOWN = frozenset({"samples", "shade", "frame", "exposure", "tone", "denoise"})
"""What changes no light."""


@dataclass(frozen=True)
class Settings:
    """Parameters of both articles on whole frames, and what is shown of them; what draws with them checks them.

    frame: "hybrid" or "path". shade: "material", the picture; "normal", "depth", "prim_id", of what is seen;
    "occlusion", the share of the sky; "wrong", pixels that differ from `rtcIntersect1`. samples: of a resting picture.
    side: the picture has about side x side pixels. method, split_x: of primary visibility at rest (`atra.METHODS`), and
    its columns of cells where it has cells. exposure: stops. tone: the tone map's name. denoise: whether a picture with
    all its samples is shown without noise. Moving pictures have no shadows. sun_power: 0 for no sun. sun_heading,
    sun_height: in degrees, where the sun stands, about +y and above the horizon. sun_cone: half the angle under which
    it appears, in degrees. All others: see `atra.light`'s options, lights and skies.
    """

    frame: str = "hybrid"
    shade: str = "material"
    samples: int = 64
    side: int = 512
    method: str = "raster"
    split_x: int = COLUMNS
    jitter: str = "shared"
    shadow_rays: int = 1
    shadow_length: float = 1e4
    sun_cone: float = 0.5
    sun_heading: float = 60.0
    sun_height: float = 60.0
    sun_power: float = 1.0
    sun_colour: tuple[int, int, int] = (255, 255, 255)
    sky_power: float = 0.5
    occlusion_rays: int = 1
    occlusion_length: float = 10.0
    occlusion: str = "uniform"
    bounces: int = 4
    exposure: float = 0.0
    tone: str = "neutral"
    denoise: bool = False

    @property
    def renderer(self) -> str:
        """Which of `FRAMES` draws it: occlusion is hybrid rendering's alone."""
        return FRAMES[0] if self.shade == "occlusion" else self.frame

    @property
    def enough(self) -> int:
        """Samples after which the picture is done."""
        return 1 if self.shade in OF_HITS else self.samples

    @property
    def sun_direction(self) -> Vector:
        """The way its light travels."""
        heading, height = radians(self.sun_heading), radians(self.sun_height)
        return -cos(height) * sin(heading), -sin(height), -cos(height) * cos(heading)

    def keeps_samples_of(self, old: Settings) -> bool:
        """Whether samples added with `old` are samples of these: hybrid rendering adds up light apart from its colour
        and power."""
        changed = {one.name for one in fields(self) if getattr(self, one.name) != getattr(old, one.name)}
        free = _SHOWN | (_LIGHTING if self.renderer == FRAMES[0] else frozenset())
        has_sun = self.sun_power > 0.0, old.sun_power > 0.0
        return self.renderer == old.renderer and changed <= free and has_sun[0] == has_sun[1]


@dataclass(frozen=True)
class Pose:
    """Where a page looks from. aspect: its width over its height. The others: of `Camera`, which checks them."""

    eye: Vector
    target: Vector
    up: Vector
    fov_y_degrees: float
    aspect: float = 1.0


@dataclass(frozen=True)
class Request:
    """One camera and one set of parameters."""

    pose: Pose
    settings: Settings

    @cached_property
    def camera(self) -> Camera:
        """With as many pixels as the settings ask for, as wide as the page. Raises InputError as `Camera` does."""
        pose, side = self.pose, self.settings.side
        aspect = min(max(pose.aspect, 1.0 / _WIDEST), _WIDEST)
        width = COLUMNS * max(1, round(side * sqrt(aspect) / COLUMNS))
        return Camera(pose.eye, pose.target, pose.up, pose.fov_y_degrees, width, max(1, round(width / aspect)))

    def keeps_samples_of(self, old: Request) -> bool:
        """Whether samples added for `old` are samples of this one."""
        return self.pose == old.pose and self.settings.keeps_samples_of(old.settings)
