"""Articulated objects with random proportions, as URDF, and what each of their joints should do.

Like PartNet-Mobility's: a base, parts on hinges and slides, limits, masses, no dynamics at all.
With anonymous names they are told apart by their shape alone. Of each joint it is written here, and
not in the package, which way it opens, what becomes of it when it is let go, and which force a hand
needs; a share of the objects has its axes turned round, and each stands turned about the vertical.

What is expected:

- `opens`: "+" or "-", the sign of q in which it opens; none where nothing is open or shut
- `half`: let go half-way it "stays" (comes to rest within a tenth of its range, a click away at
  most), "closes" or "opens"
- `near`: nearly closed (3 % of its range) it closes by itself
- `shut`: closed it stays, and takes at least 0.5 N at the handle to open
- `clicks`: it comes to rest by itself at places between its ends
- `sides`: from either third of its range it goes to the end there
- `force`: within which the most lies that a slow hand needs at the handle to open it, N, but for
  what sets the part's mass in motion, as the standards count it
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

Array = np.ndarray
Geom = tuple[str, tuple[float, ...], tuple[float, float, float], tuple[float, float, float]]
Expected = dict[str, Any]
LEVEL, UP = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)


def box(x: float, y: float, z: float, at: Sequence[float]) -> Geom:
    return "box", (x, y, z), tuple(at), (0, 0, 0)  # type: ignore[return-value]


def rod(radius: float, length: float, at: Sequence[float], along: str = "z") -> Geom:
    turn = {"z": (0, 0, 0), "x": (0, np.pi / 2, 0), "y": (np.pi / 2, 0, 0)}[along]
    return "cylinder", (radius, length), tuple(at), turn  # type: ignore[return-value]


@dataclass
class Joint:
    """A joint to be: where, how, what it moves, and what is expected of it.

    Attributes:
        part: what it is, in English.
        words: names that people give it.
        arm: distance of the hand from the axis of a hinge, m; 1 for a slide.
    """

    part: str
    words: tuple[str, ...]
    kind: str
    origin: tuple[float, float, float]
    axis: tuple[float, float, float]
    limits: tuple[float, float]
    geoms: list[Geom]
    mass: float
    arm: float
    expected: Expected
    parent: int = -1
    name: str = ""


@dataclass
class Object:
    """An object: the geoms of its base, its joints, its category."""

    category: str
    base: list[Geom]
    joints: list[Joint] = field(default_factory=list)
    yaw: float = 0.0

    def urdf(self, named: bool, rng: np.random.Generator) -> str:
        """The file; each joint is given its `name`."""
        title = self.category if named else str(rng.integers(100, 103000))
        out = [f'<robot name="{title}"><link name="base"/>']
        links = ["base_body" if named else "link_0"]
        out.append(_link(links[0], self.base, 20.0))
        out.append(_fixed("base", links[0], self.yaw))
        for k, joint in enumerate(self.joints):
            word = str(rng.choice(joint.words)) if named else ""
            link = f"{word}_{k}" if named else f"link_{k + 1}"
            joint.name = f"{word}_joint_{k}" if named else f"joint_{k}"
            out.append(_link(link, joint.geoms, joint.mass))
            parent = links[joint.parent + 1]
            lo, hi = joint.limits
            out.append(
                f'<joint name="{joint.name}" type="{joint.kind}"><parent link="{parent}"/>'
                f'<child link="{link}"/><origin xyz="{_text(joint.origin)}"/>'
                f'<axis xyz="{_text(joint.axis)}"/>'
                f'<limit lower="{lo:.5g}" upper="{hi:.5g}" effort="0" velocity="0"/></joint>'
            )
            links.append(link)
        return "\n".join([*out, "</robot>\n"])


def _text(values: Sequence[float]) -> str:
    return " ".join(f"{value:.6g}" for value in values)


def _fixed(parent: str, child: str, yaw: float) -> str:
    return (
        f'<joint name="fixed" type="fixed"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin rpy="0 0 {yaw:.4f}"/></joint>'
    )


def _link(name: str, geoms: list[Geom], mass: float) -> str:
    volumes = np.array([np.prod(g[1]) if g[0] == "box" else 3 * g[1][0] ** 2 * g[1][1]
                        for g in geoms])  # fmt: skip
    centre = np.average([g[2] for g in geoms], axis=0, weights=volumes)
    sizes = [np.array(g[2]) - centre for g in geoms]
    spread = float(max(np.abs(sizes).max(), 0.01)) if len(geoms) > 1 else max(geoms[0][1]) / 2
    inertia = mass * spread**2 / 3
    shapes = []
    for kind, size, at, turn in geoms:
        shape = (
            f'<box size="{_text(size)}"/>'
            if kind == "box"
            else f'<cylinder radius="{size[0]:.5g}" length="{size[1]:.5g}"/>'
        )
        place = f'<origin xyz="{_text(at)}" rpy="{_text(turn)}"/>'
        shapes.append(f"<collision>{place}<geometry>{shape}</geometry></collision>")
    i = f"{inertia:.4g}"
    return (
        f'<link name="{name}"><inertial><origin xyz="{_text(centre)}"/><mass value="{mass:.4g}"/>'
        f'<inertia ixx="{i}" iyy="{i}" izz="{i}" ixy="0" ixz="0" iyz="0"/></inertial>'
        f"{''.join(shapes)}</link>"
    )


def shell(w: float, d: float, h: float, t: float, z: float = 0.0) -> list[Geom]:
    """A box without its front (at -y); its floor is at z, its middle above the origin."""
    walls = [
        box(t, d, h, (-w / 2 + t / 2, 0, z + h / 2)),
        box(t, d, h, (w / 2 - t / 2, 0, z + h / 2)),
        box(w - 2 * t, d, t, (0, 0, z + t / 2)),
        box(w - 2 * t, d, t, (0, 0, z + h - t / 2)),
        box(w - 2 * t, t, h - 2 * t, (0, d / 2 - t / 2, z + h / 2)),
    ]
    return walls


class Draw:
    """Random proportions."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng

    def __call__(self, low: float, high: float) -> float:
        return float(self.rng.uniform(low, high))

    def some(self, low: int, high: int) -> int:
        return int(self.rng.integers(low, high + 1))

    def maybe(self, share: float = 0.5) -> bool:
        return bool(self.rng.random() < share)


