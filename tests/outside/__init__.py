"""Methods, workloads, scenes and programs from outside of this repository."""
