"""A Ray cluster gives the same pools as one process, whatever happens to its workers and nodes."""

import importlib.util
import os
import secrets
import shutil
import sqlite3
import subprocess
import sys
import tempfile
import time
from contextlib import closing
from pathlib import Path

import pytest
from faults import lost, work

from scengen import cli
from scengen.cli.commands.settings import read
from scengen.cli.commands.verify import VerifySettings
from scengen.errors import BadConfig, ScengenError
from scengen.runs.progress import ProgressBar
from scengen.work import crew
from scengen.work import nodes as node_checks
from scengen.work.cluster import QUIET, Cluster
from scengen.work.nodes import ClusterError, about
from scengen.work.parallel import Executor, Limits, WorkerDied, each

LIMITS = Limits(2.0, 400)
POOL = ("generate", "task=domino_single", "n=8", "certify.robust.runs=1", "certify.robust.bound=0.04")


def on_nodes(test):
    """A test with a cluster: long, and all of them in one process, or there would be two clusters at once."""
    return pytest.mark.slow(pytest.mark.xdist_group("cluster")(test))


def node_of(item):
    time.sleep(0.3)  # so that every worker gets some
    return os.environ.get("ODD", "like ours")


# --- without a cluster ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("overrides", "told"),
    [
        (("executor=ry",), "no executor named 'ry' (did you mean 'ray'?); known: local, ray"),
        (("executor=ray", "executor.adress=auto"), "no key in executor named 'adress' (did you mean 'address'?)"),
        (("executor.address=auto",), "executor.address is a setting of executor=ray; give that, too"),
        (("executor=ray", "executor.address=there"), "it must be auto, local, HOST:PORT or ray://HOST:PORT"),
        (("executor=ray", "executor.address=127.0.0.1:1"), "no answer ([Errno 111] Connection refused)"),
        (("executor=ray", "executor.address=ray://localhost:1"), "no answer ("),
        (("executor=ray", "executor.address=x:99999"), "no answer ("),
        (("executor=ray", "executor.address=a..b:1"), "no answer ("),
        (("executor=ray", "executor.token=missing.txt"), "executor.token = missing.txt; there is no such file"),
        (("executor=ray", "workers=0"), "workers = 0; on a cluster it must be auto or lie in [1, 10000]"),
        (("executor=ray", "workers=many"), "workers = 'many'; it must be a whole number, or auto"),
    ],
)
def test_what_is_wrong_about_an_executor_is_one_line(capsys, overrides, told):
    assert cli.run(["verify", "pool=nowhere", *overrides]) == 2
    assert told in (line := capsys.readouterr().err) and line.count("\n") == 1


def test_without_ray_a_line_says_what_to_install(monkeypatch):
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "ray" else find(name))
    with pytest.raises(ClusterError, match=r"pip install 'scengen\[ray\]'"):
        read("verify", ["pool=x", "executor=ray"], VerifySettings)


def test_commands_do_not_import_ray_unless_it_is_asked_for():
    run = "import sys; from scengen import cli; cli.run(['verify', 'pool=nowhere', 'workers=2'])"
    line = [sys.executable, "-c", f"{run}; print('ray' in sys.modules)"]
    assert subprocess.run(line, capture_output=True, text=True).stdout == "False\n"


def test_a_cluster_is_an_executor_and_a_number_of_workers_is_none():
    assert isinstance(Cluster(), Executor) and not isinstance(2, Executor)


def test_what_has_to_be_alike_tells_rounding_versions_and_code():
    own = about(b"N.")
    assert {"fingerprint", "code", "mujoco", "numpy", "scengen"} <= own.keys()
    with pytest.raises(ModuleNotFoundError, match="lab_tasks"):
        about(b"clab_tasks\nPush\n.")


def test_progress_tells_nodes_rate_and_end(monkeypatch):
    lines = []

    class Console:
        is_terminal, print = False, staticmethod(lines.append)

    clock = iter([0.0, 0.0, 20.0, 40.0])
    monkeypatch.setattr("scengen.runs.progress.Progress.__init__", lambda *_, **__: None)
    monkeypatch.setattr("scengen.runs.progress.Progress.add_task", lambda *_, **__: 0)
    monkeypatch.setattr("scengen.runs.progress.Progress.update", lambda *_, **__: None)
    monkeypatch.setattr(time, "monotonic", lambda: next(clock))
    executor = Cluster()
    executor.status = "2 nodes, 8 workers"
    bar = ProgressBar(Console(), "packing/id", 100, executor)
    for done in (10, 30, 100):
        bar.show(done)
    assert lines[0].startswith("packing/id: 30 of 100 2 nodes, 8 workers, 1/s, ends ")
    assert lines[1] == "packing/id: 100 of 100 2 nodes, 8 workers, 2.2/s"