DOOR = {"opens": "+", "near": True, "shut": True, "half": "stays"}


def side_door(
    u: Draw, x: float, w: float, h: float, z: float, y: float, t: float, right: bool,
    part: str, words: tuple[str, ...], expected: Expected, density: float, handle: bool = True,
    extra: float = 1.6,
) -> Joint:  # fmt: skip
    """A door on a vertical axis at the left (or right) edge of an opening; front at -y."""
    side = -1.0 if right else 1.0
    geoms = [box(w, t, h, (side * w / 2, -t / 2, 0))]
    grip = w - u(0.03, 0.06)
    if handle:
        long = min(u(0.08, 0.3), 0.6 * h)
        geoms.append(box(0.015, 0.02, long, (side * grip, -t - 0.03, 0)))
    origin = (x - side * w / 2, y, z + h / 2)
    axis = (0, 0, -side)
    mass = density * w * t * h
    return Joint(
        part, words, "revolute", origin, axis, (0, u(extra, extra + 0.4)), geoms, mass,
        grip if handle else w, expected,
    )  # fmt: skip


def cabinet(u: Draw) -> Object:
    w, d, h, t = u(0.6, 1.1), u(0.3, 0.6), u(0.5, 1.0), u(0.015, 0.025)
    out = Object("StorageFurniture", shell(w, d, h, t))
    rows = u.some(1, 2)
    low = h * u(0.45, 0.65)
    words = ("cabinet_door", "hinge_door", "Schranktuer", "porte_placard", "puerta_armario")
    expected = {**DOOR, "force": (3, 30)}
    out.base.append(box(w - 2 * t, d - t, t, (0, -t / 2, low)))
    for right in (False, True):
        x = w / 4 if right else -w / 4
        out.joints.append(
            side_door(u, x, w / 2 - 0.002, low - 0.004, 0.002, -d / 2, 0.02, right,
                      "cabinet door", words, expected, 650)
        )  # fmt: skip
    room = (h - t - low) / rows
    for row in range(rows):
        out.joints.append(drawer(u, w - 2 * t - 0.01, d - 0.02, room - 0.01, low + row * room + t,
                                 -d / 2))  # fmt: skip
    return out


def drawer(u: Draw, w: float, d: float, h: float, z: float, y: float) -> Joint:
    t, side = 0.012, 0.8 * h
    depth = d - 0.03
    geoms = [
        box(w, 0.018, h, (0, -0.009, h / 2)),
        box(w - 0.02, depth, t, (0, depth / 2, t / 2)),
        box(t, depth, side, (-w / 2 + 0.02, depth / 2, side / 2)),
        box(t, depth, side, (w / 2 - 0.02, depth / 2, side / 2)),
        box(w - 0.04, t, side, (0, depth - t / 2, side / 2)),
        box(u(0.08, 0.16), 0.02, 0.012, (0, -0.035, h / 2)),
    ]
    words = ("drawer", "Schublade", "tiroir", "cajon", "slider_drawer", "cassetto")
    return Joint(
        "drawer", words, "prismatic", (0, y, z), (0, -1, 0), (0, depth * u(0.6, 0.9)), geoms,
        u(1.5, 5), 1.0, {**DOOR, "force": (2, 30)},
    )  # fmt: skip


def chest_of_drawers(u: Draw) -> Object:
    w, d, h, t = u(0.4, 0.9), u(0.35, 0.5), u(0.5, 1.0), 0.018
    out = Object("StorageFurniture", shell(w, d, h, t))
    rows = u.some(2, 4)
    room = (h - 2 * t) / rows
    for row in range(rows):
        z = t + row * room
        if row:
            out.base.append(box(w - 2 * t, d - t, 0.01, (0, -t / 2, z)))
        out.joints.append(drawer(u, w - 2 * t - 0.01, d - 0.03, room - 0.025, z + 0.012, -d / 2))
    return out


