"""The console command `atra`."""

import io
import sys


def escape_what_stdout_lacks() -> None:
    """Print characters that the encoding of standard output lacks escaped, as on standard error, instead of failing."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")
