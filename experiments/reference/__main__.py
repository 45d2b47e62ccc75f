"""Writes docs/reference.md anew."""

from experiments.reference.page import PAGE, reference

PAGE.write_text(reference(), encoding="utf-8")