def front_flap(
    u: Draw, w: float, h: float, z: float, y: float, t: float, part: str,
    words: tuple[str, ...], expected: Expected, mass: float, handle: float,
) -> Joint:  # fmt: skip
    """A door hinged at its lower edge, that comes down to the front; its handle at a height."""
    geoms = [
        box(w, t, h, (0, -t / 2, h / 2)),
        rod(0.01, 0.6 * w, (0, -t - 0.045, handle), "x"),
    ]
    return Joint(
        part, words, "revolute", (0, y, z), LEVEL, (0, u(1.45, 1.62)), geoms, mass,
        float(np.hypot(handle, t + 0.045)), expected,
    )  # fmt: skip


def knob(u: Draw, at: Sequence[float], expected: Expected, words: tuple[str, ...]) -> Joint:
    r, long = u(0.014, 0.028), u(0.015, 0.03)
    geoms = [rod(r, long, (0, -long / 2, 0), "y")]
    if u.maybe():
        geoms.append(box(0.006, 0.006, 1.6 * r, (0, -long - 0.003, 0)))
    span = u(3.4, 5.2)
    return Joint(
        "knob", words, "revolute", tuple(at), (0, 1, 0), (0, span), geoms, u(0.015, 0.05), r,
        expected,
    )  # type: ignore[arg-type]  # fmt: skip


KNOB = ("knob", "Drehknopf", "bouton_rotatif", "perilla", "manopola", "control_knob")
BUTTON = ("button", "Taste", "bouton", "boton", "push_button", "key")


def oven(u: Draw) -> Object:
    w, d, h, t = u(0.55, 0.65), u(0.5, 0.6), u(0.6, 0.75), u(0.03, 0.05)
    panel = u(0.1, 0.14)
    base = [*shell(w, d, h - panel, t), box(w, d, panel, (0, 0, h - panel / 2))]
    out = Object("Oven", base)
    tall = h - panel - 0.02
    words = ("oven_door", "Backofentuer", "porte_du_four", "puerta_horno", "door")
    expected = {"opens": "+", "near": True, "shut": True, "half": "stays", "force": (8, 60)}
    out.joints.append(
        front_flap(u, w - 0.02, tall, 0.01, -d / 2, 0.04, "oven door", words, expected, u(5, 9),
                   tall - u(0.03, 0.06))
    )  # fmt: skip
    for k in range(n := u.some(2, 4)):
        x = (k - (n - 1) / 2) * w / (n + 1)
        expected = {"half": "stays", "force": (0.5, 35)}
        out.joints.append(knob(u, (x, -d / 2, h - panel / 2), expected, KNOB))
    return out


def dishwasher(u: Draw) -> Object:
    w, d, h = u(0.44, 0.6), u(0.5, 0.6), u(0.78, 0.88)
    out = Object("Dishwasher", shell(w, d, h, 0.03))
    words = ("dishwasher_door", "Geschirrspueler_Tuer", "porte_lave_vaisselle", "door")
    tall = h - 0.1
    expected = {"opens": "+", "near": True, "shut": True, "half": "stays", "force": (8, 60)}
    out.joints.append(
        front_flap(u, w - 0.01, tall, 0.09, -d / 2, 0.05, "dishwasher door", words, expected,
                   u(6, 10), tall - u(0.03, 0.1))
    )  # fmt: skip
    return out


def microwave(u: Draw) -> Object:
    w, d, h, t = u(0.44, 0.56), u(0.33, 0.42), u(0.26, 0.33), 0.02
    panel = u(0.1, 0.14)
    inside = [
        (kind, size, (at[0] - panel / 2, at[1], at[2]), turn)
        for kind, size, at, turn in shell(w - panel, d, h, t)
    ]
    out = Object("Microwave", [*inside, box(panel, d, h, (w / 2 - panel / 2, 0, h / 2))])
    words = ("microwave_door", "Mikrowellentuer", "porte_micro_ondes", "door")
    expected = {"opens": "+", "shut": True, "half": "stays", "force": (10, 60)}
    out.joints.append(
        side_door(u, -panel / 2, w - panel - 0.004, h - 0.004, 0.002, -d / 2, 0.035, False,
                  "microwave door", words, expected, 500)
    )  # fmt: skip
    for k in range(u.some(1, 3)):
        at = (w / 2 - panel / 2, -d / 2, 0.05 + 0.05 * k)
        out.joints.append(button(u, at, (0, 1, 0)))
    return out


def button(u: Draw, at: Sequence[float], way: tuple[float, float, float]) -> Joint:
    a, b, deep = u(0.012, 0.03), u(0.012, 0.025), u(0.006, 0.012)
    along = np.abs(way)
    size = np.where(along > 0.5, deep, [a, a, b]) if along[2] < 0.5 else np.array([a, b, deep])
    geoms = [box(*size, tuple(-np.array(way) * deep / 2))]
    expected = {"opens": "+", "half": "closes", "force": (1, 23)}
    return Joint(
        "button", BUTTON, "prismatic", tuple(at), way, (0, u(0.002, 0.006)), geoms,
        u(0.002, 0.01), 1.0, expected,
    )  # type: ignore[arg-type]  # fmt: skip


