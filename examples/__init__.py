"""Worked examples, one for each thing that aligned rays are good for; docs/library.md shows their pictures."""
