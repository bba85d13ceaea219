"""Endpoints as they are: what is read, what is called by its name, and what no answer may do."""

import json
import socket
import threading
import time
from contextlib import contextmanager

import helpers
import pytest
from endpoint import serving

from scengen import cli
from scengen.agents import endpoint
from scengen.agents.calls import Budget
from scengen.agents.endpoint import Endpoint, reply_of, tokens
from scengen.agents.models import Call, ModelError, RefusedRequest, Reply, Tool, Turn
from scengen.agents.post import MAX_ANSWER
from scengen.agents.prices import Prices, prices
from scengen.agents.primitives import BadCall, called
from scengen.agents.replies import FormatError, kind_of, read_json, understanding
from scengen.agents.runner import AgentSettings, run
from scengen.errors import BadConfig, ScengenError

TURNS, KEY = [Turn("user", "What is this?")], "sk-very-secret"
SCHEMA = {"title": "thing", "type": "object", "properties": {}}
TOOLS = [Tool("Hold", "stay", {"type": "object"})]


@pytest.fixture(autouse=True)
def impatient(monkeypatch):
    monkeypatch.setattr(endpoint, "LONGEST_WAIT", 0.01)


@contextmanager
def raw(*pieces, pause=0.0):
    """A server that sends bytes to whoever connects, and counts who does."""
    listener, asked = socket.create_server(("127.0.0.1", 0)), []

    def serve():
        while True:
            try:
                peer, _ = listener.accept()
            except OSError:
                return
            threading.Thread(target=answer, args=(peer,), daemon=True).start()

    def answer(peer):
        with peer:
            with peer.makefile("rb") as file:
                head = [line for line in iter(file.readline, b"\r\n") if line.lower().startswith(b"content-length")]
                asked.append(file.read(int(head[0].split()[1])))
            try:
                for piece in pieces:
                    peer.sendall(piece)
                    time.sleep(pause)
            except OSError:
                pass

    threading.Thread(target=serve, daemon=True).start()
    try:
        yield f"http://127.0.0.1:{listener.getsockname()[1]}/v1", asked
    finally:
        listener.close()


def ask(url, key="", tools=(), **more):
    return Endpoint("m", url, key, **more).reply(TURNS, tools, {} if tools else SCHEMA, 0.0, 0)


def completion(message, reason="stop", **more):
    return {"choices": [{"message": message, "finish_reason": reason}], **more}


# --- the key ------------------------------------------------------------------------------------


def test_a_redirect_is_not_followed_and_gets_no_key(monkeypatch):
    monkeypatch.setenv("MY_KEY", KEY)
    with raw(b"HTTP/1.0 200 OK\r\n\r\n{}") as (other, asked):
        head = f"HTTP/1.0 302 Found\r\nLocation: {other}?token={KEY}\r\n\r\n".encode()
        with raw(head) as (url, _), pytest.raises(ModelError, match="302 a redirect to .* is not followed") as error:
            ask(url, "MY_KEY")
    assert not asked and KEY not in str(error.value)


def test_an_address_on_this_machine_is_asked_without_a_proxy(monkeypatch):
    with raw(b"HTTP/1.0 200 OK\r\n\r\n{}") as (proxy, asked), serving(["a box"]) as (url, _):
        monkeypatch.setenv("http_proxy", proxy)
        monkeypatch.delenv("no_proxy", raising=False)
        assert ask(url).text == "a box" and not asked


def test_a_key_that_a_server_repeats_is_not_told(monkeypatch):
    monkeypatch.setenv("MY_KEY", KEY)
    body = f"bad key: {KEY}".encode()
    with raw(b"HTTP/1.0 401 no\r\n\r\n" + body) as (url, _), pytest.raises(ModelError, match=r"401 bad key: \*\*\*"):
        ask(url, "MY_KEY")


@pytest.mark.parametrize("value", ["a\nb", "a\r\nX: y", "ключ", " \n"])
def test_a_key_that_no_header_holds_is_refused_without_telling_it(value, monkeypatch):
    monkeypatch.setenv("MY_KEY", value)
    with pytest.raises(BadConfig, match="key = MY_KEY") as error:
        Endpoint("m", "http://127.0.0.1:9/v1", "MY_KEY")
    assert value.strip() == "" or value not in str(error.value)