def refrigerator(u: Draw) -> Object:
    w, d, h, t = u(0.55, 0.75), u(0.55, 0.65), u(1.4, 1.9), u(0.03, 0.05)
    out = Object("Refrigerator", shell(w, d, h, t))
    low = h * u(0.35, 0.65)
    out.base.append(box(w - 2 * t, d - t, t, (0, -t / 2, low)))
    words = ("fridge_door", "refrigerator_door", "Kuehlschranktuer", "porte_frigo", "door")
    expected = {**DOOR, "force": (10, 67)}
    right = u.maybe()
    for z, tall in ((0.0, low), (low, h - low)):
        out.joints.append(
            side_door(u, 0, w, tall - 0.006, z + 0.003, -d / 2, u(0.05, 0.08), right,
                      "refrigerator door", words, expected, 250)
        )  # fmt: skip
    return out


def washing_machine(u: Draw) -> Object:
    w, d, h = u(0.58, 0.62), u(0.5, 0.6), u(0.82, 0.88)
    r, mid = u(0.14, 0.18), 0.45
    side, above = (w - 2 * r) / 2, h - mid - r
    base = [
        *shell(w, d, h, 0.015),
        box(side, 0.02, 2 * r, (-w / 2 + side / 2, -d / 2 + 0.01, mid)),
        box(side, 0.02, 2 * r, (w / 2 - side / 2, -d / 2 + 0.01, mid)),
        box(w, 0.02, above, (0, -d / 2 + 0.01, h - above / 2)),
        box(w, 0.02, mid - r, (0, -d / 2 + 0.01, (mid - r) / 2)),
    ]
    out = Object("WashingMachine", base)
    words = ("washer_door", "Waschmaschine_Tuer", "porte_hublot", "lavadora_puerta", "door")
    geoms = [
        rod(r + 0.01, 0.04, (r + 0.01, -0.02, 0), "y"),
        box(0.02, 0.03, 0.1, (2 * r, -0.055, 0)),
    ]
    expected = {"opens": "+", "shut": True, "half": "stays", "force": (10, 60)}
    out.joints.append(
        Joint("washing machine door", words, "revolute", (-r - 0.01, -d / 2, mid), (0, 0, -1),
              (0, u(1.8, 2.6)), geoms, u(2, 4), 2 * r, expected)
    )  # fmt: skip
    expected = {"half": "stays", "force": (0.5, 35)}
    out.joints.append(knob(u, (u(-0.1, 0.2), -d / 2, h - 0.07), expected, KNOB))
    return out


def laptop(u: Draw) -> Object:
    w, d = u(0.28, 0.4), u(0.19, 0.28)
    out = Object("Laptop", [box(w, d, 0.018, (0, 0, 0.009))])
    words = ("laptop_lid", "screen", "Bildschirm", "ecran", "pantalla", "display")
    geoms = [box(w, d, 0.007, (0, -d / 2, 0.0035))]
    expected = {"opens": "+", "half": "stays", "force": (1, 15)}
    out.joints.append(
        Joint("laptop lid", words, "revolute", (0, d / 2, 0.018), (-1, 0, 0), (0, u(1.9, 2.5)),
              geoms, u(0.3, 0.7), d, expected)
    )  # fmt: skip
    return out


def faucet(u: Draw) -> Object:
    h, reach = u(0.1, 0.3), u(0.1, 0.2)
    base = [rod(u(0.018, 0.026), h, (0, 0, h / 2)), rod(0.012, reach, (0, -reach / 2, h), "y")]
    out = Object("Faucet", base)
    words = ("faucet_lever", "tap_handle", "Wasserhahn_Hebel", "robinet", "grifo", "faucet_handle")
    expected = {"half": "stays", "force": (1, 23)}
    if u.maybe():
        long = u(0.07, 0.14)
        geoms = [rod(0.02, 0.03, (0, 0, 0.015)), box(0.016, long, 0.01, (0, -long / 2, 0.035))]
        out.joints.append(
            Joint("faucet lever", words, "revolute", (0, 0, h + 0.015), UP, (-u(0.8, 1.5), 0.9),
                  geoms, u(0.1, 0.25), long, expected)
        )  # fmt: skip
    else:
        for side in (-1, 1):
            x, long = side * u(0.08, 0.11), u(0.04, 0.08)
            out.base.append(rod(0.02, 0.05, (x, 0, 0.025)))
            lever = rod(0.007, long, (side * long / 2, 0, 0.02), "x")
            geoms = [rod(0.02, 0.02, (0, 0, 0.01)), lever]
            out.joints.append(
                Joint("faucet lever", words, "revolute", (x, 0, 0.05), UP, (0, u(1.4, 3.0)), geoms,
                      u(0.08, 0.2), long, expected)
            )  # fmt: skip
    return out


