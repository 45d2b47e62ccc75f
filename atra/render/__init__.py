"""Whole pictures on top of primary visibility: hybrid rendering and path tracing, their scenes and their files."""

from atra.render.hybrid import HybridRenderer
from atra.render.lights import PointLight, SphereLight, Sun
from atra.render.materials import Checker, Dielectric, Emissive, Image, Lambertian, Metal
from atra.render.options import HybridOptions, PathOptions
from atra.render.path import PathRenderer
from atra.render.scene import RenderScene
from atra.render.sky import GradientSky, PanoramaSky, constant_sky

__all__ = [
    "Checker",
    "Dielectric",
    "Emissive",
    "GradientSky",
    "HybridOptions",
    "HybridRenderer",
    "Image",
    "Lambertian",
    "Metal",
    "PanoramaSky",
    "PathOptions",
    "PathRenderer",
    "PointLight",
    "RenderScene",
    "SphereLight",
    "Sun",
    "constant_sky",
]