def test_a_key_with_a_line_end_after_it_is_the_key(monkeypatch):
    monkeypatch.setenv("MY_KEY", f"{KEY}\n")
    with serving(["a box"]) as (url, requests):
        ask(url, "MY_KEY")
    assert requests[0][1]["Authorization"] == f"Bearer {KEY}"


def test_a_key_in_place_of_its_name_is_not_told():
    with pytest.raises(BadConfig, match="must name an environment variable") as error:
        Endpoint("m", "http://127.0.0.1:9/v1", KEY)
    assert KEY not in str(error.value)


@pytest.mark.parametrize(
    "url",
    ["http://me:pw1234@h/v1", "ftp://me:pw1234@h", "http://h/v1?key=pw1234", "http://h:pw1234/v1", "http:///v1"],
)
def test_an_address_with_a_password_or_an_odd_port_is_refused_without_the_password(url):
    with pytest.raises(BadConfig, match="url = ") as error:
        Endpoint("m", url)
    assert "pw1234" not in str(error.value) or "h:pw1234" in url


# --- broken answers -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    "answer",
    [
        b'HTTP/1.1 200 OK\r\nContent-Length: 900\r\n\r\n{"cho',
        b'HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n40\r\n{"choices"',
        b"NOPE\r\n\r\n",
        b"",
        b"HTTP/1.0 200 OK\r\n\r\n" + b"[" * 100_000,
        b"HTTP/1.0 200 OK\r\n\r\n<html>login</html>",
        b"HTTP/1.0 200 OK\r\n\r\n\x1f\x8b\x08\xff",
    ],
)
def test_a_broken_answer_is_asked_for_again_and_then_one_line(answer):
    with raw(answer) as (url, asked), pytest.raises(ModelError, match=url) as error:
        ask(url)
    assert len(asked) == endpoint.TRIES and str(error.value).isprintable()


def test_an_endless_answer_and_a_dripping_one_end(monkeypatch):
    monkeypatch.setattr(endpoint, "TRIES", 1)
    head, block = b"HTTP/1.0 200 OK\r\n\r\n", b" " * 1_000_000
    with raw(head, *[block] * 20) as (url, _), pytest.raises(ModelError, match=f"more than {MAX_ANSWER}"):
        ask(url)
    for start in (head, b"HTTP/1.0 200 OK\r\nX-Slow: "):
        with raw(start, *[b" "] * 100, pause=0.05) as (url, _), pytest.raises(ModelError, match=r"within 0.3 s"):
            ask(url, timeout=0.3)


def test_an_overloaded_endpoint_is_asked_again():
    with serving([529, {"error": {"message": "slow down", "code": 429}}, "now"]) as (url, requests):
        assert ask(url).text == "now" and len(requests) == 3


def test_a_date_after_which_to_ask_again_is_read(monkeypatch):
    monkeypatch.setattr(endpoint, "LONGEST_WAIT", 60.0)
    later = time.strftime("%a, %d %b %Y %H:%M:%S GMT", time.gmtime(time.time() + 20))
    assert 15.0 < endpoint._wait(later, 1) <= 20.0
    assert [endpoint._wait(odd, 1) for odd in ("-1", "nan", "1e9", "soon", "9" * 400)] == [1.0] * 5


# --- what is left out ---------------------------------------------------------------------------


def refusing(*fields):
    """Answers like an endpoint that refuses fields of a request by their names."""

    def answer(body):
        odd = [name for name in fields if name in body]
        return (400, {"error": {"message": f"Unsupported parameter: '{odd[0]}'"}}) if odd else (200, completion({}))

    return answer


@pytest.mark.parametrize(
    ("fields", "tools", "requests_made"),
    [
        (["temperature"], (), 3),
        (["seed", "response_format"], (), 4),
        (["tool_choice"], TOOLS, 3),
        (["messages"], (), 0),
    ],
)
def test_fields_that_an_endpoint_refuses_are_found_out_once(fields, tools, requests_made):
    with serving([refusing(*fields)]) as (url, requests):
        model = Endpoint("m", url)
        if not requests_made:
            with pytest.raises(RefusedRequest, match=r"400 .*messages"):
                model.reply(TURNS, tools, SCHEMA, 0.5, 1)
            return
        replies = [model.reply(TURNS, tools, SCHEMA, 0.5, 1) for _ in range(2)]
    assert len(requests) == requests_made
    assert all(set(reply.notes) == {f"{endpoint.LEFT_OUT}{name}" for name in fields} for reply in replies)