def safe(u: Draw) -> Object:
    w, d, h, t = u(0.3, 0.5), u(0.3, 0.45), u(0.25, 0.55), u(0.03, 0.05)
    out = Object("Safe", shell(w, d, h, t))
    words = ("safe_door", "Tresortuer", "porte_coffre_fort", "puerta_caja_fuerte", "door")
    expected = {"opens": "+", "half": "stays", "force": (2, 60)}
    door = side_door(u, 0, w, h, 0, -d / 2, u(0.04, 0.06), False, "safe door", words, expected,
                     1500, handle=False)  # fmt: skip
    out.joints.append(door)
    r = u(0.025, 0.04)
    geoms = [rod(r, 0.03, (0, -0.015, 0), "y")]
    out.joints.append(
        Joint("safe dial", ("dial", "combination_dial", "knob", "Zahlenschloss"), "revolute",
              (w / 2, -0.06, 0), (0, 1, 0), (0, u(5.5, 6.28)), geoms, 0.1, r,
              {"half": "stays", "force": (0.5, 35)}, parent=0)
    )  # fmt: skip
    return out


def frame(w: float, h: float, t: float, d: float, z: float) -> list[Geom]:
    return [
        box(t, d, h, (-w / 2 + t / 2, 0, z + h / 2)),
        box(t, d, h, (w / 2 - t / 2, 0, z + h / 2)),
        box(w - 2 * t, d, t, (0, 0, z + t / 2)),
        box(w - 2 * t, d, t, (0, 0, z + h - t / 2)),
    ]


def window(u: Draw) -> Object:
    w, h, t, z = u(0.5, 1.3), u(0.6, 1.4), 0.05, u(0, 0.9)
    words = ("window", "window_sash", "Fenster", "fenetre", "ventana", "finestra")
    out = Object("Window", frame(w, h, t, 0.08, z))
    expected = {"half": "stays", "force": (2, 100)}
    style = u.some(0, 2)
    inner, tall = w - 2 * t, h - 2 * t
    if style == 0:
        out.joints.append(
            side_door(u, 0, inner, tall, z + t, -0.01, 0.04, u.maybe(), "casement window", words,
                      {**expected, "opens": "+"}, 450, handle=False, extra=1.2)
        )  # fmt: skip
    elif style == 1:
        pane = [box(inner / 2, 0.03, tall, (0, 0, 0))]
        out.joints.append(
            Joint("sliding window", words, "prismatic", (-inner / 4, 0.02, z + h / 2), LEVEL,
                  (0, inner / 2 - 0.02), pane, 12 * inner * tall, 1.0, expected)
        )  # fmt: skip
        out.base.append(box(inner / 2, 0.02, tall, (inner / 4, -0.02, z + h / 2)))
    else:
        pane = [box(inner, 0.03, tall / 2, (0, 0, 0))]
        out.joints.append(
            Joint("sash window", words, "prismatic", (0, 0.02, z + t + tall / 4), UP,
                  (0, tall / 2 - 0.02), pane, 10 * inner * tall, 1.0, expected)
        )  # fmt: skip
        out.base.append(box(inner, 0.02, tall / 2, (0, -0.02, z + t + 0.75 * tall)))
    return out


def lidded(u: Draw, category: str, w: float, d: float, h: float, t: float, words: tuple[str, ...],
           mass: float, most: float, expected: Expected) -> Object:  # fmt: skip
    """A box that is open above, with a lid on a hinge at its back."""
    base = [
        box(t, d, h, (-w / 2 + t / 2, 0, h / 2)),
        box(t, d, h, (w / 2 - t / 2, 0, h / 2)),
        box(w, t, h, (0, d / 2 - t / 2, h / 2)),
        box(w, t, h, (0, -d / 2 + t / 2, h / 2)),
        box(w, d, t, (0, 0, t / 2)),
    ]
    out = Object(category, base)
    geoms = [box(w, d, t, (0, -d / 2, t / 2))]
    out.joints.append(
        Joint("lid", words, "revolute", (0, d / 2, h), (-1, 0, 0), (0, most), geoms, mass, d,
              expected)
    )  # fmt: skip
    return out


def chest(u: Draw) -> Object:
    w, d = u(0.5, 1.2), u(0.3, 0.6)
    mass = 500 * w * d * 0.02
    words = ("chest_lid", "lid", "Deckel", "couvercle", "tapa", "box_lid")
    expected = {"opens": "+", "half": "closes", "shut": True, "force": (5, 100)}
    return lidded(u, "Box", w, d, u(0.3, 0.6), 0.02, words, mass, u(1.3, 1.5), expected)


def trash_can(u: Draw) -> Object:
    w, d, h = u(0.2, 0.4), u(0.2, 0.35), u(0.35, 0.75)
    words = ("trash_can_lid", "lid", "Muelleimer_Deckel", "couvercle_poubelle", "tapa")
    expected = {"opens": "+", "half": "closes", "shut": True, "force": (0.5, 30)}
    out = lidded(u, "TrashCan", w, d, h, 0.012, words, u(0.3, 0.8), u(1.2, 1.5), expected)
    if u.maybe():
        geoms = [box(0.08, 0.1, 0.012, (0, -0.05, 0))]
        out.joints.append(
            Joint("pedal", ("pedal", "foot_pedal", "Trethebel", "pedale"), "revolute",
                  (0, -d / 2 + 0.02, 0.035), LEVEL, (0, u(0.15, 0.3)), geoms, 0.15, 0.1,
                  {"half": "closes", "force": (2, 60)})
        )  # fmt: skip
    return out


