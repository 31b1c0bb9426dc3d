"""The chat API of OpenAI on loopback, as other servers speak it; `messages_server` runs it."""

import base64
import io
import json

import jsonschema
from messages_server import KEY, Handler, Wrong, need
from PIL import Image

PATH = "/v1/chat/completions"


def completion(text, finish_reason="stop", usage=(1000, 200), cached=0, **said):
    """A reply's body."""
    counts = usage and {
        "prompt_tokens": usage[0],
        "completion_tokens": usage[1],
        "total_tokens": sum(usage),
        "prompt_tokens_details": {"cached_tokens": cached},
    }
    return {
        "id": "chatcmpl-1",
        "object": "chat.completion",
        "created": 1_790_000_000,
        "model": "qwen-test",
        "choices": [
            {
                "index": 0,
                "message": {"role": "assistant", "content": text, **said},
                "finish_reason": finish_reason,
            }
        ],
        "usage": counts,
    }


def refusal(status, text, **headers):
    """A script entry that fails, as OpenAI's own server words it."""
    return {"status": status, "headers": headers, "body": {"error": {"message": text}}}


def pictures(asked):
    """The pictures of a request, decoded."""
    parts = [p for m in asked["messages"] if isinstance(m["content"], list) for p in m["content"]]
    urls = [part["image_url"]["url"] for part in parts if part["type"] == "image_url"]
    return [_picture(url) for url in urls]


def words(asked):
    """All text of a request."""
    return "\n".join(
        m["content"]
        if isinstance(m["content"], str)
        else "\n".join(part.get("text", "") for part in m["content"])
        for m in asked["messages"]
    )


def _picture(url):
    head, _, data = url.partition(",")
    need(head == "data:image/png;base64", "image_url: no PNG as a data URL")
    with Image.open(io.BytesIO(base64.b64decode(data, validate=True))) as opened:
        return opened.convert("RGB")


def check(asked):
    """Raises Wrong where a server would refuse the request."""
    known = {"model", "messages", "response_format", "max_tokens", "max_completion_tokens"}
    more = asked.keys() - known - {"reasoning_effort"}
    need(not more, f"unknown: {sorted(more)}")
    first, *others = asked["messages"]
    need(first["role"] == "system" and isinstance(first["content"], str), "messages: no system")
    roles = [each["role"] for each in others]
    need(roles == (["user", "assistant"] * len(roles))[: len(roles)], "messages: must alternate")
    need(roles[-1] == "user", "messages: must end with a user's")
    need(all(each["content"] for each in others), "messages: must not be empty")
    pictures(asked)
    if form := asked.get("response_format"):
        need(form["type"] == "json_schema" and form["json_schema"]["strict"], "response_format")
        jsonschema.Draft202012Validator.check_schema(form["json_schema"]["schema"])


class Chat(Handler):
    """Answers from `self.server.state`; a key is asked for only if the state has one."""

    def entitled(self):
        sent = self.headers.get("authorization", "").removeprefix("Bearer ")
        if sent in (KEY, "none"):
            return True
        self.reply(401, {"error": {"message": f"Incorrect API key provided: {sent}"}})
        return False

    def do_POST(self):
        state = self.server.state
        asked = json.loads(self.rfile.read(int(self.headers["content-length"])))
        state.paths.append(self.path)
        if self.path != PATH:
            self.reply(404, {"detail": "Not Found"})
        elif self.entitled():
            state.requests.append(asked)
            try:
                check(asked)
            except Wrong as wrong:
                self.reply(400, {"error": {"message": str(wrong)}})
                return
            entry = state.script.pop(0) if len(state.script) > 1 else state.script[0]
            self.play(entry(asked) if callable(entry) else entry)
