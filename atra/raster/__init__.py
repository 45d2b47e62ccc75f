"""The rasteriser. All modules but `tracer` are kernels and what calls them, so none has the suffix `_kernels`."""