def toilet(u: Draw) -> Object:
    w, d, h = u(0.34, 0.4), u(0.38, 0.46), u(0.36, 0.42)
    t = 0.05
    base = [
        box(t, d, h, (-w / 2 + t / 2, 0, h / 2)),
        box(t, d, h, (w / 2 - t / 2, 0, h / 2)),
        box(w, t, h, (0, d / 2 - t / 2, h / 2)),
        box(w, t, h, (0, -d / 2 + t / 2, h / 2)),
        box(w, d, 0.2, (0, 0, 0.1)),
        box(w + 0.05, 0.18, 0.4, (0, d / 2 + 0.12, h + 0.15)),
    ]
    out = Object("Toilet", base)
    ring = [
        box(0.07, d, 0.02, (-w / 2 + 0.035, -d / 2, 0.01)),
        box(0.07, d, 0.02, (w / 2 - 0.035, -d / 2, 0.01)),
        box(w - 0.14, 0.08, 0.02, (0, -d + 0.04, 0.01)),
        box(w - 0.14, 0.08, 0.02, (0, -0.04, 0.01)),
    ]
    expected = {"opens": "+", "half": "closes", "force": (2, 30)}
    for part, words, geoms, z, mass in (
        ("toilet seat", ("toilet_seat", "seat", "Klobrille", "asiento"), ring, h, u(1, 1.6)),
        ("toilet lid", ("toilet_lid", "lid", "Klodeckel", "abattant"),
         [box(w, d, 0.015, (0, -d / 2, 0.0075))], h + 0.021, u(1, 1.8)),
    ):  # fmt: skip
        out.joints.append(
            Joint(part, words, "revolute", (0, d / 2, z), (-1, 0, 0), (0, u(1.35, 1.5)), geoms,
                  mass, d, expected)
        )  # fmt: skip
    return out


def room_door(u: Draw) -> Object:
    w, h, t = u(0.75, 0.95), u(1.95, 2.15), 0.06
    out = Object("Door", [g for g in frame(w + 2 * t, h + 2 * t, t, 0.1, -t) if g[2][2] > 0.1])
    words = ("door", "room_door", "Zimmertuer", "porte", "puerta", "porta")
    expected = {"opens": "+", "half": "stays", "force": (0.5, 30)}
    right = u.maybe()
    door = side_door(u, 0, w, h - 0.01, 0.005, -0.02, 0.04, right, "room door", words, expected,
                     450, handle=False)  # fmt: skip
    out.joints.append(door)
    side = -1.0 if right else 1.0
    long = u(0.1, 0.14)
    geoms = [
        rod(0.01, 0.05, (0, -0.025, 0), "y"),
        box(long, 0.015, 0.018, (-side * (long / 2 - 0.01), -0.055, 0)),
    ]
    down = (0, -side, 0)
    out.joints.append(
        Joint("door lever", ("door_handle", "lever", "Tuerklinke", "poignee", "manija", "latch"),
              "revolute", (side * (w - 0.07), -0.04, 1.05 - h / 2), down, (0, u(0.6, 1.0)), geoms,
              0.2, long, {"opens": "+", "half": "closes", "force": (2, 23)}, parent=0)
    )  # fmt: skip
    return out


def light_switch(u: Draw) -> Object:
    n = u.some(1, 3)
    pitch = u(0.03, 0.05)
    out = Object("Switch", [box(0.05 + n * pitch, 0.01, 0.085, (0, 0.005, 0))])
    words = ("switch", "rocker", "light_switch", "Lichtschalter", "interrupteur", "interruptor")
    tall, thick = u(0.035, 0.06), u(0.008, 0.014)
    for k in range(n):
        geoms = [box(pitch * 0.85, thick, tall, (0, -thick / 2, 0))]
        half = u(0.1, 0.22)
        out.joints.append(
            Joint("rocker", words, "revolute", ((k - (n - 1) / 2) * pitch, 0, 0), LEVEL,
                  (-half, half), geoms, u(0.005, 0.02), tall / 2,
                  {"sides": True, "force": (1, 15)})
        )  # fmt: skip
    return out


def fan(u: Draw) -> Object:
    h, r = u(0.3, 1.2), u(0.12, 0.25)
    out = Object("Fan", [box(0.25, 0.2, 0.03, (0, 0, 0.015)), rod(0.02, h, (0, 0.08, h / 2)),
                         rod(0.05, 0.1, (0, 0.05, h), "y")])  # fmt: skip
    hub = rod(0.03, 0.03, (0, -0.015, 0), "y")
    geoms = [hub, box(2 * r, 0.01, 0.09, (0, -0.02, 0)), box(0.09, 0.01, 2 * r, (0, -0.02, 0))]
    words = ("fan_blade", "rotor", "Ventilator", "helice", "fan_rotor")
    out.joints.append(
        Joint("fan rotor", words, "revolute", (0, 0, h), (0, 1, 0), (-3.14, 3.14), geoms,
              u(0.2, 0.5), r, {"half": "stays", "force": (0, 2)})
    )  # fmt: skip
    return out


