"""One-off studies: each one file over `in_processes`; `python -m experiments.studies NAME ...` runs one."""
