"""Let a model behind an OpenAI-compatible endpoint act. Here a local server stands in for it: it answers with a list of
primitives, computed from the poses in the prompt. Prints the share of scenarios that it solves."""

import json
import re
import sys
import threading
from http.server import BaseHTTPRequestHandler, HTTPServer

import numpy as np

import scengen
from scengen.cli import run


def answer(prompt):
    boxes = re.findall(r"(.+): position \[(.*?)\].*size \[(.*?)\]", prompt)  # middles [m]
    feet = {name: np.fromstring(at, sep=",") - [0, 0, float(size.split(",")[2]) / 2] for name, at, size in boxes}
    first, slab = feet["first domino"], feet["red slab"]
    along = (slab - first) / np.linalg.norm(slab - first)
    ways = ((-0.05, 0.15), (-0.05, 0.06), (0.03, 0.06), (-0.06, 0.06))  # behind, down, push, back [m]
    moves = [("MoveEEF", {"pos": list(first + way * along + [0, 0, up]), "ticks": 100}) for way, up in ways]
    plan = [("CloseGripper", {}), *moves, ("Hold", {"ticks": 200}), ("Done", {"reason": "the plan is over"})]
    return plan[24 - int(re.search(r"(\d+) primitives are left", prompt)[1])]


class Server(BaseHTTPRequestHandler):
    def do_POST(self):
        body = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
        name, arguments = answer(body["messages"][-1]["content"])
        call = {"function": {"name": name, "arguments": json.dumps(arguments)}}
        completion = {"choices": [{"message": {"tool_calls": [call]}}]}
        self.wfile.write(b"HTTP/1.0 200 OK\r\n\r\n" + json.dumps(completion).encode())


server = HTTPServer(("127.0.0.1", 0), Server)
threading.Thread(target=server.serve_forever, daemon=True).start()
port, pool = server.server_port, scengen.reference_pool("domino_single")
command = f"agent stage=3 mode=poses pictures=false model=mine seeds=2 to=generated/examples/agent-{port}"
sys.exit(run([*command.split(), f"url=http://127.0.0.1:{port}/v1", f"pool={pool}"]))