def lamp(u: Draw) -> Object:
    a, b = u(0.2, 0.4), u(0.2, 0.35)
    out = Object("Lamp", [rod(0.08, 0.03, (0, 0, 0.015)), rod(0.015, 0.05, (0, 0, 0.05))])
    words = ("lamp_arm", "arm", "Lampenarm", "bras_lampe", "brazo")
    expected = {"half": "stays", "force": (0.5, 30)}
    out.joints.append(
        Joint("lamp arm", words, "revolute", (0, 0, 0.08), LEVEL, (-u(0.7, 1.2), u(0.7, 1.2)),
              [rod(0.009, a, (0, 0, a / 2))], u(0.15, 0.4), a + b / 2, expected)
    )  # fmt: skip
    geoms = [rod(0.008, b, (0, -b / 2, 0), "y"), rod(0.05, 0.08, (0, -b, -0.02))]
    out.joints.append(
        Joint("lamp arm", words, "revolute", (0, 0, a), LEVEL, (-u(0.7, 1.2), u(0.7, 1.2)),
              geoms, u(0.2, 0.4), b, expected, parent=0)
    )  # fmt: skip
    return out


def swivel_chair(u: Draw) -> Object:
    out = Object("Chair", [rod(0.03, 0.4, (0, 0, 0.2)), box(0.6, 0.06, 0.05, (0, 0, 0.03)),
                           box(0.06, 0.6, 0.05, (0, 0, 0.03))])  # fmt: skip
    w = u(0.42, 0.52)
    geoms = [box(w, w, 0.06, (0, 0, 0.03)), box(w, 0.05, u(0.4, 0.6), (0, w / 2, 0.3))]
    words = ("chair_seat", "seat", "swivel", "Stuhl_Sitz", "siege_chaise")
    out.joints.append(
        Joint("swivel seat", words, "revolute", (0, 0, 0.4), UP, (-3.14, 3.14), geoms, u(4, 8),
              w / 2, {"half": "stays", "force": (0.5, 30)})
    )  # fmt: skip
    return out


def wheel(u: Draw) -> Object:
    r = u(0.05, 0.16)
    out = Object("Valve", [rod(0.03, 0.3, (0, 0.1, 0), "x"), rod(0.012, 0.1, (0, 0.05, 0), "y")])
    rim = [box(2 * r, 0.015, 0.02, (0, -0.01, s * r)) for s in (-1, 1)]
    rim += [box(0.02, 0.015, 2 * r, (s * r, -0.01, 0)) for s in (-1, 1)]
    rim += [box(2 * r, 0.012, 0.016, (0, -0.01, 0)), box(0.016, 0.012, 2 * r, (0, -0.01, 0))]
    words = ("valve_wheel", "handwheel", "Handrad", "volant", "valvula")
    out.joints.append(
        Joint("valve wheel", words, "revolute", (0, 0, 0), (0, 1, 0), (0, 6.28), rim, u(0.3, 1.2),
              r, {"half": "stays", "force": (2, 60)})
    )  # fmt: skip
    return out


def scissors(u: Draw) -> Object:
    long = u(0.14, 0.24)
    out = Object("Scissors", [box(long, 0.012, 0.003, (0, 0, 0.0015))])
    geoms = [box(long, 0.012, 0.003, (0, 0, 0.0015))]
    words = ("blade", "scissors_blade", "Schere_Klinge", "lame_ciseaux")
    out.joints.append(
        Joint("scissors blade", words, "revolute", (u(-0.02, 0.02), 0, 0.0035), UP,
              (0, u(0.6, 1.1)), geoms, u(0.02, 0.06), long / 2,
              {"half": "stays", "force": (0.3, 15)})
    )  # fmt: skip
    return out


def keyboard(u: Draw) -> Object:
    w, d = u(0.3, 0.45), u(0.11, 0.15)
    out = Object("Keyboard", [box(w, d, 0.015, (0, 0, 0.0075))])
    for k in range(u.some(2, 3)):
        geoms = [box(0.015, 0.015, 0.008, (0, 0, 0.004))]
        out.joints.append(
            Joint("key", BUTTON, "prismatic", (-0.05 + 0.02 * k, 0, 0.015), (0, 0, -1),
                  (0, u(0.002, 0.004)), geoms, 0.002, 1.0,
                  {"opens": "+", "half": "closes", "force": (0.25, 11)})
        )  # fmt: skip
    return out


