"""Lightmaps: charts of a mesh, their texels, and the light that reaches each."""

from atra.bake.baker import Baker
from atra.bake.charts.atlas import Atlas
from atra.bake.charts.texels import Texels
from atra.bake.finish.denoise import denoised
from atra.bake.finish.export import save_maps, save_model
from atra.bake.finish.seams import Seams, dilated
from atra.bake.finish.views import clay_view, lit_view
from atra.bake.light.lights import SpotLight
from atra.bake.light.probes import LightProbes
from atra.bake.maps import Lightmap, relative_error
from atra.bake.options import BakeOptions
from atra.bake.progressive import ProgressiveBake
from atra.bake.surface import BakeScene, Surface

__all__ = [
    "Atlas",
    "BakeOptions",
    "BakeScene",
    "Baker",
    "LightProbes",
    "Lightmap",
    "ProgressiveBake",
    "Seams",
    "SpotLight",
    "Surface",
    "Texels",
    "clay_view",
    "denoised",
    "dilated",
    "lit_view",
    "relative_error",
    "save_maps",
    "save_model",
]
