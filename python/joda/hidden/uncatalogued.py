"""Effects that no catalogue has."""

import numpy as np

from joda.hidden import friction_laws, laws, truth, uncatalogued_laws
from joda.hidden.sampler import Builder, Hidden, Sampler, everywhere


def _relaxation(sampler: Sampler) -> Hidden:
    force, joint = sampler.force(0.3, 1.0), sampler.joint
    law = truth.Maxwell(2 * force / joint.span, sampler.between(0.15, 0.6) * joint.time)
    return everywhere(law, law.stiffness, sampler.unit("1"))


def _ageing(sampler: Sampler) -> Hidden:
    force, joint = sampler.force(0.2, 0.6), sampler.joint
    law = truth.Ageing(
        force, sampler.between(0.05, 0.2) * joint.time, sampler.between(0.005, 0.02) * joint.span
    )
    return everywhere(law, force, sampler.unit())


def _warming(sampler: Sampler) -> Hidden:
    time = sampler.between(0.8, 2.0) * sampler.joint.time
    if sampler.chance():
        force = sampler.force(0.2, 0.6)
        return everywhere(friction_laws.WarmingFriction(force, 0.0, time), force, sampler.unit())
    size = sampler.damping(0.3, 0.8)
    return everywhere(friction_laws.WarmingFriction(0.0, size, time), size, sampler.unit("s"))


def _cogging(sampler: Sampler) -> Hidden:
    force = sampler.force(0.15, 0.6)
    law = laws.Ripple(force, sampler.between(6, 12), sampler.between(0, 2 * np.pi))
    return everywhere(law, force, sampler.unit())


def _root(sampler: Sampler) -> Hidden:
    size = sampler.force(0.2, 0.6) * (sampler.joint.time / sampler.joint.span) ** 0.5
    return everywhere(friction_laws.RootDamping(size), size, f"{sampler.unit()}·(s/x)^½")


def _delay(sampler: Sampler) -> Hidden:
    time = sampler.between(0.03, 0.08)
    return everywhere(truth.Delay(time), time, "s")


def _shaking(sampler: Sampler) -> Hidden:
    force = sampler.force(0.2, 0.5)
    return everywhere(
        laws.Shaking(force, sampler.between(0.8, 2.5) / sampler.joint.time), force, sampler.unit()
    )


def _cable(sampler: Sampler) -> Hidden:
    force, taut = sampler.force(0.3, 0.8), sampler.between(0.2, 0.5)
    law = truth.Cable(
        force, taut, sampler.between(0.1, 0.25), sampler.between(0.5, 1.5) * sampler.joint.time
    )
    return Hidden((law,), (taut, 1.0), force, sampler.unit(), "positive")


def _fading(sampler: Sampler) -> Hidden:
    force, joint = sampler.force(0.3, 0.8), sampler.joint
    periods, phase = sampler.between(3, 6), sampler.between(0, 2 * np.pi)
    velocity = sampler.between(0.3, 0.8) * joint.span / joint.time
    return everywhere(
        uncatalogued_laws.FadingWave(force, periods, phase, velocity), force, sampler.unit()
    )


def _drift(sampler: Sampler) -> Hidden:
    force = sampler.force(0.2, 0.5)
    law = uncatalogued_laws.Drift(
        sampler.way() * force, sampler.between(0.8, 2.5) * sampler.joint.time
    )
    return everywhere(law, force, sampler.unit())


def _tremor(sampler: Sampler) -> Hidden:
    force, count = sampler.force(0.15, 0.4), 7
    frequencies = tuple(sampler.between(0.3, 3.0) / sampler.joint.time for _ in range(count))
    phases = tuple(sampler.between(0, 2 * np.pi) for _ in range(count))
    return everywhere(uncatalogued_laws.Tremor(force, frequencies, phases), force, sampler.unit())


def _ratchet(sampler: Sampler) -> Hidden:
    force, way = sampler.force(0.3, 0.7), sampler.way()
    law = uncatalogued_laws.Ratchet(force, sampler.between(6, 14), way)
    return everywhere(law, force, sampler.unit(), way)


UNCATALOGUED: dict[str, Builder] = {
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
