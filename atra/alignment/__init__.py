"""The paper's method: affine maps that lay the rays of all cells onto one reference cell, and the tracers that use
them."""
