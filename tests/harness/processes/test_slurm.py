"""Sweeps on a Slurm of one node, which this file starts: it has no accounting, as many small clusters."""

import os
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from contextlib import ExitStack, suppress

import pandas as pd
import psutil
import pytest

from tests.folders import ROOT

pytestmark = pytest.mark.slow

PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "srun", "squeue", "scancel", "sinfo", "setpriv")
PATH = os.pathsep.join([os.environ.get("PATH", ""), "/usr/sbin", "/sbin"])
DIES_WITH_US = ("setpriv", "--pdeathsig", "KILL")
"""In front of a command: it ends when this process does, however that ends."""

MOST_S = 240
"""So long a sweep may take on a busy machine."""

TOY = [
    "sweep=horizontal", "method.culling=true", "width=64", "height=48", "measure.processes=1", "measure.rounds=3",
    "measure.warmup=1", "hydra/launcher=submitit_slurm",
]  # fmt: skip

CONFIGURATION = """
ClusterName=toy
SlurmctldHost=localhost(127.0.0.1)
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
CredType=cred/munge
SlurmctldPort={ports[0]}
SlurmdPort={ports[1]}
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
ProctrackType=proctrack/linuxproc
TaskPlugin=task/affinity
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SlurmdParameters=config_overrides
SwitchType=switch/none
MpiDefault=none
ReturnToService=2
KillWait=2
NodeName=localhost NodeAddr=127.0.0.1 CPUs={cores} State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
"""


def wait_for(what, is_so, most_s=60.0):
    end_s = time.monotonic() + most_s
    while not is_so():
        if time.monotonic() > end_s:
            pytest.fail(f"{what}: not within {most_s:g} s")
        time.sleep(0.2)


