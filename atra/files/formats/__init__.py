"""Formats of mesh files, each with a reader of its own."""
