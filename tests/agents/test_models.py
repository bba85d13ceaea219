"""The client of an OpenAI-compatible endpoint: what it sends, what it reads, and what it says when it fails."""

import base64
import sys

import pytest
from endpoint import serving

from scengen.agents import endpoint as models
from scengen.agents.endpoint import Endpoint
from scengen.agents.models import Call, ModelError, Reply, Tool, Turn, made
from scengen.errors import BadConfig, ForeignCode

TURNS = [Turn("system", "Be brief."), Turn("user", "What is this?", (b"\xff\xd8 a picture",))]
SCHEMA = {"title": "thing", "type": "object", "properties": {}}


def test_pictures_schema_temperature_and_seed_are_sent(monkeypatch):
    monkeypatch.setenv("MY_KEY", "secret")
    with serving(["a box"]) as (url, requests):
        reply = Endpoint("m", url, "MY_KEY").reply(TURNS, (), SCHEMA, 0.7, 5)
    assert (reply.text, reply.tokens_in, reply.tokens_out) == ("a box", 100, 10)
    ((path, headers, body),) = requests
    assert path == "/v1/chat/completions" and headers["Authorization"] == "Bearer secret"
    assert (body["model"], body["temperature"], body["seed"]) == ("m", 0.7, 5)
    assert body["response_format"]["json_schema"] == {"name": "thing", "schema": SCHEMA}
    text, picture = body["messages"][1]["content"]
    assert text == {"type": "text", "text": "What is this?"}
    assert base64.b64decode(picture["image_url"]["url"].partition(",")[2]) == b"\xff\xd8 a picture"


def test_a_call_of_a_tool_is_read():
    call = {"function": {"name": "Lift", "arguments": '{"dz": 0.1}'}}
    with serving([{"choices": [{"message": {"content": None, "tool_calls": [call]}}]}]) as (url, requests):
        reply = Endpoint("m", url).reply(TURNS, [Tool("Lift", "up", {"type": "object"})], {}, 0.0, 0)
    assert reply == Reply("", (Call("Lift", '{"dz": 0.1}'),))
    assert requests[0][2]["tool_choice"] == "required" and requests[0][2]["tools"][0]["function"]["name"] == "Lift"


def test_a_busy_endpoint_is_asked_again_and_one_that_refuses_is_not():
    with serving([503, 429, "now"]) as (url, requests):
        assert Endpoint("m", url).reply(TURNS, (), {}, 0.0, 0).text == "now" and len(requests) == 3
    with serving([401]) as (url, requests), pytest.raises(ModelError, match="refuses the request for m: 401"):
        Endpoint("m", url).reply(TURNS, (), {}, 0.0, 0)
    assert len(requests) == 1


@pytest.mark.parametrize("answer", [{}, {"choices": []}, {"choices": [{"message": None}]}, {"choices": "no"}])
def test_an_answer_of_another_form_is_one_line(answer):
    with serving([answer]) as (url, _), pytest.raises(ModelError, match="answers no chat completion"):
        Endpoint("m", url).reply(TURNS, (), {}, 0.0, 0)


def test_an_endpoint_that_is_not_there_is_one_line(monkeypatch):
    monkeypatch.setattr(models.time, "sleep", lambda _: None)
    with pytest.raises(ModelError, match=r"http://127.0.0.1:9/v1 cannot be reached"):
        Endpoint("m", "http://127.0.0.1:9/v1").reply(TURNS, (), {}, 0.0, 0)


def test_a_key_that_is_not_set_and_an_address_of_another_kind_are_refused(monkeypatch):
    monkeypatch.delenv("NO_KEY", raising=False)
    with pytest.raises(BadConfig, match="NO_KEY; there is no such environment variable"):
        Endpoint("m", "http://127.0.0.1:9/v1", "NO_KEY")
    with pytest.raises(BadConfig, match="expected an address"):
        Endpoint("m", "file:///etc/passwd")


def test_a_model_of_ones_own_is_made_and_blamed(tmp_path, monkeypatch):
    (tmp_path / "my_vlm.py").write_text(
        "class Good:\n    def reply(self, turns, tools, schema, temperature, seed): return None\n"
        "def bad(): raise ValueError('no weights')\n"
        "def none(): return 3\n"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    assert callable(made("my_vlm:Good").reply)
    with pytest.raises(ForeignCode, match="no weights"):
        made("my_vlm:bad")
    with pytest.raises(BadConfig, match="has no method reply"):
        made("my_vlm:none")
    with pytest.raises(BadConfig, match="no function or class named 'gone'"):
        made("my_vlm:gone")
