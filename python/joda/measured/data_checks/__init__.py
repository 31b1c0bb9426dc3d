"""What looks wrong in a measurement, each as a sentence for a person, before anything is fitted.

A check speaks only when it is sure: what good measurements do too (impacts, latches, noise, coarse
encoders, slow pulls) is no fault.
"""

from joda.measured.data_checks.base import DataCheck, Kind, suspect
from joda.measured.data_checks.clock import too_slow, wrong_clock
from joda.measured.data_checks.columns import counted, unread
from joda.measured.data_checks.energy import driven
from joda.measured.data_checks.force import balance_of_curve, balance_of_run, too_large, wrong_sign
from joda.measured.data_checks.position import coarse, hardly_moved, noise, placed, strays
from joda.measured.data_checks.timing import gapped, repeated, slowly_sampled, uneven
from joda.measured.data_checks.velocity import wrong_velocity
from joda.measured.runs import QuasiStatic, Run
from joda.measured.smoothing import resolution
from joda.scenes.context import Context

MIN_RUN, MIN_CURVE = 20, 5
"""Fewest samples of which anything can be told."""


def data_checks(run: Run | QuasiStatic, context: Context) -> list[DataCheck]:
    """What looks wrong in a measurement of a joint.

    Args:
        run: a timed run or a quasi-static curve.
        context: of the joint; its range, inertia and gravity are compared with the measurement.

    Returns:
        what looks wrong; none where nothing looks wrong.
    """
    timed, unit = isinstance(run, Run), context.joint.unit
    n, least = len(run.position), MIN_RUN if timed else MIN_CURVE
    if n < least:
        told = f"{n} samples are not enough to tell anything; record at least {least}"
        return [suspect(run, "short", told)]
    if isinstance(run, Run) and (told := wrong_clock(run)):
        return [suspect(run, "clock", told)]
    if told := too_large(run, context):
        return [suspect(run, "force_size", told)]
    found, position = placed(run, context)
    step, sigma = resolution(position), noise(run, position)
    sentences: dict[Kind, str] = {"unread": unread(run)}
    if isinstance(run, Run):
        sentences["stray"], position = strays(run, position, sigma, unit)
    if still := hardly_moved(position, context, step, sigma):
        sentences |= {"still": still}
    elif isinstance(run, Run):
        sentences |= {
            "origin": counted(run),
            "clock": too_slow(run, position, context),
            "resolution": coarse(position, step, sigma, unit),
            "uneven_time": uneven(run),
            "gap": gapped(run),
            "stale": repeated(run, position, step),
            "slow_sampling": slowly_sampled(run, position, step, unit),
            "velocity": wrong_velocity(run, position, unit),
            "force_sign": wrong_sign(balance_of_run(run, position, sigma, context)),
            "driven": driven(run, position, sigma, unit),
        }
    else:
        sentences |= {"force_sign": wrong_sign(balance_of_curve(run, position))}
    return found + [suspect(run, kind, told) for kind, told in sentences.items() if told]
