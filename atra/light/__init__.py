"""Pictures and lightmaps of a mesh with materials, lights and a sky."""

from atra.light.lightmaps.baker import Baker
from atra.light.lightmaps.charts.atlas import Atlas
from atra.light.lightmaps.charts.texels import Texels, atlas_of
from atra.light.lightmaps.finish.denoise import denoised
from atra.light.lightmaps.finish.export import save_maps
from atra.light.lightmaps.finish.models import save_lit_model, save_model
from atra.light.lightmaps.finish.seams import Seams, dilated
from atra.light.lightmaps.finish.views import clay_view, lit_view
from atra.light.lightmaps.maps import Lightmap, relative_error
from atra.light.lightmaps.probes import LightProbes
from atra.light.lights import PointLight, SphereLight, SpotLight, Sun
from atra.light.materials import Dielectric, Emissive, Lambertian, Metal, MetallicRoughness
from atra.light.pictures.finish.accumulate import Progress, accumulate
from atra.light.pictures.finish.tone import stops_of, toned
from atra.light.pictures.hybrid import HybridRenderer
from atra.light.pictures.paths import PathRenderer
from atra.light.pictures.renderer import Renderer
from atra.light.reading.scenes import load_scene
from atra.light.scene import Scene, ScenePart
from atra.light.sky import GradientSky, PanoramaSky, constant_sky
from atra.light.textures import Checker, Image

__all__ = [
    "Atlas",
    "Baker",
    "Checker",
    "Dielectric",
    "Emissive",
    "GradientSky",
    "HybridRenderer",
    "Image",
    "Lambertian",
    "LightProbes",
    "Lightmap",
    "Metal",
    "MetallicRoughness",
    "PanoramaSky",
    "PathRenderer",
    "PointLight",
    "Progress",
    "Renderer",
    "Scene",
    "ScenePart",
    "Seams",
    "SphereLight",
    "SpotLight",
    "Sun",
    "Texels",
    "accumulate",
    "atlas_of",
    "clay_view",
    "constant_sky",
    "denoised",
    "dilated",
    "lit_view",
    "load_scene",
    "relative_error",
    "save_lit_model",
    "save_maps",
    "save_model",
    "stops_of",
    "toned",
]
