"""Affine-transformed ray alignment on Embree: exact primary visibility from fewer rays.

    with atra.AlignedTracer(mesh, camera, split=(128, 1)) as tracer:
        hits = tracer.trace()

Source: Y. Nishidate, I. Fujishiro, "Affine-transformed ray alignment for accelerating primary ray traversal -
Implementation with Embree".
"""

import lazy_loader

__version__ = "0.1.0"

# The names in `__init__.pyi`, each imported when it is first used, because importing Numba takes long.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
