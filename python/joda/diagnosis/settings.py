"""Every number that decides a diagnosis, each with its unit and meaning.

Those of the selection are calibrated on simulated joints that hide an effect, and judged on
families of these that were left out (`python tests/benchmarks calibrate ROWS`; docs/diagnose.md);
the others are set on the same joints, by what `python tests/benchmarks hidden` counts with them.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class SelectionSettings:
    """From what fits leave to probabilities; excesses are per sample, beyond what noise makes.

    Attributes:
        exponent: β.
        negligible_excess: excess that is never worth a word (per sample).
        same_loss: difference between two effects that does not tell them apart, of all n
            samples together (loss).
        min_gain: gain, less the price of its numbers, of an effect that is more than chance
            (loss).
        min_gain_per_sample: the same, per sample (loss per sample).
        share_in_noise: a where more than noise is left of all.
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
        held_out_left: part of an error held out that an effect leaves at most, where that
            must tell of it.
        held_out_noises: by which segments held out may be missed with what is said to be
            missing; or `held_out_share` (noises).
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
    """

    named: int = 5
    worth_naming: float = 0.01
    alternative_share: float = 0.35
    alike: float = 0.1
    something_else: float = 50.0
    held_out_left: float = 0.95
    held_out_noises: float = 10.0
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
    """

    max_multiple: float = 5.0
    said_multiple: float = 2.0
    drift_probability: float = 1e-4
    max_share: float = 0.5
    equal_loss: float = 9.0
    end_loss: float = 1.5
    end_numbers: int = 6
    end_visits: int = 2


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


@dataclass(frozen=True)
class Settings:
    """All of them.

    Attributes:
        selection: from what fits leave to probabilities.
        naming: which effects are named, and what the runs must show for that.
        whole_runs: what whole runs deny.
        corrections: which numbers of the model, the body and the measurement are off.
    """

    selection: SelectionSettings = SelectionSettings()
    naming: NamingSettings = NamingSettings()
    whole_runs: WholeRunSettings = WholeRunSettings()
    corrections: CorrectionSettings = CorrectionSettings()


SETTINGS = Settings()