def test_a_cluster_that_does_not_start_in_time_is_one_line(monkeypatch, capsys):
    ray = pytest.importorskip("ray")

    def late(*_, **__):
        raise Exception("The current node timed out during startup.\nThis could happen")

    monkeypatch.setattr(ray, "is_initialized", lambda: False)
    monkeypatch.setattr(ray, "init", late)
    assert cli.run(["verify", "pool=nowhere", "executor=ray"]) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1 and "timed out during startup. This could happen; repeat the command" in told


@on_nodes
def test_a_cluster_of_this_machine_listens_on_loopback_and_keeps_its_token_to_itself(tmp_path):
    """The listening sockets of the command's processes, from the tables of the kernel."""
    program = """
import os, sys
from pathlib import Path
import logging
from scengen.work.cluster import Cluster
logging.basicConfig()
Cluster("local").connect()
sockets = set()
for folder in Path("/proc").glob("[0-9]*"):
    try:
        if b"" == (environ := (folder / "environ").read_bytes()) or os.environ["MARK"].encode() not in environ:
            continue
        sockets |= {os.readlink(file) for file in (folder / "fd").iterdir()}
    except OSError:
        continue
for table in ("/proc/net/tcp", "/proc/net/tcp6"):
    for line in Path(table).read_text().splitlines()[1:]:
        local, state, inode = (line.split()[i] for i in (1, 3, 9))
        if state == "0A" and f"socket:[{inode}]" in sockets:
            print(local.partition(":")[0])
"""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("RAY_")}
    environment |= {"HOME": str(tmp_path), "XDG_CACHE_HOME": str(tmp_path / "cache"), "MARK": secrets.token_hex(8)}
    line = [sys.executable, "-c", program]
    done = subprocess.run(line, capture_output=True, text=True, env=environment, cwd=Path(__file__).parents[1])
    addresses = set(done.stdout.split())
    assert addresses and addresses <= {"0100007F", "0000000000000000FFFF00000100007F"}, done
    token = tmp_path / "cache" / "scengen" / "ray" / "token"
    assert (token.stat().st_mode & 0o777, token.parent.stat().st_mode & 0o777) == (0o600, 0o700)
    assert not (tmp_path / ".ray").exists() and str(token) in done.stderr


# --- with one, started here -------------------------------------------------------------------------


@pytest.fixture(scope="module")
def nodes():
    """A cluster with a token: a head that does no work, and two nodes of one core each."""
    folder = tempfile.mkdtemp(prefix="ray")  # short: the paths of sockets have at most 107 letters
    token = Path(folder, "token")
    token.write_text(secrets.token_hex(16))
    kept = dict(os.environ)
    os.environ.update(QUIET, RAY_AUTH_MODE="token", RAY_AUTH_TOKEN_PATH=str(token), RAY_TMPDIR=folder)
    os.environ["PYTHONPATH"] = os.pathsep.join([str(Path(__file__).parents[1]), str(Path(__file__).parent)])
    from ray.cluster_utils import Cluster as Nodes

    def started():
        return Nodes(initialize_head=True, head_node_args={"num_cpus": 0, "include_dashboard": False})

    try:
        try:
            found = started()
        except RuntimeError:  # Ray's own processes must answer within seconds, and a busy machine may be slower once
            found = started()
        found.token = str(token)
        for _ in range(2):
            found.add_node(num_cpus=1)
        yield found
        found.shutdown()
    finally:
        os.environ.clear()
        os.environ.update(kept)
        shutil.rmtree(folder, ignore_errors=True)


@pytest.fixture
def ours(nodes):
    """The cluster as an executor."""
    import ray

    yield Cluster(nodes.address)
    ray.shutdown()


def command(nodes, *argv, **environment):
    """A command that works on the cluster."""
    there = ("executor=ray", f"executor.address={nodes.address}", f"executor.token={nodes.token}")
    line = [sys.executable, "-m", "scengen", *argv, "workers=auto", *there]
    return subprocess.Popen(line, env=os.environ | environment, stderr=subprocess.PIPE, text=True)


