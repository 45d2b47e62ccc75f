"""Worked examples, one for each thing that aligned rays are good for; the pages of docs show their pictures."""
