"""Method `program`: an external program in any language that traces rays it reads from files.

The program reads commands as lines on standard input and answers each with one line on standard output, `ok` or
`error` and a text. Files are binary, little endian, without a header:

    command                  answer                file
    atra-rays 1              ok NAME VERSION
    threads N                ok
    mesh V F PATH            ok SECONDS            V x 3 float32 vertices, then F x 3 uint32 faces
    rays N PATH              ok                    N x 8 float32: origin, tnear, direction, tfar
    trace PATH               ok SECONDS            to be written: N float32 t, then N uint32 faces
    end                      (it ends)

A path goes on to the end of its line. SECONDS are by the program's own clock: of building, and of tracing without
reading and writing files. They count where the harness's clock allows them. A miss has t = infinity and the face
0xFFFFFFFF; t is in lengths of the direction. Standard error is the program's own.
"""

from __future__ import annotations

import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import psutil
from numpy.typing import NDArray

from atra.compiled.threads import WorkerPool
from atra.errors import ClockError, InputError, printable
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.tracing.method import Method as TracingMethod
from atra.tracing.method import Prepared
from atra.tracing.tracer import Tracer
from experiments.drawing.style import GREY
from experiments.harness.entry_points import digest_of_files
from experiments.harness.method import Method, Style, Tracing
from experiments.harness.options import option
from experiments.methods.outside.guarded import Guarded
from experiments.methods.peers.peer import world_directions

VERSION = 1
"""Version of the protocol."""

_EXAMPLE = Path(__file__).resolve().parents[3] / "examples" / "external" / "trace.py"
_LONGEST_ANSWER = 4096
_END_S = 5.0


@dataclass(frozen=True)
class ProgramOptions:
    """Which program traces."""

    command: str = option("", "the program and its arguments, as in a shell; empty = the example in Python")
    program_sha256: str = option("", "hash of the program's files, set when a run begins")


@dataclass(frozen=True)
class Program(TracingMethod):
    """An external program as a method. command: as in a shell."""

    command: str

    def prepare(self, mesh: Mesh, camera: View, pool: WorkerPool) -> PreparedProgram:
        """Start it and hand over the mesh."""
        return PreparedProgram(self.command, mesh, camera, pool.threads)


