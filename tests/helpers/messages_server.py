"""The Messages API on loopback: checks requests as the real one would and answers from a script."""

import base64
import io
import json
import re
import threading
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

from PIL import Image

KEYWORDS = {
    *("type", "properties", "required", "additionalProperties", "items", "enum", "const"),
    *("anyOf", "allOf", "$ref", "$defs", "description", "title"),
}
KEY = "sk-test"
ADAPTIVE = {"type": "adaptive"}


def message(text, stop_reason="end_turn", **usage):
    """A reply's body."""
    counts = {"input_tokens": 1000, "output_tokens": 200} | usage
    return {
        "id": "msg_1",
        "type": "message",
        "role": "assistant",
        "model": "claude-test",
        "content": [
            {"type": "thinking", "thinking": "", "signature": "x"},
            {"type": "text", "text": text},
        ],
        "stop_reason": stop_reason,
        "stop_sequence": None,
        "usage": counts,
    }


def error(status, kind, text, **headers):
    """A script entry that fails."""
    return {
        "status": status,
        "headers": headers,
        "body": {"type": "error", "error": {"type": kind, "message": text}},
    }


def able(adaptive, *efforts, held=True):
    """What the service tells of a model."""

    def supported(yes):
        return {"supported": yes}

    levels = ("low", "medium", "high", "xhigh", "max")
    thinking = {"supported": True, "types": {"adaptive": supported(adaptive)}}
    effort = {"supported": bool(efforts), **{one: supported(one in efforts) for one in levels}}
    return {
        "id": "claude-test",
        "type": "model",
        "display_name": "Test",
        "created_at": "2026-11-01T00:00:00Z",
        "lifecycle": "active",
        "capabilities": {
            "thinking": thinking,
            "effort": effort,
            "structured_outputs": supported(held),
        },
    }


class Wrong(Exception):
    """What the real service would answer with 400."""


def need(condition, text):
    if not condition:
        raise Wrong(text)


def check(asked, held=True):
    """Raises Wrong where the real service would refuse the request.

    `held`: whether the model's answer can be held to a schema.
    """
    allowed = {"model", "max_tokens", "messages", "system", "output_config", "thinking"}
    need(not asked.keys() - allowed, f"unexpected: {sorted(asked.keys() - allowed)}")
    need(isinstance(asked.get("model"), str) and asked["model"], "model: field required")
    need(isinstance(asked.get("max_tokens"), int), "max_tokens: field required")
    need(asked.get("messages"), "messages: at least one message is required")
    roles = [each["role"] for each in asked["messages"]]
    expected = ["user", "assistant"] * len(roles)
    need(roles == expected[: len(roles)], "messages: roles must alternate, beginning with user")
    need(roles[-1] == "user", "messages: must end with a user message")
    blocks = [*asked.get("system", [])]
    need(all(block["type"] == "text" for block in blocks), "system: only text")
    for each in asked["messages"]:
        need(each["content"], "messages: content must not be empty")
        pictures = [block for block in each["content"] if block["type"] == "image"]
        need(each["role"] == "user" or not pictures, "messages: the assistant sends no images")
        blocks += each["content"]
    for block in blocks:
        need(not block.keys() - {"type", "text", "source", "cache_control"}, "unknown key in block")
        if block["type"] == "text":
            need(block["text"].strip(), "text content blocks must be non-empty")
        else:
            picture(block)
    cached = [block["cache_control"] for block in blocks if "cache_control" in block]
    need(len(cached) <= 4, "at most 4 blocks with cache_control")
    lives = [each.pop("ttl", "5m") for each in map(dict, cached)]
    need(all(each["type"] == "ephemeral" for each in cached), "cache_control: unknown")
    need(all(life in ("5m", "1h") for life in lives), "cache_control: unknown ttl")
    need(lives == sorted(lives), "cache_control: a longer ttl must come before a shorter one")
    need(asked.get("thinking", ADAPTIVE) == ADAPTIVE, "thinking: unknown")
    config = asked.get("output_config", {})
    effort = config.get("effort", "high")
    need(effort in ("low", "medium", "high", "xhigh", "max"), "output_config.effort: unknown")
    need(held or "format" not in config, "output_config.format: not supported by this model")
    if not held:
        return
    need("format" in config, "output_config.format: field required")
    form = config["format"]
    need(form["type"] == "json_schema", "output_config.format.type")
    schema(form["schema"])


def picture(block):
    """The picture in an image block, as the service decodes it."""
    need(block["type"] == "image", f"unknown block {block['type']}")
    source = block["source"]
    need(source["type"] == "base64" and source["media_type"] == "image/png", "image source")
    try:
        with Image.open(io.BytesIO(base64.b64decode(source["data"], validate=True))) as opened:
            opened.load()
            need(opened.format == "PNG", "image: not the media type that was said")
            need(max(opened.size) <= 8000, "image: too large")
            return opened.copy()
    except (OSError, ValueError):
        raise Wrong("image: cannot be decoded") from None


def schema(part, names=False):
    """Raises Wrong for what structured output does not support."""
    if isinstance(part, list):
        for each in part:
            schema(each)
    if not isinstance(part, dict):
        return
    for key, each in part.items():
        need(names or key in KEYWORDS, f"output_config: '{key}' is not supported")
        if key not in ("required", "enum", "const"):
            schema(each, names=not names and key in ("properties", "$defs"))
    if not names and part.get("type") == "object":
        need(part.get("additionalProperties") is False, "additionalProperties must be false")
        need(part.get("required") == list(part["properties"]), "all keys must be required")


