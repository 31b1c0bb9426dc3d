"""What asking a model for proposals will cost, before anything is asked."""

from collections.abc import Sequence
from pathlib import Path

from joda.component import Frozen
from joda.propose import BatchProposer, Proposer, Task, Usage, total
from joda.propose.asking import Effort, VisionModel
from joda.propose.batch import HALF
from joda.propose.generation import ROUNDS, check_rounds, choose
from joda.propose.joints import find_jobs, only_joint
from joda.propose.session import PICTURES
from joda.scenes.context import context
from joda.template import read_templates


class Estimate(Frozen):
    """What a generation will about cost.

    Attributes:
        proposer: who would be asked.
        joints: of how many.
        least, most: if the first proposal of each is complete, and if all rounds are needed.
    """

    proposer: str
    joints: int
    least: Usage
    most: Usage


def estimate(
    model: str | Path,
    joint: str | None = None,
    output: str | Path = "",
    *,
    proposer: str | Path | Proposer | None = None,
    rounds: int = ROUNDS,
    describe: str = "",
    templates: Sequence[str | Path] = (),
    vlm: str | None = None,
    base_url: str | None = None,
    effort: Effort | None = None,
) -> Estimate | None:
    """Estimates what `joda.generate`, or `joda.generate_all` of a folder, will cost; asks nobody.

    Of a folder, its first joint stands for all; that what is fixed is cheaper from the cache is
    left out.

    Args:
        model: file, or folder of files.
        joint, proposer, rounds, describe, templates, vlm, base_url, effort: as for `joda.generate`.
        output: what will be generated; what is in there is no model.

    Returns:
        the estimate; None where the proposer costs nothing.

    Raises:
        JodaError: as `joda.generate`.
    """
    check_rounds(rounds)
    source, chosen = Path(model), choose(proposer, "", vlm, base_url, effort)
    if not isinstance(chosen, VisionModel):
        return None
    if source.is_dir():
        jobs, _ = find_jobs(source, Path(output or source / "joda"), joint)
        first = next(iter(jobs.values()))
        path, name, count = first.model, first.joint, len(jobs)
    else:
        path, name, count = source, joint if joint is not None else only_joint(source), 1
    task = Task(
        context(path, name),
        read_templates([Path(folder) for folder in templates]),
        [_blank()] * PICTURES.number,
        describe,
    )
    batched = source.is_dir() and isinstance(chosen, BatchProposer)
    least, most = (
        total([chosen.estimate(task, k, HALF if batched else 1.0)] * count) for k in (1, rounds)
    )
    return Estimate(proposer=chosen.name, joints=count, least=least, most=most)


def _blank() -> bytes:
    """A picture of the size of a joint's, which is what counts."""
    from io import BytesIO

    from PIL import Image

    out = BytesIO()
    Image.new("RGB", (960, 720)).save(out, format="PNG")
    return out.getvalue()
