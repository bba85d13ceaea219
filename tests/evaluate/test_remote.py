"""Policies behind a socket: the actions of a server reach the environment unchanged, and no server can do harm."""

import json
import pickle
import subprocess
import sys
from pathlib import Path

import helpers
import msgpack
import numpy as np
import pytest

from scengen import cli
from scengen.envs.gym import PoolEnv
from scengen.evaluate.remote.client import address_of, read_client
from scengen.evaluate.remote.wire import BadMessage, msgpack_numpy_array, openpi_array, unpacked
from scengen.evaluate.rollouts import evaluate
from scengen.evaluate.settings import EvaluateSettings
from scengen.pool import Pool
from scengen.samplers.task_files import conf_dir

REFERENCE = str(helpers.REFERENCE)
SCHEMES = {"openpi": "ws", "gr00t": "zmq"}
FAST = "rate: 100\nexecute: 20\ntimeout: 10\nconnect: 5\nreconnects: 1\n"
CLIENTS = {
    "openpi": FAST + "observation: {state: [proprioception], prompt: [instruction]}\naction: [actions]\n",
    "gr00t": FAST
    + "observation: {state.eef_pos: [robot0_eef_pos], language.annotation.human.task_description: [instruction]}\n"
    + "action: [move, turn, gripper]\n",
}


@pytest.fixture
def serve(tmp_path):
    """A function that starts a server of a protocol with the first scenario's witness and returns its address."""
    started = []
    np.save(tmp_path / "actions.npy", next(Pool.open(REFERENCE).rows()).witness)

    def start(protocol, fault=""):
        script = Path(__file__).with_name("policy_server.py")
        argv = [sys.executable, str(script), protocol, str(tmp_path / "actions.npy"), str(tmp_path / "log.json"), fault]
        process = subprocess.Popen(argv, stdout=subprocess.PIPE, text=True)
        started.append(process)
        return f"{SCHEMES.get(protocol, 'ws')}://127.0.0.1:{process.stdout.readline().strip()}"

    yield start
    for process in started:
        process.kill()
        process.wait()
        process.stdout.close()


@pytest.fixture
def client(tmp_path):
    """A function that writes a client's file for a protocol, with changes."""

    def write(protocol, **changes):
        path = tmp_path / f"{protocol}.yaml"
        text = CLIENTS[protocol]
        for name, value in changes.items():
            text = "".join(
                f"{name}: {value}\n" if line.startswith(f"{name}:") else line for line in text.splitlines(True)
            )
        path.write_text(text)
        return str(path)

    return write


def play(address, file, to, **changes):
    said = {"pool": REFERENCE, "seeds": 1, "rollouts": 1, "to": str(to), "client": file, "arms": "none", **changes}
    return evaluate(EvaluateSettings(policy=address, **said), lambda *_: None).episodes


@pytest.mark.parametrize("protocol", CLIENTS)
def test_a_witness_played_by_a_server_gets_the_verdict_of_its_certificate(protocol, serve, client, tmp_path):
    (episode,) = play(serve(protocol), client(protocol), tmp_path / "out")
    env, over = PoolEnv("domino_single", REFERENCE, settle=True), False
    env.reset(seed=0)
    actions = iter(next(Pool.open(REFERENCE).rows()).witness)
    while not over:
        _, _, terminated, truncated, info = env.step(next(actions, env.world.idle))
        over = terminated or truncated
    assert episode["success"] and episode["seconds"] == round(info["time"], 3)


def test_an_openpi_server_gets_the_robots_pose_and_the_instruction(serve, client, tmp_path):
    play(serve("openpi"), client("openpi"), tmp_path / "out")
    told = json.loads((tmp_path / "log.json").read_text())
    assert told["/state"]["shape"] == [3 + 4 + 7 + 7 + 2] and told["/state"]["dtype"] == "float32"
    assert told["/prompt"] == next(Pool.open(REFERENCE).rows()).instruction


def test_a_gr00t_server_gets_a_batch_of_one_with_the_past_that_it_asks_for(serve, client, tmp_path):
    play(serve("gr00t"), client("gr00t"), tmp_path / "out")
    told = json.loads((tmp_path / "log.json").read_text())
    state = told["/state/eef_pos"]
    assert state["shape"] == [1, 2, 3] and state["dtype"] == "float32"
    before, now = np.reshape(state["values"], (2, 3))
    assert 0 < np.linalg.norm(now - before) < 0.02, "two successive observations of a moving hand"
    assert told["/language/annotation.human.task_description"] == [[next(Pool.open(REFERENCE).rows()).instruction]]