def suitcase(u: Draw) -> Object:
    w, d, h = u(0.35, 0.5), u(0.2, 0.3), u(0.5, 0.75)
    out = Object("Suitcase", [box(w, d, h, (0, 0, h / 2))])
    long, wide = u(0.35, 0.45), u(0.14, 0.22)
    geoms = [rod(0.008, long, (s * wide / 2, 0, -long / 2)) for s in (-1, 1)]
    geoms.append(rod(0.012, wide, (0, 0, 0), "x"))
    words = ("telescopic_handle", "trolley_handle", "Teleskopgriff", "poignee_valise")
    out.joints.append(
        Joint("telescopic handle", words, "prismatic", (0, d / 2 - 0.02, h + 0.02), UP,
              (0, long * 0.9), geoms, u(0.3, 0.6), 1.0, {"half": "stays", "force": (2, 50)})
    )  # fmt: skip
    return out


def display(u: Draw) -> Object:
    w, h = u(0.4, 0.7), u(0.25, 0.4)
    stand = box(0.05, 0.02, 0.3, (0, 0.03, 0.16))
    out = Object("Display", [box(0.25, 0.2, 0.015, (0, 0, 0.0075)), stand])
    words = ("monitor", "screen", "display_tilt", "Bildschirm", "ecran")
    geoms = [box(w, 0.03, h, (0, -0.02, 0))]
    out.joints.append(
        Joint("monitor", words, "revolute", (0, 0, 0.3), LEVEL, (-0.15, u(0.3, 0.5)), geoms,
              u(2, 5), h / 2, {"half": "stays", "force": (1, 60)})
    )  # fmt: skip
    return out


def dispenser(u: Draw) -> Object:
    r, h = u(0.03, 0.045), u(0.1, 0.2)
    out = Object("Dispenser", [rod(r, h, (0, 0, h / 2)), rod(0.012, 0.02, (0, 0, h + 0.01))])
    geoms = [rod(0.006, 0.04, (0, 0, 0.02)), box(0.018, 0.06, 0.012, (0, -0.018, 0.045))]
    words = ("pump", "dispenser_pump", "Pumpe", "pompe", "push_button")
    out.joints.append(
        Joint("pump", words, "prismatic", (0, 0, h + 0.02), (0, 0, -1), (0, u(0.012, 0.025)),
              geoms, u(0.01, 0.02), 1.0, {"opens": "+", "half": "closes", "force": (2, 40)})
    )  # fmt: skip
    return out


def drop_front(u: Draw) -> Object:
    w, d, h = u(0.5, 0.9), u(0.28, 0.4), u(0.35, 0.5)
    out = Object("StorageFurniture", shell(w, d, h, 0.018, z=u(0.5, 1.2)))
    z = out.base[2][2][2] - 0.009
    words = ("flap", "cabinet_flap", "Klappe", "abattant", "drop_front")
    expected = {"opens": "+", "near": True, "shut": True, "half": "opens", "force": (3, 40)}
    out.joints.append(
        front_flap(u, w, h, z, -d / 2, 0.018, "drop front", words, expected, 600 * w * h * 0.018,
                   h - 0.04)
    )  # fmt: skip
    return out


def slider_cabinet(u: Draw) -> Object:
    w, d, h = u(0.8, 1.6), u(0.35, 0.6), u(0.6, 2.0)
    out = Object("StorageFurniture", shell(w, d, h, 0.02))
    words = ("sliding_door", "Schiebetuer", "porte_coulissante", "puerta_corredera")
    for k, y in enumerate((-d / 2 + 0.015, -d / 2 + 0.045)):
        side = -1 if k == 0 else 1
        geoms = [box(w / 2, 0.02, h - 0.06, (0, 0, 0))]
        out.joints.append(
            Joint("sliding door", words, "prismatic", (side * (w / 4 - 0.02), y, h / 2),
                  (-side, 0, 0), (0, w / 2 - 0.06), geoms, 12 * w / 2 * h, 1.0,
                  {"half": "stays", "force": (1, 50)})
        )  # fmt: skip
    return out


MAKERS: tuple[Callable[[Draw], Object], ...] = (
    cabinet, chest_of_drawers, oven, dishwasher, microwave, refrigerator, washing_machine, laptop,
    faucet, safe, window, chest, trash_can, toilet, room_door, light_switch, fan, lamp,
    swivel_chair, wheel, scissors, keyboard, suitcase, display, dispenser, drop_front,
    slider_cabinet,
)  # fmt: skip


def objects(seed: int, rounds: int = 2) -> list[Object]:
    """So many objects of each kind; a third of their joints turned round."""
    rng = np.random.default_rng(seed)
    out = []
    for _ in range(rounds):
        for maker in MAKERS:
            made = maker(Draw(rng))
            made.yaw = float(rng.uniform(-np.pi, np.pi))
            made.joints = [turned(j) if rng.random() < 0.33 else j for j in made.joints]
            out.append(made)
    return out


def turned(joint: Joint) -> Joint:
    """The same joint with q turned round."""
    joint.axis = tuple(-x for x in joint.axis)  # type: ignore[assignment]
    joint.limits = (-joint.limits[1], -joint.limits[0])
    if "opens" in joint.expected:
        joint.expected = {**joint.expected, "opens": "-"}
    return joint
