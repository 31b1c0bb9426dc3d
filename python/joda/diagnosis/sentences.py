"""Sentences of a verdict, what they say of filled in."""

TOO_SHORT = (
    "The measurements are too short, or their force is far too strong for the joint (see to its "
    "unit), to tell anything."
)
RECORD_MORE = (
    "Record more: move the joint through its whole range in both directions, slowly and fast, with "
    "the force if it can be measured, for some 20 s in all."
)
GAUGE_MORE = "Measure more: at some 20 places of the whole range or more, in both directions."
GAUGE_AGAIN = (
    "Measure the same again, and at places nearer together: what comes again is the joint's, what "
    "does not is the hand's or the gauge's."
)
GAUGE_BACK = "Measure the way back too, as slowly."
AGAIN = (
    "Repeat one slow motion three times, in both directions, then the same fast: if repeats "
    "differ, the effect has memory or changes with time; if fast and slow differ, it is a "
    "resistance; if neither, it is a force over position."
)
UNEVEN = (
    "Something is missing that no known effect explains: the force's error, {:.2g} {} RMS beside a "
    "noise of {:.2g}, is more than noise, or has a pattern that noise has not; a hand that "
    "trembles makes one too."
)
DRIFTING = (
    "Something is missing that no known effect explains: segments show nothing beyond the noise, "
    "but the free-run error is up to {:.0f} times what noise, initial state and force explain."
)
SLOWLY = (
    "Something is missing that no known effect explains: segments show nothing beyond the noise, "
    "but of runs in which no force acted as a whole more is left than noise makes, whatever the "
    "model's own strengths."
)
TOGETHER = (
    "Either the model's own numbers are off, or something is missing, and these runs cannot tell "
    "which: as it stands the model leaves more of whole unforced runs than noise makes, and with "
    "other numbers it would not."
)
WITH_THESE = "as it stands the model {}.{} With these there is {} that an effect would explain."
BEYOND_NOISE = "nothing beyond the noise ({:.2g} {})"
NUMBERS_OFF = " Its own numbers are off: {}.{}"
NONE_MISSING = "No effect is missing, but "
WHOLE = "has free-run errors of up to {:.0f} times the noise"
FREELY = "leaves more of whole unforced runs than noise makes"
WITHOUT = (
    " As it stands its free-run error is up to {:.0f} times the noise all the same, and with its "
    "numbers fitted up to {:.1f} times what noise, initial state and force explain; joda compare "
    "says where."
)
ADRIFT = (
    " But more is left of whole runs than noise of position and force makes: a small fault of the "
    "model, or what the force did between its samples."
)
AT_ENDS = (
    " From where the joint comes to an end of its range, the free-run error is up to {:.0f} "
    "times what noise, initial state and force explain, and {:.1f} times with other ends: {}; joda "
    "improve writes them."
)
BEYOND_ENDS = (
    "Something at the ends of the range is missing that no known effect explains: within it there "
    "is {}, but from where the joint comes to an end, the free-run error is up to {:.0f} times "
    "what noise, initial state and force explain, whatever the stops (solreflimit, solimplimit).{}"
)
AN_OFFSET = (
    " An offset of the recorded force would do the same: see whether the sensor reads zero where "
    "nothing pushes."
)
WHOLLY = " Segments show nothing of it; free runs do."
PRESS = (
    "Press the joint slowly against either end and let it go, and let it come there slowly and "
    "fast, with the force: that parts the stop from a force close to it."
)
EITHER = "Either the model's own numbers are off ({}), or a force is missing"
OUT_THERE = (
    "Something is missing, and what explains most of it would act at s = {:.2f} to {:.2f}, of "
    "which runs visited {:.0f} %: whether it does, these data cannot tell. It may be an obstacle, "
    "another end of the range, a latch, or nothing of the joint, such as a push that was not "
    "recorded."
)
NO_EFFECT = "Something is missing that no known effect explains."