class Server:
    """A running server.

    Attributes:
        script: what the next requests for a message get, first first: a body, an entry of `error`,
            or "hang", "drop" or "page". The last entry serves all further requests.
        requests: bodies of the requests for a message, in the order of arrival.
        batches: bodies of the requests for a batch.
        results: function of a batch's entry to its result.
        looks: how many looks at a batch it takes until it has ended.
        models: what is told of a model, by its name; 404 for others.
        deaf: whether it hangs up on whoever looks at a batch.
    """

    def __init__(self):
        self.script = [error(400, "unscripted", "no answer is scripted")]
        self.requests, self.batches = [], []
        self.looks, self.seen, self.paths = 0, 0, []
        self.results = lambda entry: {"type": "succeeded", "message": message("{}")}
        self.models, self.deaf = {}, False
        self.released = threading.Event()
        self.url = ""

    def holds(self, asked):
        """Whether what is told of the model does not say that no schema holds its answers."""
        told = self.models.get(asked.get("model"))
        said = told.get("capabilities") if isinstance(told, dict) else None
        found = said.get("structured_outputs") if isinstance(said, dict) else None
        return found != {"supported": False}


class Handler(BaseHTTPRequestHandler):
    """Answers from `self.server.state`."""

    protocol_version = "HTTP/1.1"

    def log_message(self, *args):
        pass

    def reply(self, status, body, headers=(), kind="application/json"):
        data = body if isinstance(body, bytes) else json.dumps(body).encode()
        self.send_response(status)
        for key, value in {"content-type": kind, **dict(headers)}.items():
            self.send_header(key.replace("_", "-"), str(value))
        self.send_header("content-length", str(len(data)))
        self.end_headers()
        self.wfile.write(data)

    def refuse(self, status, kind, text):
        self.reply(status, error(status, kind, text)["body"])

    def entitled(self):
        key = self.headers.get("x-api-key") or self.headers.get("authorization", "")
        if key.removeprefix("Bearer ") == KEY:
            return True
        self.refuse(401, "authentication_error", "invalid x-api-key")
        return False

    def do_POST(self):
        state = self.server.state
        asked = json.loads(self.rfile.read(int(self.headers["content-length"])))
        state.paths.append(self.path)
        if not self.entitled():
            return
        try:
            if self.path == "/v1/messages":
                state.requests.append(asked)
                check(asked, state.holds(asked))
                self.play(state.script.pop(0) if len(state.script) > 1 else state.script[0])
            elif self.path == "/v1/messages/count_tokens":
                check({"max_tokens": 1, **asked})
                self.reply(200, {"input_tokens": 4321})
            elif self.path == "/v1/messages/batches":
                ids = [entry["custom_id"] for entry in asked["requests"]]
                need(len(set(ids)) == len(ids), "custom_id must be unique")
                pattern = re.compile(r"[a-zA-Z0-9_-]{1,64}")
                need(all(pattern.fullmatch(each) for each in ids), "custom_id")
                for entry in asked["requests"]:
                    check(entry["params"])
                state.batches.append(asked["requests"])
                self.reply(200, self.batch(len(state.batches) - 1))
            else:
                self.refuse(404, "not_found_error", "no such path")
        except Wrong as wrong:
            self.refuse(400, "invalid_request_error", str(wrong))

    def do_GET(self):
        state = self.server.state
        if model := re.fullmatch(r"/v1/models/(.*)", self.path):
            if not self.entitled():
                return
            if model[1] in state.models:
                self.reply(200, state.models[model[1]])
            else:
                self.refuse(404, "not_found_error", "no such model")
            return
        state.paths.append(self.path)
        if state.deaf:
            self.close_connection = True
            return
        if not self.entitled():
            return
        found = re.fullmatch(r"/v1/messages/batches/batch_(\d+)(/results)?", self.path)
        if not found or int(found[1]) >= len(state.batches):
            self.refuse(404, "not_found_error", "no such batch")
        elif found[2]:
            lines = [
                json.dumps({"custom_id": entry["custom_id"], "result": state.results(entry)}) + "\n"
                for entry in reversed(state.batches[int(found[1])])
            ]
            self.reply(200, "".join(lines).encode(), kind="application/x-jsonl")
        else:
            state.seen += 1
            self.reply(200, self.batch(int(found[1])))

    def batch(self, number):
        state = self.server.state
        count, ended = len(state.batches[number]), state.seen > state.looks
        counts = {"canceled": 0, "errored": 0, "expired": 0}
        return {
            "id": f"batch_{number}",
            "type": "message_batch",
            "processing_status": "ended" if ended else "in_progress",
            "request_counts": counts
            | {"processing": 0 if ended else count, "succeeded": count if ended else 0},
            "created_at": "2026-11-01T00:00:00Z",
            "expires_at": "2026-11-02T00:00:00Z",
            "ended_at": None,
            "archived_at": None,
            "cancel_initiated_at": None,
            "results_url": f"{state.url}/v1/messages/batches/batch_{number}/results"
            if ended
            else None,
        }

    def play(self, entry):
        if entry == "hang":
            self.server.state.released.wait(10)
            self.close_connection = True
        elif entry == "drop":
            self.close_connection = True
        elif entry == "page":
            self.reply(200, b"<html>not an API</html>", kind="text/html")
        elif "status" in entry:
            self.reply(entry["status"], entry["body"], entry["headers"])
        else:
            self.reply(200, entry)


@contextmanager
def serve(handler=Handler):
    """A server on a free port of loopback, closed at the end."""
    state = Server()
    server = ThreadingHTTPServer(("127.0.0.1", 0), handler)
    server.state = state
    state.url = f"http://127.0.0.1:{server.server_port}"
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    try:
        yield state
    finally:
        state.released.set()
        server.shutdown()
        thread.join()
        server.server_close()
