"""Waiting for submitted jobs; jobs and queue are stand-ins: what is told of each job, and when the wait ends."""

import pickle
from types import SimpleNamespace

import pytest
from hydra.core.utils import JobStatus

from experiments import launched

pytest.importorskip("submitit", reason="hydra-submitit-launcher is not installed: pip install 'atra[submitit]'")


class SlurmJob:
    """It has ended with a result, (outcome, what was returned), or None: it has none."""

    def __init__(self, folder, job_id, result=None, said=""):
        self.job_id, self.said = job_id, said
        self.paths = SimpleNamespace(folder=folder, result_pickle=folder / f"{job_id}.pkl")
        if result is not None:
            self.paths.result_pickle.write_bytes(pickle.dumps(result))

    def stderr(self):
        return self.said


FINE = ("success", SimpleNamespace(status=JobStatus.COMPLETED))
RAISED = ("success", SimpleNamespace(status=JobStatus.FAILED, _return_value=ValueError("no such scene")))
BROKEN = ("error", "Traceback\n  a line\nModuleNotFoundError: No module named 'experiments'\n")


@pytest.fixture
def run(monkeypatch):
    """Wait for jobs in no time: a job has as long as the queue answers, which it does once a look."""
    commands = []
    monkeypatch.setattr(launched, "_LOOK_S", 0.001)
    monkeypatch.setattr(launched, "_GRACE_S", 0.01)

    def run(jobs, queue):
        def answer(command, **_):
            commands.append(command)
            if command[0] == "scancel":
                return None
            return SimpleNamespace(stdout="\n".join(queue()))

        monkeypatch.setattr(launched.subprocess, "run", answer)
        monkeypatch.setattr(launched, "_submit", lambda *_: jobs)
        return dict(launched._on_slurm(None, [[]] * len(jobs)))

    run.commands = commands
    return run


def test_each_job_is_told_of_by_itself_with_the_reason_of_its_failure(run, tmp_path):
    jobs = [
        SlurmJob(tmp_path, "7_0", FINE),
        SlurmJob(tmp_path, "7_1", RAISED),
        SlurmJob(tmp_path, "7_2", BROKEN),
        SlurmJob(tmp_path, "7_3", said="a line\nslurmstepd: error: oom-kill\n"),
        SlurmJob(tmp_path, "7_4"),
    ]
    looks = []

    def queue():
        looks.append(None)
        if len(looks) == 40:  # long after the others
            SlurmJob(tmp_path, "7_4", FINE)
        return ["7_4"]

    assert run(jobs, queue) == {
        0: None,
        1: "no such scene",
        2: "ModuleNotFoundError: No module named 'experiments'",
        3: "job 7_3 ended without a result: slurmstepd: error: oom-kill",
        4: None,
    }


def test_a_queue_that_does_not_answer_is_asked_again(run, tmp_path):
    answers = []

    def queue():
        answers.append(None)
        if len(answers) < 40:
            raise OSError("no squeue")
        return []

    assert run([SlurmJob(tmp_path, "7_0", FINE), SlurmJob(tmp_path, "7_1")], queue) == {
        0: None,
        1: "job 7_1 ended without a result",
    }
    assert len(answers) >= 40


def test_an_interrupt_cancels_each_array_once(run, tmp_path):
    def queue():
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run([SlurmJob(tmp_path, "7_0"), SlurmJob(tmp_path, "7_1")], queue)
    assert run.commands[-1] == ["scancel", "7"]
