"""Every number that decides a diagnosis, each with its unit and meaning.

Those of the loss, the noise and how far a model's strengths may be off are the estimation's
(`joda.estimation`, `joda.measured`). What only costs time (grids, starts, iterations) stands beside
its algorithm; bounds and priors of an effect's numbers stand on its card or law.

Those of the selection are calibrated on simulated joints that hide an effect, and judged on
families of these that were left out (`python tests/benchmarks calibrate ROWS`; docs/diagnose.md);
the others are set on the same joints, by what `python tests/benchmarks hidden` counts with them.
"""

from dataclasses import dataclass
from math import log


@dataclass(frozen=True)
class SelectionSettings:
    """From what fits leave to probabilities; excesses are per sample, beyond what noise makes.

    Attributes:
        exponent: β, the power of the excess by which a probability falls.
        negligible_excess: excess that is never worth a word (per sample).
        same_loss: difference between two effects that does not tell them apart, of all n
            samples together (loss).
        min_gain: gain, less the price of its numbers, of an effect that is more than chance
            (loss).
        min_gain_per_sample: the same, per sample (loss per sample).
        share_in_noise: a where more than noise is left of all.
        min_share: part of e₀ that an unknown effect leaves at the least.
        unknown_share: part of e₀ that any true effect may leave, up to `unknown_excess`.
        unknown_excess: see there; noise is not known better (per sample).
        rival_share: part of the second's excess that an unknown one leaves at most.
        noise_stds: by how much noise may be more than it was estimated (standard
            deviations).
        min_probability: below this a small excess counts as adequate (probability).
        unexplained_excess: excess that is unexplained even if no effect lowers it (per
            sample).
        second_look: factor of u in a second look.
        longer_excess: excess of the model from which longer segments tell of effects (per
            sample).
        promising: of the best four effects together, from which on all are fitted to the
            end: in longer segments of what is unexplained, and beside numbers that may be
            off (probability).
        closer_weight: how many times as much as the look before a closer one is believed
            that contradicts it.
        few_segments: of so many, all of which leave no more than noise, the gain of the one
            that gains most does not count (segments).
        likely: above it an effect is more likely than not (probability).
        sure: above it neither a closer look is taken nor a further experiment proposed
            (probability).
        quiet_share: part of the segments, the better ones, that tell the noise.
        noise_square: mean square residual that noise may make.
        one_way: factor of u where the joint went one way only, which tells little.
        uneven_loss: beyond noise, from which it may be that a size differs along the way;
            more of many samples (loss).
    """

    exponent: float = 3.0
    negligible_excess: float = 0.05
    same_loss: float = 6.0
    min_gain: float = 60.0
    min_gain_per_sample: float = 0.02
    share_in_noise: float = 0.1
    min_share: float = 0.01
    unknown_share: float = 0.12
    unknown_excess: float = 0.12
    rival_share: float = 0.5
    noise_stds: float = 2.0
    min_probability: float = 0.1
    unexplained_excess: float = 0.5
    second_look: float = 0.7
    longer_excess: float = 0.1
    promising: float = 0.1
    closer_weight: float = 2.0
    few_segments: int = 8
    likely: float = 0.5
    sure: float = 0.9
    quiet_share: float = 0.3
    noise_square: float = 1.5
    one_way: float = 3.0
    uneven_loss: float = 20.0


@dataclass(frozen=True)
class NamingSettings:
    """Which effects are named, and what the runs must show for that.

    Attributes:
        named: how many are named at most (effects).
        worth_naming: of those that are (probability).
        alternative_share: part of the excess that an effect may leave that counts as an
            alternative.
        alike: by how much of the misfit two effects may differ that the data cannot tell
            apart.
        something_else: of the misfit that an effect may leave that is said to be missing
            with something else (%).
        held_out_alike: difference of the errors held out without an effect and with it, in those
            without, up to which the segments held out do not tell of it.
        held_out_left: part of an error held out that an effect leaves at most, where that
            must tell of it.
        held_out_noises: by which segments held out may be missed with what is said to be
            missing; or `held_out_share` (noises).
        held_out_segments: of fewer held out every one is held out of one of several fits instead
            (segments).
        held_out_share: of what they are missed by without it.
        shown_errors: of a mean square beyond noise, from which segments held out show
            anything (standard errors).
        force_times: how many times what the runs can need an effect's force may be at most.
        resistance_left: least part of the model's resistance that is left to a joint that
            no recorded force moves.
        visited_interval: least part of an effect's interval that runs must have visited.
        unseen_times: how many times what it is where runs were a curve may be where none
            was.
        no_force: of a curve's largest value: less is as good as nothing.
        motions: fewest segments with motion, or motions, that tell anything.
        motion_noises: what is a motion (noises).
        visited_range: least part of the range that must be visited.
        no_size: size of an effect up to which it is none; that of one which is seen from afar only
            is a thirtieth (standard errors).
        felt_force: part of its largest force from which a force is felt: where an effect that runs
            out slowly ends.
        min_rise: part of its rise above its least value from which a free curve acts.
        whole_range: part of the range from which on a resistance is called constant.
        min_variation: how much a curve varies at least that differs along the way (its mean).
        level_deviation: by how much it is off its median where it is level (that).
        reversal_noises: by how much a joint must come back to have been moved both ways (noises).
        surest: highest probability that is said (probability).
    """

    named: int = 5
    worth_naming: float = 0.01
    alternative_share: float = 0.35
    alike: float = 0.1
    something_else: float = 50.0
    held_out_alike: float = 0.02
    held_out_left: float = 0.95
    held_out_noises: float = 10.0
    held_out_segments: int = 6
    held_out_share: float = 0.1
    shown_errors: float = 3.0
    force_times: float = 10.0
    resistance_left: float = 0.2
    visited_interval: float = 0.25
    unseen_times: float = 3.0
    no_force: float = 0.1
    motions: int = 4
    motion_noises: float = 8.0
    visited_range: float = 0.02
    no_size: float = 0.025
    felt_force: float = 0.2
    min_rise: float = 0.1
    whole_range: float = 0.8
    min_variation: float = 0.5
    level_deviation: float = 0.25
    reversal_noises: float = 6.0
    surest: float = 0.99


