"""Effects that no catalogue has."""

import numpy as np

from joda.hidden import fleeting, laws, rubbing, truth
from joda.hidden.die import Builder, Die, Hidden, everywhere


def _relaxation(die: Die) -> Hidden:
    force, joint = die.force(0.3, 1.0), die.joint
    law = truth.Maxwell(2 * force / joint.span, die.between(0.15, 0.6) * joint.time)
    return everywhere(law, law.stiffness, die.unit("1"))


def _ageing(die: Die) -> Hidden:
    force, joint = die.force(0.2, 0.6), die.joint
    law = truth.Ageing(
        force, die.between(0.05, 0.2) * joint.time, die.between(0.005, 0.02) * joint.span
    )
    return everywhere(law, force, die.unit())


def _warming(die: Die) -> Hidden:
    time = die.between(0.8, 2.0) * die.joint.time
    if die.chance():
        force = die.force(0.2, 0.6)
        return everywhere(rubbing.Cold(force, 0.0, time), force, die.unit())
    size = die.damping(0.3, 0.8)
    return everywhere(rubbing.Cold(0.0, size, time), size, die.unit("s"))


def _cogging(die: Die) -> Hidden:
    force = die.force(0.15, 0.6)
    law = laws.Ripple(force, die.between(6, 12), die.between(0, 2 * np.pi))
    return everywhere(law, force, die.unit())


def _root(die: Die) -> Hidden:
    size = die.force(0.2, 0.6) * (die.joint.time / die.joint.span) ** 0.5
    return everywhere(rubbing.RootDamping(size), size, f"{die.unit()}·(s/x)^½")


def _delay(die: Die) -> Hidden:
    time = die.between(0.03, 0.08)
    return everywhere(truth.Delay(time), time, "s")


def _shaking(die: Die) -> Hidden:
    force = die.force(0.2, 0.5)
    return everywhere(
        laws.Shaking(force, die.between(0.8, 2.5) / die.joint.time), force, die.unit()
    )


def _cable(die: Die) -> Hidden:
    force, taut = die.force(0.3, 0.8), die.between(0.2, 0.5)
    law = truth.Cable(force, taut, die.between(0.1, 0.25), die.between(0.5, 1.5) * die.joint.time)
    return Hidden((law,), (taut, 1.0), force, die.unit(), "positive")


def _fading(die: Die) -> Hidden:
    force, joint = die.force(0.3, 0.8), die.joint
    periods, phase = die.between(3, 6), die.between(0, 2 * np.pi)
    velocity = die.between(0.3, 0.8) * joint.span / joint.time
    return everywhere(fleeting.FadingWave(force, periods, phase, velocity), force, die.unit())


def _drift(die: Die) -> Hidden:
    force = die.force(0.2, 0.5)
    law = fleeting.Drift(die.way() * force, die.between(0.8, 2.5) * die.joint.time)
    return everywhere(law, force, die.unit())


def _tremor(die: Die) -> Hidden:
    force, count = die.force(0.15, 0.4), 7
    frequencies = tuple(die.between(0.3, 3.0) / die.joint.time for _ in range(count))
    phases = tuple(die.between(0, 2 * np.pi) for _ in range(count))
    return everywhere(fleeting.Tremor(force, frequencies, phases), force, die.unit())


def _ratchet(die: Die) -> Hidden:
    force, way = die.force(0.3, 0.7), die.way()
    law = fleeting.Ratchet(force, die.between(6, 14), way)
    return everywhere(law, force, die.unit(), way)


BEYOND: dict[str, Builder] = {
    "maxwell_relaxation": _relaxation,
    "friction_ageing": _ageing,
    "warming_up": _warming,
    "cogging": _cogging,
    "square_root_damping": _root,
    "actuation_delay": _delay,
    "periodic_disturbance": _shaking,
    "pulling_cable": _cable,
    "fading_detent": _fading,
    "temperature_drift": _drift,
    "tremor": _tremor,
    "ratchet": _ratchet,
}
