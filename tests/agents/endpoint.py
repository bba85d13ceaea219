"""A small OpenAI-compatible endpoint on this machine, which counts and keeps what it is asked."""

import json
import threading
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer


@contextmanager
def serving(answers):
    """Serve answers one after the other, the last one for ever: a status code, a text, or a whole completion.

    Yields:
        Address up to the version, and the list of requests so far: headers and body.
    """
    requests = []

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self):
            body = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
            answer = answers[min(len(requests), len(answers) - 1)]
            requests.append((self.path, dict(self.headers), body))
            answer = answer(body) if callable(answer) else answer
            status, told = (answer, {"error": "busy"}) if isinstance(answer, int) else (200, answer)
            status, told = told if isinstance(told, tuple) else (status, told)
            if isinstance(told, str):
                usage = {"prompt_tokens": 100, "completion_tokens": 10}
                told = {"choices": [{"message": {"content": told}}], "usage": usage}
            content = json.dumps(told).encode()
            self.send_response(status)
            self.send_header("Retry-After", "0.01")
            self.send_header("Content-Length", str(len(content)))
            self.end_headers()
            self.wfile.write(content)

        def log_message(self, *_):
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_address[1]}/v1", requests
    finally:
        server.shutdown()
        server.server_close()