@dataclass(frozen=True)
class WholeRunSettings:
    """What whole runs deny.

    Attributes:
        max_multiple: how many times what errors explain of it a model that is adequate may
            miss a whole run by.
        said_multiple: the same, from which that is said where segments alone are adequate.
        drift_probability: for a model that lacks nothing, of a drift of free runs as clear
            as one that counts: two simulators differ a little (probability).
        max_share: part of what whole runs are missed by that an effect may leave to be
            worth a word.
        equal_loss: by which fits to whole runs differ that are as good (loss).
        end_loss: of the visits to the ends, from which one may have a stop of its own (loss
            per sample).
        end_numbers: how many numbers that costs.
        end_visits: fewest to an end that tell of it (visits).
        before_end: part of a run's travel that must lie before it meets an end, for that to tell of
            the joint.
        free_share: part of all samples that free runs must hold, before an end, to tell of all.
        simulators_apart: part of a strength by which another simulator's may differ.
        parted: how many times more than segments whole runs must be missed by to have parted from
            what was measured.
    """

    max_multiple: float = 5.0
    said_multiple: float = 2.0
    drift_probability: float = 1e-4
    max_share: float = 0.5
    equal_loss: float = 9.0
    end_loss: float = 1.5
    end_numbers: int = 6
    end_visits: int = 2
    before_end: float = 0.3
    free_share: float = 0.9
    simulators_apart: float = 5e-3
    parted: float = 5.0


@dataclass(frozen=True)
class CorrectionSettings:
    """Which numbers of the model, the body and the measurement are off.

    Attributes:
        min_off: by how much a number of the model must be off to be worth a word.
        min_off_beside: the same where something else is missing.
        min_errors: and by how many of these (standard errors).
        one_factor: by how much factors may differ that are one.
        slow_delay: a delay of commands of which a part counts as the same part of another
            number does (s).
        untold_width: how far off a number may be of which the data tell nothing (own unit).
        body_gain: gain, less the price of its numbers, from which numbers of body and
            measurement are worth a word (loss).
        number_loss: that a number must spare to be free beside the others (loss).
        tried_loss: a number is tried without that seems to spare at most so many times that
            and what the least needed one seems to spare.
        equal_numbers: up to which data cannot tell one number from another, nor from an
            effect (loss).
        max_loss_share: part of the loss that all numbers together leave at most; of what is
            beyond noise, where effects were looked for too.
        calm_excess: what numbers leave that explain all there is; or `calm_share` (per
            sample).
        calm_share: of the model's excess.
        body_errors: by the data alone, that a number of body or measurement is off by at
            the least (standard errors).
        surprising: a number may be off where something is left: a zero that is far off
            looks like a force beside a spring (widths).
        unusual: the same where an effect explains as much in its place (widths).
        usual_spread: how far numbers of models usually are off (standard deviation of a factor's
            logarithm).
        as_often: how many times as often they are as the inertia is, and they are not.
    """

    min_off: float = 0.05
    min_off_beside: float = 0.3
    min_errors: float = 3.0
    one_factor: float = 0.12
    slow_delay: float = 0.02
    untold_width: float = 10.0
    body_gain: float = 40.0
    number_loss: float = 25.0
    tried_loss: float = 3.0
    equal_numbers: float = 9.0
    max_loss_share: float = 0.5
    calm_excess: float = 0.05
    calm_share: float = 0.02
    body_errors: float = 3.0
    surprising: float = 4.0
    unusual: float = 2.0
    usual_spread: float = 0.3
    as_often: float = 10.0


