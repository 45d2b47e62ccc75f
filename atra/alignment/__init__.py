"""The paper's maps from cells onto one reference cell, and what of the mesh each cell's copy holds."""
