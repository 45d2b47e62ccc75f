"""The kernels that gather all hits along rays: one file a reduction, and what decides which triangles a ray crosses."""
