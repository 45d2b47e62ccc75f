"""Binary BVHs of triangles: their build and their layout in memory, for whoever traverses them."""
