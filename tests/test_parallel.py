"""Workers end when they must, and what they worked on is named."""

import errno
import math
import os
import pickle
import resource
import shlex
import signal
import subprocess
import sys
import time
from multiprocessing import resource_tracker
from pathlib import Path

import pytest
from faults import lost, work

from scengen.cli.commands.settings import read
from scengen.cli.commands.verify import VerifySettings
from scengen.errors import BadConfig, Infeasible, NoEvent, NoOracle, OutOfBounds, UnknownName
from scengen.work import machine
from scengen.work.machine import cores
from scengen.work.parallel import Limits, WorkerDied, each, portable

LIMITS = Limits(0.5, 200)
ROOT = Path(__file__).parents[1]


@pytest.mark.parametrize("workers", [1, 3])
def test_what_hangs_crashes_or_takes_all_memory_is_named_and_the_rest_goes_on(workers):
    items = ["a", "hang", "b", "spin", "crash", "c", "memory", "d"]
    assert sorted(each(work, items, workers, LIMITS, lost)) == [
        "a", "b", "c", "crash died: it was ended by SIGSEGV", "d", "hang took longer than 0.5 s",
        "memory needs more than 200 MB", "spin took longer than 0.5 s",
    ]  # fmt: skip


RUN = """
import faults
from scengen.work.parallel import Limits, each
for name in each(faults.work, ["busy"] * 6, 2, Limits(0.5, 200), faults.lost):
    print(name, flush=True)
"""


def test_a_suspended_run_has_the_results_of_one_that_was_not():
    """Ctrl-Z, or a job that a cluster suspends: command and workers stand still for longer than their limit."""
    run = subprocess.Popen([sys.executable, "-c", RUN], stdout=subprocess.PIPE, text=True, start_new_session=True,
                           cwd=ROOT / "tests")  # fmt: skip
    told = [run.stdout.readline()]
    for _ in range(3):
        time.sleep(0.1)
        os.killpg(run.pid, signal.SIGSTOP)
        time.sleep(1.2)
        os.killpg(run.pid, signal.SIGCONT)
    assert [*told, *run.stdout] == ["busy\n"] * 6 and run.wait() == 0


def test_a_worker_that_is_suspended_alone_goes_on_later():
    def suspended(item):
        if not os.fork():  # a child of the worker, which wakes it
            time.sleep(1.5)
            os.kill(os.getppid(), signal.SIGCONT)
            os._exit(0)
        os.kill(os.getpid(), signal.SIGSTOP)
        return item

    assert list(each(suspended, [7], 1, LIMITS, lost)) == [7]


def test_without_limits_one_worker_is_this_process_and_two_are_others():
    assert list(each(os.getpid().__add__, [0], 1)) == [os.getpid()]
    assert sorted(each(abs, [-1, -2, -3], 2)) == [1, 2, 3]


def test_an_error_comes_through_and_a_death_without_a_name_for_it_is_an_error():
    with pytest.raises(Exception, match="no letter named 'x'"):
        list(each(work, ["error"], 1, LIMITS))
    with pytest.raises(WorkerDied, match="SIGSEGV"):
        list(each(work, ["crash"], 1, LIMITS))


@pytest.mark.parametrize(
    "error",
    [
        UnknownName("task", "dominos", ["domino_single"]),
        OutOfBounds("x", 3.0, 0.0, 1.0, "m"),
        Infeasible("the draw", 3, {"too far": 3}),
        NoEvent("a push"),
        NoOracle("PushOff"),
        BadConfig("n = 0"),
    ],
    ids=lambda error: type(error).__name__,
)
def test_an_error_of_scengen_comes_through_as_it_was(error):
    kind, found = pickle.loads(portable(error))
    assert kind == "error" and type(found) is type(error) and str(found) == str(error)
    assert vars(found).items() >= vars(error).items()


def test_a_worker_killed_from_outside_changes_no_result(tmp_path):
    mark = tmp_path / "mark"

    def once(item):
        if not mark.exists():
            mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return item

    assert list(each(once, [7], 1, LIMITS, lost)) == [7]


def test_whoever_leaves_early_waits_for_nobody():
    begun = time.monotonic()
    results = each(work, ["a", *["hang"] * 4], 3, Limits(60, 200))
    assert next(results) == "a"
    results.close()
    assert time.monotonic() - begun < 2


@pytest.mark.parametrize(
    ("quota", "bound", "told"),
    [("max 100000", 8, 8), ("250000 100000", 8, 2), ("50000 100000", 8, 1), ("800000 100000", 2, 2), (None, 3, 3)],
)
def test_no_more_cores_are_used_than_a_container_is_given(quota, bound, told, tmp_path, monkeypatch):
    monkeypatch.setattr(machine, "QUOTA", tmp_path / "cpu.max")
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(bound)))
    if quota:
        machine.QUOTA.write_text(quota)
    assert cores() == told


