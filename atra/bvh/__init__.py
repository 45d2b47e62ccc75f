"""Our own binary BVH, whose traversal may start anywhere; Embree's starts at its root."""
