"""What is wrong with what is recorded: the force's scale, offset and clock, the encoder's zero."""

from dataclasses import dataclass, replace

import numpy as np

from joda.measured.runs import Run


@dataclass(frozen=True)
class Instrument:
    """What is true of what is logged: force(t + delay) = scale logged(t) + offset, and the
    position is the logged one less the zero.

    Attributes:
        scale: true force over logged force.
        offset: N·m or N.
        delay: by how much later the logged force acts, s.
        zero: of the encoder, rad or m.
    """

    scale: float = 1.0
    offset: float = 0.0
    delay: float = 0.0
    zero: float = 0.0

    def logged(self, run: Run) -> Run:
        """A run that has the true position at each time, and the force that acts later then."""
        return replace(
            run,
            position=run.position + self.zero,
            force=(run.force - self.offset) / self.scale if run.forced else run.force,
        )

    @property
    def wrong(self) -> dict[str, float]:
        """What is not as it should be, by the names of a diagnosis' corrections."""
        numbers = {
            "force_scale": (self.scale, 1.0),
            "force_offset": (self.offset, 0.0),
            "time_delay": (self.delay, 0.0),
            "position_offset": (self.zero, 0.0),
        }
        return {name: value for name, (value, right) in numbers.items() if value != right}


TRUE = Instrument()
"""One that logs what is."""


def drawn(rng: np.random.Generator, force: float, span: float, often: float) -> Instrument:
    """An instrument of which each number is wrong so often.

    Args:
        rng: of the draw.
        force: natural size of the joint's forces, N·m or N.
        span: of its range, rad or m.
        often: probability.
    """
    scale, offset, delay, zero = rng.random(4) < often
    low, high = np.log([0.5, 1.6])
    return Instrument(
        scale=float(np.exp(rng.uniform(low, high))) if scale else 1.0,
        offset=float(rng.choice([-1, 1]) * rng.uniform(0.02, 0.1) * force) if offset else 0.0,
        delay=float(rng.uniform(0.005, 0.04)) if delay else 0.0,
        zero=float(rng.choice([-1, 1]) * rng.uniform(0.01, 0.03) * span) if zero else 0.0,
    )
