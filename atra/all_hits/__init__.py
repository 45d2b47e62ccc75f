"""All hits of a ray: the reductions over them, their results, and the kernels that reduce."""
