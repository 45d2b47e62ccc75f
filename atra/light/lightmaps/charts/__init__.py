"""Charts of a mesh: where its triangles lie in a map, and which texels they have."""