def test_workers_auto_are_as_many_as_there_are_cores(monkeypatch):
    monkeypatch.setattr("scengen.cli.commands.settings.cores", lambda: 5)
    assert read("verify", ["pool=x", "workers=auto"], VerifySettings).workers == 5
    with pytest.raises(BadConfig, match="workers = 'many'"):
        read("verify", ["pool=x", "workers=many"], VerifySettings)


# --- machines that have no room ---------------------------------------------------------------------


def limited(limit, value, *argv):
    """Run a command under a limit of the shell: its exit status, and what it says on standard error."""
    line = [sys.executable, "-m", "scengen", *map(str, argv)]
    shell = f"ulimit {limit} {value}; exec {shlex.join(line)}"
    done = subprocess.run(["bash", "-c", shell], capture_output=True, text=True, cwd=ROOT)
    return done.returncode, done.stderr


@pytest.mark.parametrize("files", [10, 16, 20])
@pytest.mark.slow
def test_a_machine_without_file_descriptors_is_one_line(files, tmp_path):
    status, told = limited(
        "-n", files, "verify", "pool=generated/reference/domino_single-id", "level=replay", "workers=6"
    )
    assert status == 2 and "too many open files; raise the limit of open files (ulimit -n)" in told
    assert told.count("scengen: ") == 1 and told.splitlines()[-1].startswith("scengen: ")


def test_a_worker_that_could_not_start_can_be_ended(monkeypatch):
    def full(*_):
        raise OSError(errno.EMFILE, "Too many open files")

    monkeypatch.setattr("multiprocessing.process.BaseProcess.start", full)
    with pytest.raises(OSError, match="Too many open files"):
        list(each(abs, [-1, -2], 2, LIMITS))


@pytest.mark.parametrize("kilobytes", [1_000_000, 1_200_000, 2_000_000, 2_600_000])
@pytest.mark.slow
def test_pictures_in_a_small_address_space_are_refused_in_one_line(kilobytes, tmp_path):
    status, told = limited(
        "-v", kilobytes, "show", "pool=generated/reference/domino_single-id", "id=8ed4", f"to={tmp_path / 'x.png'}"
    )
    assert status == 2 and told.count("\n") == 1 and "raise it" in told and not list(tmp_path.iterdir())


def test_a_lack_of_memory_that_comes_from_outside_is_not_the_fault_of_an_item(monkeypatch):
    """Under `ulimit -v` a worker has less than its limit: what does not fit then says nothing about the item."""
    monkeypatch.setattr(machine, "bound_memory", lambda megabytes: False)
    with pytest.raises(MemoryError):
        list(each(hungry, [1], 1, LIMITS, lost))
    monkeypatch.undo()
    assert list(each(hungry, [1], 1, LIMITS, lost)) == ["1 needs more than 200 MB"]


def hungry(item):
    raise MemoryError


@pytest.mark.skipif(not machine.LINUX, reason="limits are those of Linux")
def test_threads_that_limit_memory_at_the_same_time_leave_no_limit_behind():
    before = resource.getrlimit(resource.RLIMIT_AS)
    first, second = machine.memory_bounded(10**9), machine.memory_bounded(2 * 10**9)
    first.__enter__()
    second.__enter__()
    assert resource.getrlimit(resource.RLIMIT_AS) != before
    first.__exit__(None, None, None)
    assert resource.getrlimit(resource.RLIMIT_AS) != before
    second.__exit__(None, None, None)
    assert resource.getrlimit(resource.RLIMIT_AS) == before


def test_without_what_only_linux_has_work_is_done_all_the_same(monkeypatch):
    """As on macOS and Windows, where none of it was tried: no copies of processes, no /proc, no limits of memory."""
    resource_tracker.ensure_running()  # it masks signals while it starts, which the first worker would bring about
    monkeypatch.setattr(machine, "LINUX", False)
    monkeypatch.delattr(signal, "pthread_sigmask")
    monkeypatch.delattr(os, "sched_getaffinity")
    assert cores() >= 1 and machine.free_address_space() == math.inf and machine.bound_memory(200)
    assert sorted(each(work, ["a", "b", "c"], 2, Limits(60, 2000))) == ["a", "b", "c"]
    with machine.memory_bounded(1):
        assert len(bytes(10_000_000)) == 10_000_000


MASKED = """
import signal, sys
from scengen.work.parallel import each

def held_back(item):
    return signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, [])

if __name__ == "__main__":
    print(*each(held_back, [1, 2], workers=2))
"""


def test_the_first_worker_that_is_spawned_holds_ctrl_c_back_like_the_others(tmp_path):
    """Python starts a tracker of resources with it, and lets the signals through again while it does."""
    (tmp_path / "masked.py").write_text(MASKED)
    done = subprocess.run([sys.executable, tmp_path / "masked.py"], capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("True True\n", "")