def test_fewer_actions_of_a_chunk_mean_more_requests(serve, client, tmp_path):
    (whole,) = play(serve("gr00t"), client("gr00t", execute=20), tmp_path / "whole")
    asked = json.loads((tmp_path / "log.json").read_text())["asked"]
    (half,) = play(serve("gr00t"), client("gr00t", execute=5, rate=25), tmp_path / "half")
    often = json.loads((tmp_path / "log.json").read_text())["asked"]
    assert asked == -(-round(100 * (whole["seconds"] - 1.0)) // 20)
    assert often >= round(25 * (half["seconds"] - 1.0)) // 5, "a chunk is 0.2 s of 25 Hz"


@pytest.mark.parametrize("protocol", CLIENTS)
def test_a_lost_connection_is_made_again(protocol, serve, client, tmp_path):
    (episode,) = play(serve(protocol, "drop"), client(protocol, timeout=1), tmp_path / "out")
    assert episode["success"]


FAULTS = {
    "short": "a chunk has 3 actions; execute = 20",
    "wide": "domino_single takes 7 numbers for each of them (1 arm: three of translation",
    "nan": "an action is not finite: [nan nan",
    "error": "the server reports an error: ",
    "garbage": "a message is not msgpack",
    "pickle": "an array in a message has the type '|O'",
    "large": "an array in a message has a different number of bytes",
    "deep": "a message is not msgpack",
}


@pytest.mark.parametrize("protocol", CLIENTS)
@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_of_a_server_is_told_in_one_line(protocol, fault, serve, client, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    address = serve(protocol, fault)
    argv = (f"policy={address}", f"client={client(protocol)}", f"pool={REFERENCE}", "seeds=1", "rollouts=1", "to=out")
    assert cli.run(("evaluate", *argv)) == 2
    [told] = [line for line in capsys.readouterr().err.splitlines() if not line.startswith("evaluate ")]
    assert f"policy = {address}; " in told and FAULTS[fault] in told
    assert not (tmp_path / "pwned").exists()


@pytest.mark.parametrize("protocol", CLIENTS)
def test_a_server_that_is_silent_or_absent_ends_in_one_line(protocol, serve, client, tmp_path, capsys):
    address = serve("silent").replace("ws://", f"{SCHEMES[protocol]}://")
    file = client(protocol, timeout=0.3, connect=0.3)
    common = (f"client={file}", f"pool={REFERENCE}", "seeds=1", f"to={tmp_path / 'out'}")
    assert cli.run(("evaluate", f"policy={address}", *common)) == 2
    assert "1 reconnects" in capsys.readouterr().err
    assert cli.run(("evaluate", f"policy={SCHEMES[protocol]}://127.0.0.1:9", *common)) == 2
    told = capsys.readouterr().err
    assert "no server accepts a connection within 0.3 s" in told and told.count("\n") == 1


def test_a_server_of_another_rate_is_refused(serve, client, tmp_path):
    with pytest.raises(Exception, match=r"it acts at 10 Hz; rate = 100 "):
        play(serve("openpi", "rate"), client("openpi"), tmp_path / "out")


def test_a_server_with_other_names_is_refused(serve, client, tmp_path):
    with pytest.raises(Exception, match=r"other observations: the server has language.+; .+ has .*state\.pose"):
        observation = "{state.pose: [robot0_eef_pos], language.annotation.human.task_description: [instruction]}"
        play(serve("gr00t"), client("gr00t", observation=observation), tmp_path / "out")


def test_episodes_of_unknown_weights_are_not_mixed(serve, client, tmp_path):
    address, file = serve("gr00t"), client("gr00t")
    play(address, file, tmp_path / "out")
    with pytest.raises(Exception, match="does not say which weights it serves; pass fresh=true"):
        play(address, file, tmp_path / "out", rollouts=2)
    play(address, file, tmp_path / "named", version="step 1000")
    assert len(play(address, file, tmp_path / "named", version="step 1000", rollouts=2)) == 2


def test_slots_ask_at_the_same_time(serve, client, tmp_path):
    episodes = play(serve("openpi", "slow"), client("openpi"), tmp_path / "out", slots=3, rollouts=3)
    assert len(episodes) == 3 and json.loads((tmp_path / "log.json").read_text())["most"] == 3


@pytest.mark.slow
def test_workers_have_connections_of_their_own(serve, client, tmp_path):
    episodes = play(serve("gr00t"), client("gr00t"), tmp_path / "out", workers=2, seeds=2)
    assert len(episodes) == 2


@pytest.mark.parametrize("name", ["openpi", "gr00t"])
def test_the_files_that_come_with_scengen_name_streams_that_exist(name):
    found = read_client(name, address_of(f"{SCHEMES[name]}://localhost:1"))
    assert found.repeat == 4 and "rgb_exo_right_cam" in found.streams("panda_jaw")
    assert Path(found.file) == conf_dir() / "clients" / f"{name}.yaml"


@pytest.mark.parametrize("encode", [openpi_array, msgpack_numpy_array], ids=["openpi", "gr00t"])
def test_arrays_survive_the_wire(encode):
    sent = {"a": np.arange(6, dtype=np.uint8).reshape(1, 2, 3), "b": np.float32(0.5), "c": ["x", 1, None]}
    got = unpacked(msgpack.packb(sent, default=encode))
    assert np.array_equal(got["a"], sent["a"]) and got["a"].dtype == np.uint8 and got["a"].flags.writeable
    assert got["b"] == 0.5 and got["c"] == sent["c"]


@pytest.mark.parametrize("kind", ["<f4", "=f4", "f4", "float32"])
def test_a_type_has_the_names_that_numpy_gives_it(kind):
    node = {b"__ndarray__": True, b"dtype": kind, b"shape": [1], b"data": np.float32([1.5]).tobytes()}
    assert unpacked(msgpack.packb(node)) == np.float32([1.5])


@pytest.mark.parametrize(
    "node",
    [
        {b"__ndarray__": True, b"dtype": "O", b"shape": [1], b"data": pickle.dumps([1])},
        {b"__ndarray__": True, b"dtype": "<f4", b"shape": [-1], b"data": b""},
        {b"__ndarray__": True, b"dtype": "<f4", b"shape": [True], b"data": b"0000"},
        {b"__ndarray__": True, b"dtype": ["<f4"], b"shape": [1], b"data": b"0000"},
        {b"__ndarray__": True, b"dtype": "<f4", b"shape": [1] * 7, b"data": b"0000"},
        {b"nd": True, b"type": "|V4", b"kind": b"V", b"shape": [1], b"data": b"0000"},
        {b"nd": True, b"type": "|O", b"kind": b"O", b"shape": [1], b"data": pickle.dumps([1])},
        {b"nd": True, b"type": "<f4", b"kind": b"", b"shape": [2], b"data": b"0000"},
        list(range(10_001)),
        msgpack.ExtType(1, b"x"),
    ],
    ids=lambda node: str(node)[:40],
)
def test_a_message_with_anything_but_bounded_numbers_is_refused(node):
    with pytest.raises(BadMessage):
        unpacked(msgpack.packb(node))


@pytest.mark.parametrize(
    ("argv", "says"),
    [
        (("policy=http://localhost:8000",), "it must be ws://HOST:PORT or wss://HOST:PORT (openpi), or zmq"),
        (("policy=ws://localhost",), "it must be ws://HOST:PORT"),
        (("policy=ws://user:word@localhost:8000",), "it must be ws://HOST:PORT"),
        (("policy=ws://localhost:99999",), "it must be ws://HOST:PORT"),
        (("policy=ws://localhost:8000", "client=nowhere.yaml"), "no client named 'nowhere.yaml'"),
        (("policy=ws://localhost:8000", "action_repeat=4"), "openpi.yaml decides it: leave it out"),
        (("policy=ws://localhost:8000", "client=bad.yaml"), "rate = 30; it must be at least 1 Hz and divide 100 Hz"),
        (("policy=ws://localhost:8000", "client=odd.yaml"), "no key named 'rates' (did you mean 'rate'?)"),
        (("policy=idle", "client=openpi"), "policy idle is not behind a socket: leave it out"),
    ],
)
def test_bad_input_is_told_in_one_line(argv, says, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("bad.yaml").write_text(CLIENTS["openpi"].replace("rate: 100", "rate: 30"))
    Path("odd.yaml").write_text(CLIENTS["openpi"].replace("rate: 100", "rates: 100"))
    status = cli.run(("evaluate", f"pool={REFERENCE}", "seeds=1", "to=out", *argv))
    told = capsys.readouterr().err
    assert status == 2 and says in told and told.count("\n") == 1
