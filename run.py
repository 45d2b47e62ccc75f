"""Command line: `python run.py` measures one point, `python run.py sweep=horizontal` sweeps.

Exit codes: 0 done, 1 something failed, 2 the input cannot be used, 130 interrupted.
"""

from __future__ import annotations

import os
import signal
import sys
import traceback

# Hydra then raises its errors instead of printing them at length; they are shown below, shortened.
os.environ["HYDRA_FULL_ERROR"] = "1"

import hydra
from hydra.errors import HydraException
from omegaconf import DictConfig
from omegaconf.errors import OmegaConfBaseException

from atra.errors import AtraError
from experiments.configuration import read_configuration, register_schema
from experiments.messages import shorten_configuration_error


@hydra.main(config_path="conf", config_name="config", version_base="1.3")
def measure_one_point(composed: DictConfig) -> None:
    # SystemExit passes through Hydra silently; any other exception is announced by Hydra first.
    try:
        from experiments.single import run_single_point

        run_single_point(read_configuration(composed))
    except (AtraError, OmegaConfBaseException) as error:
        raise SystemExit(_refuse(error)) from error


def _refuse(error: Exception) -> int:
    if "debug=true" in (argument.lower() for argument in sys.argv):
        traceback.print_exception(error)
    message = str(error) if isinstance(error, AtraError) else shorten_configuration_error(error)
    print(f"run.py: {message}", file=sys.stderr)
    return 2


def main() -> int:
    register_schema()
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        measure_one_point()
    except (AtraError, HydraException, OmegaConfBaseException) as error:
        return _refuse(error)
    except KeyboardInterrupt:
        print("run.py: interrupted", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
