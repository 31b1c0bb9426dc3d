"""Forms of effects that no catalogue has, beside those of `outside`."""

from joda.hidden import laws, masses, memory, rubbing, truth
from joda.hidden.die import Die, Hidden, everywhere


def two_relaxations(die: Die) -> Hidden:
    """Two springs, each in series with a dashpot: one yields at once, one slowly."""
    force, joint = die.force(0.4, 1.2), die.joint
    quick, slow = (die.between(*lasts) * joint.time for lasts in ((0.08, 0.2), (0.4, 1.0)))
    stiffness = 2 * force / joint.span
    elements = (truth.Maxwell(1.5 * stiffness, quick), truth.Maxwell(stiffness, slow))
    return Hidden(elements, (0.0, 1.0), stiffness, die.unit("1"))


def switching(die: Die) -> Hidden:
    """A force that is periodic in time, and jumps."""
    force = die.force(0.2, 0.5)
    law = laws.Switching(force, die.between(0.5, 1.5) / die.joint.time)
    return everywhere(law, force, die.unit())


def governor(die: Die) -> Hidden:
    """A centrifugal brake."""
    force = die.force(0.3, 0.8)
    law = rubbing.Governor(force, die.between(0.4, 0.8) * die.joint.span / die.joint.time)
    return everywhere(law, force, die.unit())


def sloshing(die: Die) -> Hidden:
    """A load that swings on the joint."""
    size = die.size(0.4, 1.0) * die.joint.inertia
    frequency = die.between(5, 14) / die.joint.time
    law = masses.Attached(size, size * frequency**2, 2 * 0.05 * size * frequency)
    return everywhere(law, size, "kg·m²" if die.joint.kind == "hinge" else "kg")


def cushion(die: Die) -> Hidden:
    """Air that is caught before the high end, and leaks."""
    begin, force = die.between(0.2, 0.55), die.force(0.6, 1.5)
    stiffness = force / ((1 - begin) * die.joint.span)
    law = memory.Cushion(stiffness, begin, die.between(0.5, 1.5) * die.joint.time)
    return Hidden((law,), (begin, 1.0), stiffness, die.unit("1"), "positive")


def lost_motion(die: Die) -> Hidden:
    """A damper behind a play."""
    size = die.damping(0.4, 1.0)
    law = memory.LostMotion(size, die.between(0.2, 0.5) * die.joint.span)
    return everywhere(law, size, die.unit("s"))


def running_in(die: Die) -> Hidden:
    """Friction that goes with the way made."""
    force = die.force(0.3, 0.8)
    law = memory.RunningIn(force, float(die.between(0.8, 2.5) * die.joint.span))
    return everywhere(law, force, die.unit())


def ageing(die: Die) -> Hidden:
    """Friction that grows at rest, over a longer time and with a longer slip."""
    force, joint = die.force(0.3, 0.7), die.joint
    time, slip = die.size(0.1, 0.5) * joint.time, die.size(0.01, 0.05) * joint.span
    return everywhere(truth.Ageing(force, time, slip), force, die.unit())
