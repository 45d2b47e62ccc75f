"""Ray classification: each ray belongs to a shaft, and starts from the BVH nodes in its shaft's list."""