def test_fields_are_left_out_on_demand():
    with serving(["a box"]) as (url, requests):
        ask(url, omit=["seed", "temperature"])
    assert not {"seed", "temperature"} & requests[0][2].keys() and "response_format" in requests[0][2]
    with pytest.raises(BadConfig, match="omit = top_p; known: temperature"):
        Endpoint("m", "http://127.0.0.1:9/v1", omit=["top_p"])


# --- what is read -------------------------------------------------------------------------------

GOOD = '{"a": 1}'


@pytest.mark.parametrize(
    ("message", "reason", "text", "ended"),
    [
        ({"content": [{"type": "thinking", "thinking": "hm"}, {"type": "text", "text": GOOD}]}, "stop", GOOD, ""),
        ({"content": [GOOD, None, 3, {"type": "text"}]}, "stop", GOOD, ""),
        ({"content": None, "reasoning_content": GOOD}, "stop", "", "empty: there is only reasoning, of 8"),
        ({"content": GOOD, "reasoning": {"odd": 1}}, "stop", GOOD, ""),
        ({"content": None, "refusal": "I cannot."}, "stop", "", "refused: I cannot."),
        ({"content": [{"type": "refusal", "refusal": "No."}]}, "stop", "", "refused: No."),
        ({"content": "{"}, "length", "{", "cut: the limit"),
        ({"content": ""}, "content_filter", "", "filtered: "),
        ({"content": "half \ud83d"}, ["odd"], "half ?", ""),
    ],
)
def test_a_completion_is_read_or_called_what_it_is(message, reason, text, ended):
    found = reply_of(completion(message, reason))
    assert found.text == text and found.ended.startswith(ended) and bool(found.ended) == bool(ended)


@pytest.mark.parametrize("given", [-1, float("inf"), float("nan"), "many", [1], True, 1e300, 10**30])
def test_a_number_of_tokens_that_is_none_is_ignored_and_said(given):
    found = reply_of(completion({"content": GOOD}, usage={"prompt_tokens": given, "completion_tokens": 3}))
    assert (found.tokens_in, found.tokens_out) == (0, 3) and "ignored" in found.notes[0] and tokens(given) is None


@pytest.mark.parametrize("call", [{"arguments": {"ticks": 5}}, {"arguments": '{"ticks": 5}'}])
def test_arguments_may_be_an_object_and_calls_as_they_were_until_2023(call):
    call = {"name": "Hold", **call}
    for message in ({"tool_calls": [{"function": call}]}, {"function_call": call}):
        assert reply_of(completion(message)).calls == (Call("Hold", '{"ticks": 5}'),)


def test_a_call_that_is_left_in_the_text_is_read_unless_replies_are_strict():
    written = Reply('<tool_call>{"name": "functions.Hold", "arguments": {"ticks": 5}}</tool_call>')
    assert called(written, TOOLS, False) == Call("Hold", '{"ticks": 5}')
    with pytest.raises(BadCall, match="0 tools"):
        called(written, TOOLS, True)
    with pytest.raises(BadCall, match="refused: no"):
        called(Reply("", ended="refused: no"), TOOLS, False)


@pytest.mark.parametrize(
    "text",
    [
        f"<think>{{maybe}} {{}}</think>\n{GOOD}",
        f"so it is.</think>{GOOD}",
        f"Here it is:\n```json\n{GOOD}\n```\nMore?",
        f"With {{braces}}: {GOOD} and again {GOOD}.",
        f"{GOOD}</tool_call>",
    ],
)
def test_thoughts_and_words_around_json_are_passed_over_unless_replies_are_strict(text):
    assert read_json(text, strict=False) == {"a": 1}
    with pytest.raises(FormatError):
        read_json(text)


@pytest.mark.parametrize("text", ["", "<think>hm", "{} {}", f'{GOOD} or {{"a": 2}}', "{" * 10**6, '{"a":' * 10**5])
def test_what_is_not_one_object_has_a_fault_with_a_name(text):
    with pytest.raises(FormatError) as error:
        read_json(text, strict=False)
    assert kind_of(str(error.value)) == ("empty" if not text else "not JSON")


