"""Tracers: mesh and camera in, hits out. One protocol, so that harness and comparison know only `Tracer`."""
