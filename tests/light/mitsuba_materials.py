"""Materials of Mitsuba 3 that only tests compare with: bumps, and glTF's thin glass."""

import importlib

import numpy as np

from atra.light import Image, MetallicRoughness
from experiments.light.mitsuba_light import material_of


def material_in_room(mi, material):
    """A material for `parts_of`: a plain one, paint with an image of normals, or a clear pane."""
    match material:
        case MetallicRoughness(
            specular=0.0, metallic=0.0, transmission=0.0, colour=tuple(), normals=Image() as normals
        ):
            texels = np.array(normals.texels[..., :3], np.float32)
            bumps = {"type": "bitmap", "bitmap": mi.Bitmap(texels), "raw": True}
            base = {"type": "diffuse", "reflectance": {"type": "rgb", "value": list(material.colour)}}
            bumpy = {"type": "normalmap", "normalmap": bumps, "bsdf": base, "use_shadowing_function": False}
            return {"type": "twosided", "bsdf": bumpy}
        case MetallicRoughness(transmission=1.0, metallic=0.0, roughness=0.0, is_thin=True, colour=tuple() as colour):
            return _pane(mi, ((material.ior - 1.0) / (material.ior + 1.0)) ** 2, colour)
    return material_of(mi, material)


def _pane(mi, least, colour):
    """glTF's thin glass: mirrors by Schlick's approximation, and lets the rest straight on. Mitsuba's own also counts
    light that is mirrored within the pane."""
    dr = importlib.import_module("drjit")

    class Pane(mi.BSDF):
        def __init__(self, properties):
            super().__init__(properties)
            sides = mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
            self.m_components = [kind | sides for kind in (mi.BSDFFlags.DeltaReflection, mi.BSDFFlags.Null)]
            self.m_flags = self.m_components[0] | self.m_components[1]

        def sample(self, context, hit, chance, place, active=True):
            found = mi.BSDFSample3f()
            mirrored = least + (1.0 - least) * (1.0 - dr.abs(mi.Frame3f.cos_theta(hit.wi))) ** 5
            is_mirrored = chance < mirrored
            found.wo = dr.select(is_mirrored, mi.reflect(hit.wi), -hit.wi)
            found.pdf, found.eta = dr.select(is_mirrored, mirrored, 1.0 - mirrored), 1.0
            kinds = mi.UInt32(+mi.BSDFFlags.DeltaReflection), mi.UInt32(+mi.BSDFFlags.Null)
            found.sampled_type = dr.select(is_mirrored, *kinds)
            found.sampled_component = dr.select(is_mirrored, mi.UInt32(0), mi.UInt32(1))
            return found, dr.select(active, dr.select(is_mirrored, mi.Color3f(1.0), mi.Color3f(colour)), 0.0)

        def eval(self, *_):
            return mi.Color3f(0.0)

        def pdf(self, *_):
            return mi.Float(0.0)

        def eval_pdf(self, *_):
            return self.eval(), self.pdf()

    return Pane(mi.Properties())
