"""`joda context`: what the model knows of a joint."""

from joda.scenes.context import context
from joda.terminal import options
from joda.terminal.say import print_json, say


def command(
    model: options.Model,
    joint: options.Joint,
    as_json: options.JsonFile = None,
    force: options.Force = False,
) -> None:
    """Tell what the model knows of a joint: axes, range, inertia.

    Also what gravity does to it, and which end is up. Example:

        joda context out/oven.xml --joint door
    """
    from joda.files import check_target, write_text
    from joda.plain import plain

    if as_json and as_json != options.STDOUT:
        check_target(as_json, force)
    found = context(model, joint)
    if as_json == options.STDOUT:
        print_json(found.model_dump(mode="json"))
        return
    if as_json:
        write_text(as_json, plain(found.model_dump_json(indent=2)) + "\n")
    say(*found.describe().split("\n"), *found.warnings)
    if as_json:
        say(as_json)
