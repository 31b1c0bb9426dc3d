"""Forms of effects that no catalogue has, beside those of `uncatalogued`."""

from joda.hidden import friction_laws, laws, masses, memory, truth
from joda.hidden.sampler import Hidden, Sampler, everywhere


def two_relaxations(sampler: Sampler) -> Hidden:
    """Two springs, each in series with a dashpot: one yields at once, one slowly."""
    force, joint = sampler.force(0.4, 1.2), sampler.joint
    quick, slow = (sampler.between(*lasts) * joint.time for lasts in ((0.08, 0.2), (0.4, 1.0)))
    stiffness = 2 * force / joint.span
    elements = (truth.Maxwell(1.5 * stiffness, quick), truth.Maxwell(stiffness, slow))
    return Hidden(elements, (0.0, 1.0), stiffness, sampler.unit("1"))


def switching(sampler: Sampler) -> Hidden:
    """A force that is periodic in time, and jumps."""
    force = sampler.force(0.2, 0.5)
    law = laws.Switching(force, sampler.between(0.5, 1.5) / sampler.joint.time)
    return everywhere(law, force, sampler.unit())


def governor(sampler: Sampler) -> Hidden:
    """A centrifugal brake."""
    force = sampler.force(0.3, 0.8)
    law = friction_laws.Governor(
        force, sampler.between(0.4, 0.8) * sampler.joint.span / sampler.joint.time
    )
    return everywhere(law, force, sampler.unit())


def sloshing(sampler: Sampler) -> Hidden:
    """A load that swings on the joint."""
    size = sampler.size(0.4, 1.0) * sampler.joint.inertia
    frequency = sampler.between(5, 14) / sampler.joint.time
    law = masses.Attached(size, size * frequency**2, 2 * 0.05 * size * frequency)
    return everywhere(law, size, "kg·m²" if sampler.joint.kind == "hinge" else "kg")


def cushion(sampler: Sampler) -> Hidden:
    """Air that is caught before the high end, and leaks."""
    begin, force = sampler.between(0.2, 0.55), sampler.force(0.6, 1.5)
    stiffness = force / ((1 - begin) * sampler.joint.span)
    law = memory.Cushion(stiffness, begin, sampler.between(0.5, 1.5) * sampler.joint.time)
    return Hidden((law,), (begin, 1.0), stiffness, sampler.unit("1"), "positive")


def lost_motion(sampler: Sampler) -> Hidden:
    """A damper behind a play."""
    size = sampler.damping(0.4, 1.0)
    law = memory.LostMotion(size, sampler.between(0.2, 0.5) * sampler.joint.span)
    return everywhere(law, size, sampler.unit("s"))


def running_in(sampler: Sampler) -> Hidden:
    """Friction that goes with the way made."""
    force = sampler.force(0.3, 0.8)
    law = memory.RunningIn(force, float(sampler.between(0.8, 2.5) * sampler.joint.span))
    return everywhere(law, force, sampler.unit())


def ageing(sampler: Sampler) -> Hidden:
    """Friction that grows at rest, over a longer time and with a longer slip."""
    force, joint = sampler.force(0.3, 0.7), sampler.joint
    time, slip = sampler.size(0.1, 0.5) * joint.time, sampler.size(0.01, 0.05) * joint.span
    return everywhere(truth.Ageing(force, time, slip), force, sampler.unit())