class PreparedProgram(Prepared):
    """A running program that has the mesh and the rays of the last offset. time_s, build_time_s: by its own clock.

    Raises InputError for a program that cannot be started, answers something else than it should, or ends.
    """

    def __init__(self, command: str, mesh: Mesh, camera: View, threads: int) -> None:
        self._camera, self._count = camera, camera.height * camera.width
        words = shlex.split(command)
        self._name, self.time_s = Path(words[-1]).name, 0.0
        try:
            self._running = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        except OSError as error:
            raise InputError(f"program {command} cannot be started: {error}") from None
        self._folder = tempfile.TemporaryDirectory(prefix="atra-rays-", ignore_cleanup_errors=True)
        try:
            path = self._path("mesh")
            path.write_bytes(mesh.vertices.astype("<f4").tobytes() + mesh.faces.astype("<u4").tobytes())
            self._ask("atra-rays", VERSION)
            self._ask("threads", threads)
            self.build_time_s = self._ask_seconds("mesh", len(mesh.vertices), mesh.triangle_count, path)
            self._send_rays((0.5, 0.5))
        except BaseException:
            self.close()
            raise

    @property
    def process(self) -> psutil.Process:
        """That of the program."""
        return psutil.Process(self._running.pid)

    def _path(self, name: str) -> Path:
        return Path(self._folder.name, name)

    def _ask(self, *words: object) -> str:
        """Send a command and return what follows `ok`."""
        assert self._running.stdin is not None
        assert self._running.stdout is not None
        with suppress(OSError):  # one that has ended is found out by its answer
            self._running.stdin.write((" ".join(map(str, words)) + "\n").encode())
            self._running.stdin.flush()
        answer = self._running.stdout.readline(_LONGEST_ANSWER).decode(errors="replace")
        if not answer:
            code = self._running.wait(_END_S)
            raise InputError(f"program {self._name} ended with exit code {code} when asked to {words[0]}")
        kind, _, text = answer.strip().partition(" ")
        if kind != "ok" or not answer.endswith("\n"):
            raise InputError(f"program {self._name} answered {printable(answer.strip())[:200]!r} to {words[0]}")
        return text.strip()

    def _ask_seconds(self, *words: object) -> float:
        """`_ask`, with an answer in seconds. Raises ClockError for a time that the harness could not have waited."""
        start = perf_counter()
        text = self._ask(*words)
        waited_s = perf_counter() - start
        try:
            seconds = float(text)
        except ValueError:
            raise InputError(f"program {self._name} answered {text[:200]!r} to {words[0]}, expected seconds") from None
        if not 0.0 < seconds <= waited_s:
            raise ClockError(
                f"program {self._name} says that {words[0]} took {seconds:g} s; the harness waited {waited_s:.3g} s"
            )
        return seconds

    def _send_rays(self, offset: tuple[float, float]) -> None:
        rays = np.empty((self._count, 8), "<f4")
        rays[:, :3], rays[:, 3] = np.asarray(self._camera.eye, np.float32), 0.0
        rays[:, 4:7], rays[:, 7] = world_directions(self._camera, offset), np.inf
        self._path("rays").write_bytes(rays.tobytes())
        self._ask("rays", self._count, self._path("rays"))
        self._offset = tuple(offset)

    def draw(self, offset: tuple[float, float], depth: NDArray[np.float32], prim_id: NDArray[np.uint32]) -> None:
        """See `Prepared.draw`. Raises InputError for a file of another length."""
        if tuple(offset) != self._offset:
            self._send_rays(offset)
        path = self._path("hits")
        self.time_s = self._ask_seconds("trace", path)
        words = np.fromfile(path, "<u4") if path.is_file() else np.empty(0, "<u4")
        if len(words) != 2 * self._count:
            raise InputError(f"the program wrote {words.nbytes:,} bytes of hits, expected {8 * self._count:,}")
        t, faces = words.reshape(2, *depth.shape)
        depth[:], prim_id[:] = t.view("<f4"), faces

    def close(self) -> None:
        """Ask the program to end, kill one that does not, and remove the files."""
        with suppress(OSError, subprocess.TimeoutExpired):
            self._running.communicate(b"end\n", _END_S)
        self._running.kill()
        self._running.communicate()
        self._folder.cleanup()


def _make(mesh: Mesh, view: View, options: ProgramOptions, tracing: Tracing) -> Tracer:
    files = _files(options.command)
    if not files:
        raise InputError(f"method.command is {options.command!r}, expected a program that is there")
    if digest_of_files(files) != options.program_sha256:
        raise InputError(f"program {options.command} changed since this run began; start it again")
    method = Guarded(Program(options.command))
    return Tracer(mesh, view, method, threads=tracing.threads, ties="any")


def _files(command: str) -> list[Path]:
    """The program and those of its arguments that are files; empty where there is no such program."""
    return [Path(word) for word in _words(command) if Path(word).is_file()]


def _words(command: str) -> list[str]:
    """Program and arguments, with paths that hold wherever a worker starts; empty where there is no such program."""
    try:
        words = shlex.split(command)
    except ValueError:
        return []
    program = shutil.which(words[0]) if words else None
    words = [] if program is None else [program, *words[1:]]
    return [str(Path(word).absolute()) if Path(word).is_file() else word for word in words]


def _resolve(options: ProgramOptions, width: int) -> ProgramOptions:
    """With whole paths, and the hash of the files."""
    command = options.command or shlex.join([sys.executable, str(_EXAMPLE)])
    words = _words(command)
    if not words:
        return options
    return replace(options, command=shlex.join(words), program_sha256=digest_of_files(_files(command)))


def _variant(row: Mapping[str, Any]) -> str:
    return Path((str(row.get("command") or "").split() or [""])[-1]).name


PROGRAM = Method(
    "program", "program", Style(GREY, "h"), ProgramOptions, _make, __name__, _resolve, _variant, is_ours=False
)
