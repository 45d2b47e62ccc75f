"""Worked examples, one for each thing that aligned rays are good for; `docs/` has a page on each with its picture."""
