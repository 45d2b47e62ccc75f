"""Packed sweeps and boards."""
