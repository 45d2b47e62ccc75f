"""Scattering: how light continues from a surface, by the kind of its material, and the random numbers that choose."""
