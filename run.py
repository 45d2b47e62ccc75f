"""Command line: see `experiments/cli.py`."""

from experiments.cli import main

if __name__ == "__main__":
    raise SystemExit(main())