@dataclass(frozen=True)
class ToleranceSettings:
    """How well the law of an effect is known, and how often it is met.

    Attributes:
        known_law: part of the model's excess that the true effect may leave, of a known law.
        free_curve: the same of a curve with few control points.
        known_shape: the same of a curve of which only the rough shape is known.
        rare: how much rarer magnets, latches and clicks are than what rubs in every joint, and than
            a tilt is a constant force all over a slide's range (twice a negative log-prior).
    """

    known_law: float = 0.01
    free_curve: float = 0.12
    known_shape: float = 0.2
    rare: float = 3.0


@dataclass(frozen=True)
class SearchSettings:
    """Which effects are fitted to the end, and what tells of them at all.

    Attributes:
        noise_loss: that only noise leaves at most: nothing more can be found (loss per sample).
        far_loss: how many times the least loss a rough fit leaves that is not fitted further, where
            one leaves only noise.
        near_loss: how many times the least loss an effect leaves whose numbers are tried elsewhere.
        rough_gain: of a rough fit, from which on something may come of it where the model itself
            leaves only noise (loss).
        smooth_gain: from which segments without impacts tell of an effect (loss).
        smooth_gain_per_sample: the same, per sample (loss per sample).
        stand_in: how far off a factor of the model's own strengths is that may stand in for what is
            missing.
        equal_loss: how much more of it is as good a fit (loss).
        uneven_share: part of the loss beyond noise, at most, that a size which differs along the
            way leaves.
        no_strength: part of its step below which a strength is none.
        stepping_gain: from which runs tell that MuJoCo made them, in its steps or with a friction
            that yields as its own does (loss).
        stepping_excess: what that leaves at most beyond noise (per sample).
        runaway: what the best effect leaves at the least, for all to be asked in shorter segments
            (per sample).
        stepping_tried: what a first fit in such steps leaves at most, for more of them to be made
            (per sample).
        shorter: how much shorter segments are in which what is unexplained is asked again.
        confirmed_in: how much longer than these those are in which what they tell must hold.
        confirmed_last: the same, of those in which it must hold last.
        most_missed: how many segments that are missed most, and how many others, are asked there
            (segments).
    """

    noise_loss: float = 1.5
    far_loss: float = 5.0
    near_loss: float = 3.0
    rough_gain: float = 20.0
    smooth_gain: float = 60.0
    smooth_gain_per_sample: float = 0.1
    stand_in: float = 0.1
    equal_loss: float = 1.0
    uneven_share: float = 0.5
    no_strength: float = 0.1
    stepping_gain: float = 10.0
    stepping_excess: float = 0.1
    stepping_tried: float = 1.0
    runaway: float = 1.0
    shorter: float = 9.0
    confirmed_in: float = 2.0
    confirmed_last: float = 3.0
    most_missed: int = 50


@dataclass(frozen=True)
class ImpactSettings:
    """Which ends throw the joint back more than the model's.

    Attributes:
        min_impacts: fewest at an end whose speeds tell of it (impacts).
        min_restitution: how much more of its speed an end must throw back than the model's.
        min_gain: of a bouncier end that is more than chance (loss).
        min_share: least part of the loss that it must explain.
    """

    min_impacts: int = 2
    min_restitution: float = 0.07
    min_gain: float = 60.0
    min_share: float = 0.35


@dataclass(frozen=True)
class ErrorSettings:
    """How far a size and an interval may be off; calibrated by `python tests/benchmarks hidden
    cover` (docs/reliability.md).

    Attributes:
        known_law: part of its size by which an effect may differ from its law, of a known one.
        free_curve: the same of a curve with few control points.
        known_shape: the same of a curve of which only the rough shape is known.
        rise: of the loss, from which numbers are no longer as good: two standard deviations
            (overdispersions).
        definition: by which what counts as the end of an interval may differ (its width).
        tolerated: part of what an effect explains that another law of its shape may fail to.
        hidden: part of the size that may hide in what is left of the misfit, by the root of its
            share for each part that is not left.
        farthest: largest error of what is there, or is extrapolated: nothing is known of how large
            it is (the size).
        reaching: part of the range over which a pull to an end is felt that is more than a local
            one's.
        from_afar: its error then, as that may be the far end of a much stronger one (the size).
        stretched: error of an extrapolated effect's ends, by that of its size (the width).
        plausible: how much larger a strength may be than the effect's largest, a priori (standard
            deviation).
        at_end: error of the place of an end that throws back, normalised.
        clearly_visited: how far within what was visited an end must be to be clearly there,
            normalised.
        unvisited_samples: part of the samples at either end of what was visited that do not count
            as visited.
        unknown_end: error of an interval's end of which nothing tells, normalised.
    """

    known_law: float = 0.01
    free_curve: float = 0.07
    known_shape: float = 0.05
    rise: float = 4.0
    definition: float = 0.08
    tolerated: float = 0.02
    hidden: float = 0.5
    farthest: float = 10.0
    reaching: float = 0.5
    from_afar: float = 30.0
    stretched: float = 0.125
    plausible: float = 2.0
    at_end: float = 0.02
    clearly_visited: float = 0.03
    unvisited_samples: float = 0.005
    unknown_end: float = 3**-0.5


