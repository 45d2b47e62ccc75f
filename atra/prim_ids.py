"""`MISS`: what stands for a triangle where a ray hits none."""

import numpy as np

MISS = np.uint32(0xFFFFFFFF)
"""`prim_id` of a ray that hits nothing."""
