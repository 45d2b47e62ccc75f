"""Trees of triangles: how they are built, and how they lie in memory."""