@dataclass(frozen=True)
class AddingSettings:
    """What is added: runs held out of the fit must be clearly better with it.

    Attributes:
        chance: largest probability of as clear an improvement by chance (probability).
        changed: by how much a window's error must change to count (noises).
        min_segments: of fewer that change none may become worse, and all together must be better
            (segments).
        max_rise: how many times the geometric mean of the errors of whole runs may become.
        whole_run_fall: to what part that must fall, in every one, where segments are too short to
            show an effect.
        silent: error before, up to which what was held out tells nothing (noises).
        max_segment_error: part of the error before, and of the loss, to which an effect must bring
            held-out segments.
        likelier: how much less twice the negative log-likelihood of these must be: a model that was
            not fitted to data makes them 20 times likelier than the true one does in one of 20
            cases at most (2 ln 20).
        control_point: what one must gain, of twice the log-likelihood (Akaike 1974).
        factor_gain: the same of a size that is changed by a factor.
        model_error: how far off a number of the model as given may be (relative standard
            deviation).
        min_overlap: of where an effect acts and where it was diagnosed (intersection over union).
        max_effects: that `improve` adds (effects).
        max_tried: of one diagnosis, the likeliest first (effects).
        min_probability: of one that is tried besides the first (probability).
        max_error: part of the error held out to which a likely effect must bring it.
        max_error_unlikely: the same of one that is tried because nothing is likely, and the first
            did not.
        equal_error: how many times the error with an effect one may leave that is likelier, to take
            its place.
        whole_runs: fewest runs or curves of which some are held out whole; of fewer, parts of each
            (runs).
        shown: part of what the run that is missed most shows, of one that is to judge.
        blocks: fewest blocks in which the joint moves, of runs held out in parts (blocks).
    """

    chance: float = 0.05
    changed: float = 0.5
    min_segments: int = 5
    max_rise: float = 1.05
    whole_run_fall: float = 0.5
    silent: float = 1.1
    max_segment_error: float = 0.95
    likelier: float = 2 * log(20)
    control_point: float = 2.0
    factor_gain: float = 10.0
    model_error: float = 0.3
    min_overlap: float = 0.5
    max_effects: int = 5
    max_tried: int = 3
    min_probability: float = 0.1
    max_error: float = 0.95
    max_error_unlikely: float = 0.8
    equal_error: float = 1.05
    whole_runs: int = 4
    shown: float = 0.05
    blocks: int = 8


@dataclass(frozen=True)
class LearningSettings:
    """Which terms of a law without a name are learned, and which formula is told of it.

    Attributes:
        negligible_excess: beyond noise, that no term need explain (per sample).
        max_loss: part of the loss to which one of several more terms must bring runs held out: the
            best of many that say nothing brings it to less, too.
        directions_alike: correlation of the resistances of both directions that are one.
        formula_error: largest on runs held out with which a formula is told (the learned law's).
        term_spread: largest standard deviation of a factor over the ensemble of a stable term (the
            factor).
    """

    negligible_excess: float = 0.02
    max_loss: float = 0.9
    directions_alike: float = 0.8
    formula_error: float = 1.1
    term_spread: float = 1 / 3


@dataclass(frozen=True)
class Settings:
    """All of them.

    Attributes:
        selection: from what fits leave to probabilities.
        naming: which effects are named, and what the runs must show for that.
        whole_runs: what whole runs deny.
        corrections: which numbers of the model, the body and the measurement are off.
        tolerances: how well the law of an effect is known, and how often it is met.
        search: which effects are fitted to the end, and what tells of them at all.
        impacts: which ends throw the joint back more than the model's.
        errors: how far a size and an interval may be off.
        adding: what is added.
        learning: which terms of a law without a name are learned, and which formula is told.
    """

    selection: SelectionSettings = SelectionSettings()
    naming: NamingSettings = NamingSettings()
    whole_runs: WholeRunSettings = WholeRunSettings()
    corrections: CorrectionSettings = CorrectionSettings()
    tolerances: ToleranceSettings = ToleranceSettings()
    search: SearchSettings = SearchSettings()
    impacts: ImpactSettings = ImpactSettings()
    errors: ErrorSettings = ErrorSettings()
    adding: AddingSettings = AddingSettings()
    learning: LearningSettings = LearningSettings()


SETTINGS = Settings()