class Slurm:
    """A cluster of one node. environment: of programs that are to use it."""

    def __init__(self, folder):
        self.folder = folder
        self.configuration = folder / "slurm.conf"
        self.environment = {**os.environ, "PATH": PATH, "SLURM_CONF": str(self.configuration)}

    def start(self):
        with ExitStack() as stack:
            free = [stack.enter_context(socket.socket()) for _ in range(2)]
            for one in free:
                one.bind(("127.0.0.1", 0))
            ports = [one.getsockname()[1] for one in free]
        (self.folder / "state").mkdir()
        (self.folder / "spool").mkdir()
        self.configuration.write_text(
            CONFIGURATION.format(folder=self.folder, ports=ports, cores=psutil.cpu_count(logical=True))
        )
        (self.folder / "cgroup.conf").write_text("CgroupAutomount=no\n")
        key = self.folder / "munge.key"
        key.write_bytes(os.urandom(64))
        key.chmod(0o600)
        files = [f"--{name}-file={self.folder}/munge.{name}" for name in ("key", "pid", "log", "seed")]
        self.daemon("munged", "--foreground", "--force", f"--socket={self.folder}/munge.socket", *files)
        wait_for("munge.socket", (self.folder / "munge.socket").exists)
        self.daemon("slurmctld", "-D", "-f", str(self.configuration))
        self.daemon("slurmd", "-D", "-N", "localhost", "-f", str(self.configuration))
        wait_for("an idle node", lambda: "idle" in self.tell("sinfo", "--noheader", "--format=%T"))

    def daemon(self, program, *arguments):
        with (self.folder / f"{program}.txt").open("wb") as printed:
            subprocess.Popen(
                [*DIES_WITH_US, program, *arguments], env=self.environment, cwd=self.folder,
                stdin=subprocess.DEVNULL, stdout=printed, stderr=subprocess.STDOUT,
            )  # fmt: skip

    def tell(self, *command):
        done = subprocess.run(command, env=self.environment, capture_output=True, text=True, timeout=60, check=False)
        return done.stdout

    def jobs(self, *states):
        asked = [f"--states={','.join(states)}"] if states else []
        return self.tell("squeue", "--noheader", "--array", "--format=%i", *asked).split()

    def processes(self):
        """Everything that runs under this configuration: daemons, jobs, their workers."""
        for process in psutil.process_iter():
            with suppress(psutil.Error):
                if process.environ().get("SLURM_CONF") == str(self.configuration):
                    yield process

    def stop(self):
        for _ in range(3):  # what is killed may have started something meanwhile
            found = list(self.processes())
            for process in found:
                with suppress(psutil.Error):
                    process.kill()
            psutil.wait_procs(found, timeout=10)

    def sweep(self, folder, *more):
        """Start one as a user does."""
        return subprocess.Popen(
            [*DIES_WITH_US, sys.executable, str(ROOT / "run.py"), *TOY, *more], cwd=folder, env=self.environment,
            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip

    def finished(self, folder, *more):
        """The exit code of a sweep and what it said."""
        with self.sweep(folder, *more) as running:
            try:
                _, said = running.communicate(timeout=MOST_S)
            except subprocess.TimeoutExpired:
                running.kill()
                raise
        return running.returncode, said


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    pytest.importorskip("submitit", reason="hydra-submitit-launcher is not installed: pip install 'atra[submitit]'")
    missing = [program for program in PROGRAMS if shutil.which(program, path=PATH) is None]
    if missing:
        pytest.skip(f"{', '.join(missing)} not installed: apt-get install slurm-wlm munge")
    if os.getuid() != 0:
        pytest.skip("slurmd needs root")
    slurm = Slurm(tmp_path_factory.mktemp("slurm"))
    try:
        slurm.start()
        yield slurm
    finally:
        slurm.stop()


@pytest.fixture
def slurm(cluster):
    yield cluster
    cluster.tell("scancel", "--me")
    wait_for("an empty queue", lambda: not cluster.jobs())


def table_of(folder):
    return pd.read_parquet(folder / "results" / "horizontal" / "table.parquet")


def test_the_command_of_the_documents_queues_all_processes_in_one_array(slurm, tmp_path):
    documented = "sweep=paper hydra/launcher=submitit_slurm +hydra.launcher.exclusive=true"
    assert documented in (ROOT / "docs" / "clusters.md").read_text(encoding="utf-8")
    more = ["+hydra.launcher.exclusive=true", "method.split_x=1,2", "measure.processes=2"]
    code, said = slurm.finished(tmp_path, *more)
    assert code == 0, said
    assert "[4/4]" in said
    assert "sacct" not in said
    table = table_of(tmp_path)
    assert list(table["processes"]) == [2, 2]
    jobs = [path.name for path in (tmp_path / "results" / ".submitit").glob("*_*") if path.is_dir()]
    array, _, _ = jobs[0].partition("_")
    assert sorted(jobs) == [f"{array}_{place}" for place in range(4)]

    code, said = slurm.finished(tmp_path, *more)
    assert code == 0, said
    assert "4 finished before, 0 cannot be measured, 0 to do" in said


def test_one_killed_job_is_named_and_the_others_are_waited_for(slurm, tmp_path):
    with slurm.sweep(tmp_path, "method.split_x=1,2,4") as running:
        wait_for("a running job", lambda: slurm.jobs("RUNNING") or running.poll() is not None, MOST_S)
        (killed, *_) = slurm.jobs("RUNNING")
        slurm.tell("scancel", "--full", "--signal=KILL", killed)
        try:
            _, said = running.communicate(timeout=MOST_S)
        finally:
            running.kill()
    assert running.returncode == 1, said
    assert said.count("no record: ") == 1
    assert f"no record: job {killed} ended without a result" in said
    assert "1 points have no record; the same command tries them again" in said
    assert list(table_of(tmp_path)["status"]) == ["ok", "ok"]

    code, said = slurm.finished(tmp_path, "method.split_x=1,2,4")
    assert code == 0, said
    assert "2 finished before, 0 cannot be measured, 1 to do" in said
    assert len(table_of(tmp_path)) == 3


def test_an_interrupt_cancels_the_jobs_that_run_and_those_that_wait(slurm, tmp_path):
    # Seed 0 puts the short point first; the others would take a minute each.
    more = ["method.split_x=1", "measure.rounds=3,1000000,1000001", "measure.frame_budget_s=60", "sweep.shuffle_seed=0"]
    with slurm.sweep(tmp_path, *more, "hydra.launcher.array_parallelism=1") as running:
        watchdog = threading.Timer(MOST_S, running.kill)
        watchdog.start()
        for line in running.stderr:
            if line.startswith("[1/3]"):
                break
        watchdog.cancel()
        wait_for("the second job", lambda: slurm.jobs("RUNNING") and slurm.jobs("PENDING"))
        running.send_signal(signal.SIGINT)
        try:
            _, said = running.communicate(timeout=60)
        finally:
            running.kill()
    assert running.returncode == 130, said
    assert "2 points left, the same command goes on from here" in said
    assert "Traceback" not in said
    wait_for("an empty queue", lambda: not slurm.jobs(), 40)
    assert not [one.pid for one in slurm.processes() if "experiments.worker" in one.cmdline()]
    assert list(table_of(tmp_path)["status"]) == ["ok"]


def test_jobs_bound_to_one_core_each_make_one_table(slurm, tmp_path):
    code, said = slurm.finished(tmp_path, "method.split_x=1,2", "hydra.launcher.cpus_per_task=1")
    assert code == 0, said
    table = table_of(tmp_path)
    assert list(table["status"]) == ["ok", "ok"]
    if psutil.cpu_count(logical=True) > 1:
        assert table["affinity"].nunique() == 2
