"""A policy server in a separate process, written against the protocols and not against scengen's client.

    python policy_server.py openpi|gr00t ACTIONS.npy LOG.json [FAULT]

It prints its port, plays the rows of ACTIONS.npy in chunks of 20, and writes a description of the last observation
into LOG.json, with the largest number of requests that it had at once. With a FAULT it misbehaves from the second
request on; "slow" takes some time for each.
"""

import json
import socket
import sys
import threading
import time

import msgpack
import numpy as np

CHUNK = 20
NAMES = {"move": slice(0, 3), "turn": slice(3, 6), "gripper": slice(6, 7)}
MODALITIES = {
    "video": {"delta_indices": [0], "modality_keys": []},
    "state": {"delta_indices": [-1, 0], "modality_keys": ["eef_pos"]},
    "language": {"delta_indices": [0], "modality_keys": ["annotation.human.task_description"]},
    "action": {"delta_indices": list(range(CHUNK)), "modality_keys": list(NAMES)},
}


class Policy:
    """Rows of a file, one chunk after the other."""

    def __init__(self, actions, log, fault):
        self.actions, self.log, self.fault = np.load(actions).astype(np.float32), log, fault
        self.asked = self.next = self.pending = self.most = 0
        self.lock = threading.Lock()  # each connection has a separate thread

    def chunk(self, observation):
        with self.lock:
            self.pending += 1
            self.most = max(self.most, self.pending)
        if self.fault == "slow":
            time.sleep(0.1)
        with self.lock:
            self.pending -= 1
            return self._chunk(observation)

    def _chunk(self, observation):
        self.asked += 1
        with open(self.log, "w") as file:
            json.dump({"asked": self.asked, "most": self.most, **described(observation)}, file)
        found = self.actions[self.next : self.next + CHUNK]
        idle = np.append(np.zeros(6, np.float32), self.actions[-1, -1:])
        found = np.concatenate([found, np.tile(idle, (CHUNK - len(found), 1))])
        if self.asked > 1:
            if self.fault == "error":
                raise RuntimeError("out of memory\non device 0")
            found = {"short": found[:3], "wide": np.tile(found, (1, 2)), "nan": np.where(found < 9, np.nan, found)}.get(
                self.fault, found
            )
        self.next += CHUNK
        return found

    @property
    def drops(self):
        """Whether the present request stays without a reply, once."""
        if self.fault == "drop" and self.asked == 1:
            self.fault = ""
            return True
        return False


def described(node, path=""):
    """Shape, type and size of each entry of an observation, or its text."""
    if isinstance(node, dict):
        return {name: value for key, inner in node.items() for name, value in described(inner, f"{path}/{key}").items()}
    if isinstance(node, np.ndarray):
        told = {"shape": node.shape, "dtype": str(node.dtype)}
        return {path: {**told, "values": node.ravel().tolist()} if node.size < 100 else told}
    return {path: node}


def openpi(policy):
    from websockets.sync.server import serve

    def plain(node):
        if b"__ndarray__" in node:
            return np.ndarray(node[b"shape"], np.dtype(node[b"dtype"]), node[b"data"])
        return node

    def array(value):
        kind = value.dtype.str
        return {b"__ndarray__": True, b"data": value.tobytes(), b"dtype": kind, b"shape": value.shape}

    def handle(connection):
        fps = 10 if policy.fault == "rate" else 100
        connection.send(msgpack.packb({"fps": fps, "policy": "rows of a file"}))
        for message in connection:
            if policy.drops:
                return
            try:
                reply = {"actions": policy.chunk(msgpack.unpackb(message, object_hook=plain))}
            except RuntimeError:
                connection.send("Traceback (most recent call last):\n  ...\nRuntimeError: out of memory")
                connection.close(1011)
                return
            packed = msgpack.packb({**reply, "server_timing": {"infer_ms": 0.1}}, default=array)
            if policy.asked > 1:
                packed = hostile(policy.fault, packed, b"__ndarray__", b"dtype")
            connection.send(packed)

    with serve(handle, "127.0.0.1", 0, compression=None, max_size=None) as server:
        print(server.socket.getsockname()[1], flush=True)
        server.serve_forever()


def gr00t(policy):
    import zmq

    def plain(node):
        if b"nd" in node:
            return np.frombuffer(node[b"data"], np.dtype(node[b"type"])).reshape(node[b"shape"])
        return node

    def array(value):
        kind = value.dtype.str
        return {b"nd": True, b"type": kind, b"kind": b"", b"shape": value.shape, b"data": value.tobytes()}

    def answer(request):
        endpoint, data = request.get("endpoint", "get_action"), request.get("data", {})
        if endpoint == "get_modality_config":
            return {name: {"__ModalityConfig__": True, "as_json": config} for name, config in MODALITIES.items()}
        if endpoint == "reset":
            policy.next = 0
            return {}
        chunk = policy.chunk(data["observation"])[None]
        assert data["options"] is None
        parts = {name: chunk[..., columns] for name, columns in NAMES.items()}
        return [{**parts, "gripper": chunk[..., 6:]}, {}]

    context = zmq.Context()
    server = context.socket(zmq.REP)
    port = server.bind_to_random_port("tcp://127.0.0.1")
    print(port, flush=True)
    while True:
        request = msgpack.unpackb(server.recv(), object_hook=plain)
        if request.get("endpoint") == "get_action" and policy.drops:
            server.close(linger=0)
            server = context.socket(zmq.REP)
            while True:
                try:
                    server.bind(f"tcp://127.0.0.1:{port}")
                    break
                except zmq.ZMQError:
                    time.sleep(0.05)
            continue
        try:
            packed = msgpack.packb(answer(request), default=array)
            if policy.asked > 1 and request.get("endpoint") == "get_action":
                packed = hostile(policy.fault, packed, b"nd", b"type")
        except RuntimeError as error:
            packed = msgpack.packb({"error": str(error)})
        server.send(packed)


def hostile(fault, packed, mark, kind):
    """A message as a broken or hostile server sends it."""
    pickled = {mark: True, kind: "|O", b"kind": b"O", b"shape": [1], b"data": b"cos\nsystem\n(S'touch pwned'\ntR."}
    return {
        "garbage": b"\xc1 no msgpack",
        "pickle": msgpack.packb([{"move": pickled}, {}] if mark == b"nd" else {"actions": pickled}),
        "large": msgpack.packb({mark: True, kind: "<f8", b"shape": [10**9, 10**9], b"data": b""}),
        "deep": b"\x91" * 5000 + b"\xc0",
    }.get(fault, packed)


def silent():
    """A port that accepts connections and never says a word."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        print(server.getsockname()[1], flush=True)
        connections = []
        while True:
            connections.append(server.accept())


if __name__ == "__main__":
    protocol, *rest = sys.argv[1:]
    if protocol == "silent":
        silent()
    {"openpi": openpi, "gr00t": gr00t}[protocol](Policy(*rest[:2], rest[2] if len(rest) > 2 else ""))
