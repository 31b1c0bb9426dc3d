"""What is added to a joint for a requirement that its kind does not have."""

from joda.propose.archetype_effects import (
    HELD,
    RISE,
    SNAP,
    SPRING,
    ArchetypeEffect,
    catch,
    part,
    rising,
)

WISHED: dict[str, tuple[ArchetypeEffect, ...]] = {
    "closes_near": (catch("strong", 0.1, "it is to close by itself"),),
    "held_shut": (catch("strong", 0.1, "it is to stay shut"),),
    "closes_from": rising(
        "closes_from", 1, RISE + (1 - RISE) / HELD, "a sprung hinge shuts it", "closes_from"
    ),
    "caught": rising("caught", 0.1, 0.1, "a catch holds it until it gives way"),
    "closes_anywhere": (part(SPRING, (0, 1), "it is to return from anywhere", "medium"),),
    "left_open": (
        part("constant_friction_hinge", (0, 1), "it is not to close by itself", friction="weak"),
    ),
    "falls_shut": (part(SPRING, (0, 1), "it is to fall shut", "weak"),),
    "opens_past": (
        part("constant_{opening}_conservative_hinge", (0.4, 1), "it is to open", "medium"),
    ),
    "latched": (part(SNAP, (0, 0.07), "it is to latch", "strong", "weak"),),
    "stays_put": (
        part("constant_friction_hinge", (0.1, 1), "it is to stay where left", friction="medium"),
    ),
    "holds_between": (
        part("constant_friction_hinge", (0, 1), "it is to hold there", friction="medium"),
    ),
    "stays_half": (
        part("constant_friction_hinge", (0.3, 0.7), "it is to hold half-way", friction="strong"),
    ),
    "stays_open": (
        part("magnetic_return_to_{open}", (0.88, 1), "it is to stay open", "medium", "weak"),
    ),
    "clicks": (part("detents", (0, 1), "it is to click", "medium"),),
    "two_sides": (part("bistable_mechanism", (0, 1), "it is to have two sides", "strong"),),
    "returns_to_middle": (part("detent_internal", (0, 1), "it is to return", "strong"),),
    "snaps": (part("detent_internal", (0.3, 0.7), "it is to snap through", "medium"),),
    "soft": (part("constant_damping_hinge", (0, 0.3), "it is to close softly", damping="medium"),),
    "arrives": (part("constant_damping_hinge", (0, 0.3), "it is not to slam", damping="medium"),),
}
"""What is added for a requirement that the kind does not have."""

RISING = {"closes_from", "caught"}
"""Requirements whose pull is of two parts."""
