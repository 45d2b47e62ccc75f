"""A BVH of our own. All modules but `bvh`, `scene` and `tracer` are kernels, so none has the suffix `_kernels`."""