def test_one_option_without_brackets_and_a_number_in_words_are_read():
    class Fact:
        def __init__(self, id_, options=()):
            self.id, self.options = id_, options

    facts = [Fact("way", ("left", "right")), Fact("count")]
    told = [
        {"fact": "way", "answer": "left", "evidence": "metadata", "rank": 1},
        {"fact": "count", "answer": "3", "evidence": ["metadata"], "rank": 2},
    ]
    reply = Reply(json.dumps({"episodic": [], "semantic": told, "unknown": []}))
    assert [claim.answer for claim in understanding(reply, facts, False).semantic] == [["left"], 3.0]
    with pytest.raises(FormatError):
        understanding(reply, facts, True)
    with pytest.raises(FormatError, match="cut: "):
        understanding(Reply("{", ended="cut: at the limit"), facts, False)


# --- runs ---------------------------------------------------------------------------------------


def settings(folder, url, **changes):
    given = {"pool": str(helpers.REFERENCE), "seeds": 3, "pictures": False, "stage": 1, "to": str(folder)}
    return AgentSettings(**{"model": "m", "url": url, **given, **changes})


def unknowns(body):
    known = body["response_format"]["json_schema"]["schema"]
    ids = known["properties"]["unknown"]["items"]["properties"]["fact"]["enum"]
    return json.dumps({"episodic": [], "semantic": [], "unknown": [{"fact": i, "sense": "touch"} for i in ids]})


def test_one_refused_request_does_not_end_a_run_and_three_do(tmp_path):
    with serving([unknowns, 400, unknowns]) as (url, _):
        found = run(settings(tmp_path / "one", url), lambda *_: None)
        assert len(found.results) == 2 and len(found.refused) == 1 and "400" in found.refused[0]
    with serving([400]) as (url, requests), pytest.raises(RefusedRequest):
        run(settings(tmp_path / "all", url), lambda *_: None)
    assert len(requests) == 3


def test_prices_give_money_and_stop_a_run(tmp_path, capsys):
    with serving([unknowns]) as (url, _):
        argv = ["agent", "model=m", f"url={url}", f"pool={helpers.REFERENCE}", "seeds=3", "pictures=false"]
        assert cli.run([*argv, f"to={tmp_path}", "prices=[1000, 10000]", "max_cost=0.3"]) == 1
    said = capsys.readouterr()
    assert "220 tokens, cost 0.4" in said.out and "max_cost = 0.3 is used up" in said.err
    told = json.loads((tmp_path / "table-1.json").read_text())
    assert told["strict"] is False and told["refused"] == 0


@pytest.mark.parametrize("usage", [None, {"prompt_tokens": -1e9, "completion_tokens": float("-inf")}])
def test_tokens_that_are_not_told_count_as_estimated_for_a_budget(usage, tmp_path):
    with serving([lambda body: completion({"content": unknowns(body)}, usage=usage)]) as (url, requests):
        found = run(settings(tmp_path, url, budget=Budget(tokens=1500.0)), lambda *_: None)
    assert len(requests) == 1 and "budget.tokens" in found.stopped


def test_prices_are_two_numbers_or_a_file(tmp_path):
    path = tmp_path / "prices.yaml"
    path.write_text("m: [3, 15]\nodd: [3, -1]\n")
    assert prices(str(path), "m", 2.0) == Prices(3.0, 15.0, 2.0) and Prices(3.0, 15.0).of((10**6, 10**5)) == 4.5
    for given, model, most, says in (
        (str(path), "mm", None, "did you mean 'm'"),
        (str(path), "odd", None, "two numbers"),
        ([1.0], "m", None, "two numbers"),
        ([float("nan"), 1.0], "m", None, "two numbers"),
        (None, "m", 1.0, "needs prices"),
        ([1.0, 1.0], "m", -1.0, "from 0 on"),
    ):
        with pytest.raises(ScengenError, match=says):
            prices(given, model, most)


@pytest.mark.parametrize(
    "line",
    [
        "{}",
        "[]",
        '{"digest": 1}',
        '{"digest": "a", "turns": [{"role": "user"}], "about": {}, "reply": {}}',
        "[" * 99999,
    ],
)
def test_a_journal_of_a_stranger_is_read_as_data(line, tmp_path):
    (tmp_path / "calls.jsonl").write_text(f"{{}}\n{line}\n")
    given = settings(tmp_path / "to", None, model=f"transcript:{tmp_path / 'calls.jsonl'}")
    with pytest.raises(BadConfig, match=r"journal|is not a call"):
        run(given, lambda *_: None)