def content(folder):
    return {path.relative_to(folder): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def finished(pool):
    """How many indices a run has finished."""
    path = pool.with_name(f"{pool.name}.run") / "journal.sqlite"
    if not path.exists():
        return 0
    with closing(sqlite3.connect(path)) as db:
        try:
            return db.execute("SELECT COUNT(*) FROM record").fetchone()[0]
        except sqlite3.OperationalError:  # no table yet
            return 0


@pytest.mark.slow  # it waits for minutes
@on_nodes
def test_pools_have_the_same_bytes_on_one_process_on_two_nodes_and_when_a_node_dies(nodes, tmp_path):
    assert cli.run([*POOL, f"pool={tmp_path / 'local'}"]) == 0
    run = command(nodes, *POOL, f"pool={tmp_path / 'ray'}")
    told = run.communicate()[1]
    assert run.returncode == 0 and "2 nodes, 2 workers" in told, told
    assert content(tmp_path / "ray") == content(tmp_path / "local")
    assert not [line for line in told.splitlines() if not line.startswith(("scengen", "domino_single"))], told

    victim = nodes.add_node(num_cpus=1)
    run = command(nodes, *POOL, f"pool={tmp_path / 'killed'}")
    while not finished(tmp_path / "killed"):
        assert run.poll() is None
        time.sleep(0.1)
    victim.kill_raylet()
    told = run.communicate()[1]
    assert run.returncode == 0, told
    nodes.remove_node(victim, allow_graceful=False)
    assert content(tmp_path / "killed") == content(tmp_path / "local")

    run = command(nodes, "verify", f"pool={tmp_path / 'ray'}", f"json={tmp_path / 'ray.json'}", "seed=0")
    assert run.communicate()[1].count("\n") < 5 and run.returncode == 0
    assert cli.run(["verify", f"pool={tmp_path / 'ray'}", f"json={tmp_path / 'local.json'}", "seed=0"]) == 0
    assert (tmp_path / "ray.json").read_bytes() == (tmp_path / "local.json").read_bytes()


@on_nodes
def test_limits_hold_on_nodes(ours):
    items = ["a", "hang", "b", "crash", "c", "memory", "d"]
    assert sorted(each(work, items, ours, LIMITS, lost)) == [
        "a", "b", "c", "crash died: it was ended by SIGSEGV", "d", "hang took longer than 2 s",
        "memory needs more than 400 MB",
    ]  # fmt: skip
    with pytest.raises(ScengenError, match="no letter named 'x'"):
        list(each(work, ["error"], ours, LIMITS))
    with pytest.raises(WorkerDied, match="SIGSEGV"):
        list(each(work, ["crash"], ours, LIMITS))


@pytest.mark.slow  # it waits for minutes
@on_nodes
def test_what_kills_its_worker_twice_is_lost_and_a_run_of_nothing_else_ends(ours, monkeypatch):
    monkeypatch.setattr(crew, "NODE_DEATH_DELAY", 2.0)
    found = sorted(each(work, ["a", "kill", "b"], ours, LIMITS, lost))
    assert found == ["a", "b", "kill died: it took 2 workers with it"]
    with pytest.raises(ClusterError, match="workers died in a row without a result; the last: The actor"):
        list(each(work, ["kill"] * 20, ours, LIMITS, lost))


@on_nodes
def test_a_node_that_rounds_otherwise_is_named_and_not_used(nodes, ours, tmp_path, monkeypatch, caplog):
    cosine = "numpy.frompyfunc(lambda x: math.cos(x) + 1e-6, 1, 1)"
    (tmp_path / "sitecustomize.py").write_text(f"import math, numpy\nnumpy.cos = {cosine}\n")
    path = os.pathsep.join([str(tmp_path), os.environ["PYTHONPATH"]])
    odd = nodes.add_node(num_cpus=1, env_vars={"PYTHONPATH": path, "ODD": "odd"})
    try:
        assert set(each(node_of, range(20), ours, LIMITS)) == {"like ours"}
        (line,) = caplog.messages
        assert f"({odd.node_id[:8]}) is not used: fingerprint" in line and "code" not in line
    finally:
        nodes.remove_node(odd)
    monkeypatch.setattr(node_checks, "versions", lambda: {"mujoco": "9.9"})
    with pytest.raises(ClusterError, match=r"no node of the cluster can be used; .*mujoco 3\.\d+\.\d+ instead of 9\.9"):
        list(each(work, "ab", ours, LIMITS))


@on_nodes
def test_a_token_that_is_wrong_or_missing_is_one_line(nodes, tmp_path):
    (tmp_path / "wrong").write_text(secrets.token_hex(16))
    for token in ("wrong", "missing"):
        line = [
            sys.executable,
            "-m",
            "scengen",
            "verify",
            "pool=x",
            "executor=ray",
            f"executor.address={nodes.address}",
        ]
        environment = os.environ | {"RAY_AUTH_TOKEN_PATH": str(tmp_path / token)}
        told = subprocess.run(line, env=environment, capture_output=True, text=True, timeout=60)
        assert (told.returncode, told.stderr.count("\n")) == (2, 1), told.stderr
        assert "executor.token=" in told.stderr


def test_settings_name_workers_by_number_or_executor():
    with pytest.raises(BadConfig, match="workers = 2.5"):
        read("verify", ["pool=x", "workers=2.5"], VerifySettings)
    assert read("verify", ["pool=x", "workers=3", "executor=local"], VerifySettings).workers == 3
