// What the attribute "effects" may say, the sentence for each mistake, and the laws in closed form.
#include "effects.h"

#include <doctest/doctest.h>

#include <cmath>
#include <stdexcept>
#include <string>

namespace joda {
namespace {

const char* const kEvery =
    "stribeck_friction velocity=0.05 exponent=1: 0 1 | 0 1 | 0.4 0.4; "
    "quadratic_damping direction=both: 0 1 | 0 1 | 0.2 0.2;\n"
    "direction_dependent_damping direction=negative: 0 0.5 | 0 1 | 1 3; "
    "asymmetric_friction direction=positive: 0 1 | 0 1 | 0 2; "
    "presliding_friction breakaway=0.7 damping=0.5 stiffness=300; "
    "load_dependent_friction coefficient=0.1; gravity_offset sin=0.3 cos=-0.4; "
    "backlash play=0.01 inertia=0.002; added_inertia inertia=0.01; "
    "end_stop_restitution restitution=0.4 end=low;";

std::string Error(const std::string& text) {
  try {
    ParseEffects(text);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

TEST_CASE("every effect is parsed") {
  const Effects e = ParseEffects(kEvery);
  CHECK(e.stribeck.velocity == 0.05);
  CHECK(e.stribeck.exponent == 1);
  CHECK(e.stribeck.excess(0.5).value == 0.4);
  CHECK(e.quadratic.positive(0.5).value == 0.2);
  CHECK(e.quadratic.negative(0.5).value == 0.2);
  CHECK(e.damping.positive(0.25).value == 0);
  CHECK(e.damping.negative(0.25).value == 2);
  CHECK(e.damping.negative(0.75).value == 0);
  CHECK(e.asymmetry.positive(0.5).value == 1);
  CHECK(e.asymmetry.negative(0.5).value == 0);
  CHECK(e.presliding.stiffness == 300);
  CHECK(e.presliding.damping == 0.5);
  CHECK(e.presliding.breakaway == 0.7);
  CHECK(e.load == 0.1);
  CHECK(e.gravity.sin == 0.3);
  CHECK(e.gravity.cos == -0.4);
  CHECK(e.gravity.descent == doctest::Approx(0.5));
  CHECK(e.backlash.play == 0.01);
  CHECK(e.backlash.handle == 0.002);
  CHECK(e.backlash.load == 0);
  CHECK(e.added_inertia == 0.01);
  CHECK(Rebound(e.stops.low.value()) == doctest::Approx(0.4));
  CHECK(!e.stops.high);
  CHECK(std::string(e.needs_row) == "load_dependent_friction");
}

TEST_CASE("parameters that may be left out have their defaults") {
  CHECK(ParseEffects("stribeck_friction velocity=1: 0 1 | 0 1 | 1 1").stribeck.exponent == 2);
  const Effects e = ParseEffects("presliding_friction stiffness=1; gravity_offset sin=1");
  CHECK(e.presliding.damping == 0);
  CHECK(e.presliding.breakaway == 1);
  CHECK(e.gravity.cos == 0);
  const EndStops stops = ParseEffects("end_stop_restitution restitution=0.4").stops;
  CHECK(stops.both);
  CHECK(!stops.low);
  CHECK(!stops.high);
}

TEST_CASE("a blank text has no effects") {
  CHECK(std::string(ParseEffects(" \n").needs_row) == "");
  CHECK(ParseEffects("").backlash.play == 0);
}

TEST_CASE("an effect with a direction may be there once for each") {
  const Effects e = ParseEffects(
      "quadratic_damping direction=positive: 0 1 | 0 1 | 1 1;"
      "quadratic_damping direction=negative: 0 1 | 0 1 | 2 2");
  CHECK(ExtraDamping(e, 0.5, 3) == 3);
  CHECK(ExtraDamping(e, 0.5, -3) == 6);
}

TEST_CASE("each end of the range may have a restitution of its own") {
  const EndStops stops = ParseEffects(
                             "end_stop_restitution restitution=0.7 end=high;"
                             "end_stop_restitution end=low restitution=0.2")
                             .stops;
  CHECK(Rebound(stops.low.value()) == doctest::Approx(0.2));
  CHECK(Rebound(stops.high.value()) == doctest::Approx(0.7));
}

TEST_CASE("each mistake in the effects has its sentence") {
  CHECK(Error("added_inertia inertia=1; stribeck_friction velocity=-1: 0 1 | 0 1 | 1 1") ==
        "effect 2 \"stribeck_friction\": velocity must be positive");
  CHECK(Error("; added_inertia inertia=1") == "effect 1: expected the name of an effect, got \"\"");
  CHECK(Error("stribek velocity=1")
            .rfind("effect 1 \"stribek\": there is no such effect; there are "
                   "direction_dependent_damping, quadratic_damping, ",
                   0) == 0);
  CHECK(Error("backlash play=1 width=1") ==
        "effect 1 \"backlash\": unknown key \"width\"; its keys: play inertia side share");
  CHECK(Error("backlash play=1") == "effect 1 \"backlash\": inertia is missing");
  CHECK(Error("backlash play=1 play=1") == "effect 1 \"backlash\": play is given twice");
  CHECK(Error("backlash play 1") == "effect 1 \"backlash\": expected key=value, got \"play\"");
  CHECK(Error("backlash play=one inertia=1") ==
        "effect 1 \"backlash\": \"one\" is not a finite number");
  CHECK(Error("backlash play= inertia=1") ==
        "effect 1 \"backlash\": play must be one number, got \"\"");
  CHECK(Error("backlash play=1e16 inertia=1") ==
        "effect 1 \"backlash\": play must lie between -1e15 and 1e15");
  CHECK(Error("gravity_offset sin=1 force=1") ==
        "effect 1 \"gravity_offset\": it takes sin and cos for a hinge, or force for a slide");
}

TEST_CASE("each parameter out of bounds has its sentence") {
  CHECK(Error("stribeck_friction velocity=1 exponent=0: 0 1 | 0 1 | 1 1") ==
        "effect 1 \"stribeck_friction\": exponent must be positive");
  CHECK(Error("presliding_friction stiffness=0") ==
        "effect 1 \"presliding_friction\": stiffness must be positive");
  CHECK(Error("presliding_friction stiffness=1 damping=-1") ==
        "effect 1 \"presliding_friction\": damping must not be negative");
  CHECK(Error("presliding_friction stiffness=1 breakaway=1.5") ==
        "effect 1 \"presliding_friction\": breakaway must lie between 0 and 1");
  CHECK(Error("load_dependent_friction coefficient=-0.1") ==
        "effect 1 \"load_dependent_friction\": coefficient must not be negative");
  CHECK(Error("end_stop_restitution restitution=1") ==
        "effect 1 \"end_stop_restitution\": restitution must be less than 1");
  CHECK(Error("end_stop_restitution restitution=0.1 end=up") ==
        "effect 1 \"end_stop_restitution\": end must be low, high or both, got \"up\"");
  CHECK(Error("added_inertia inertia=0") == "effect 1 \"added_inertia\": inertia must be positive");
  CHECK(Error("quadratic_damping direction=up: 0 1 | 0 1 | 1 1") ==
        "effect 1 \"quadratic_damping\": direction must be positive, negative or both, got \"up\"");
  CHECK(Error("asymmetric_friction direction=both: 0 1 | 0 1 | 1 1") ==
        "effect 1 \"asymmetric_friction\": direction must be positive or negative, got \"both\"");
}

TEST_CASE("a curve is there exactly where the effect has one") {
  CHECK(Error("stribeck_friction velocity=1") ==
        "effect 1 \"stribeck_friction\": expected its curve, \": a b | x ... | y ...\", got \"\"");
  CHECK(Error("stribeck_friction velocity=1: 0 1 | 0 1 | 1 -1") ==
        "effect 1 \"stribeck_friction\": values of friction and damping must not be negative");
  CHECK(Error("added_inertia inertia=1: 0 1 | 0 1 | 1 1") ==
        "effect 1 \"added_inertia\": it has no curve, but a \":\" follows");
}

TEST_CASE("no effect is there twice") {
  CHECK(Error("added_inertia inertia=1; added_inertia inertia=2") ==
        "effect 2 \"added_inertia\": there are two of it");
  CHECK(Error("quadratic_damping direction=both: 0 1 | 0 1 | 1 1;"
              "quadratic_damping direction=negative: 0 1 | 0 1 | 1 1") ==
        "effect 2 \"quadratic_damping\": there are two of it for the negative direction");
  const std::string low = "end_stop_restitution restitution=0.1 end=low;";
  const std::string both = "end_stop_restitution restitution=0.1 end=both;";
  CHECK(Error(low + low) ==
        "effect 2 \"end_stop_restitution\": there are two of it at the low end");
  for (const std::string& two : {low + both, both + low, both + both}) {
    CHECK(Error(two) == "effect 2 \"end_stop_restitution\": one at both ends excludes another");
  }
}

TEST_CASE("an end stop throws back as a spring and a damper that only push do") {
  // Schwager and Poeschel, Granular Matter 9 (2007) 465
  const double w0 = std::sqrt(kStopStiffness);
  for (const double damping : {0.0, 0.01, 0.05, 0.1, 0.2}) {
    CAPTURE(damping);
    const double g = damping / 2, w = std::sqrt(w0 * w0 - g * g);
    const double exact = std::exp(-g / w * (std::acos(-1) - std::atan2(2 * g * w, w * w - g * g)));
    CHECK(Rebound(damping) == doctest::Approx(exact).epsilon(0.05));
  }
  for (const double restitution : {0.05, 0.3, 0.9, 0.9999}) {
    CHECK(Rebound(StopDamping(restitution)) == doctest::Approx(restitution).epsilon(1e-9));
  }
  CHECK(StopDamping(0) == 1);
}

TEST_CASE("damping depends on the direction and grows with the speed") {
  const Effects e = ParseEffects(
      "direction_dependent_damping direction=positive: 0 1 | 0 1 | 3 3;"
      "quadratic_damping direction=both: 0 1 | 0 1 | 0.5 0.5");
  CHECK(ExtraDamping(e, 0.5, 0) == 0);
  CHECK(ExtraDamping(e, 0.5, 4) == 3 + 0.5 * 4);
  CHECK(ExtraDamping(e, 0.5, -4) == 0.5 * 4);
}

TEST_CASE("Stribeck friction fades with the speed") {
  Stribeck stribeck = ParseEffects("stribeck_friction velocity=0.1: 0 1 | 0 1 | 2 2").stribeck;
  for (const double exponent : {2.0, 1.0, 0.5}) {
    CAPTURE(exponent);
    stribeck.exponent = exponent;
    CHECK(StribeckFriction(stribeck, 0.5, 0) == 2);
    CHECK(StribeckFriction(stribeck, 0.5, -0.1) == doctest::Approx(2 * std::exp(-1)));
    CHECK(StribeckFriction(stribeck, 0.5, 0.2) ==
          doctest::Approx(2 * std::exp(-std::pow(2, exponent))));
    CHECK(StribeckFriction(stribeck, 0.5, 1e300) == 0);
  }
}

TEST_CASE("friction grows with the load and with its direction") {
  const Effects e = ParseEffects(
      "load_dependent_friction coefficient=0.1;"
      "asymmetric_friction direction=negative: 0 1 | 0 1 | 0.5 0.5");
  const FrictionBounds bounds = FindFrictionBounds(e, 1, 0.5, 0, -20);
  CHECK(bounds.positive == 3);
  CHECK(bounds.negative == 3.5);
  CHECK(bounds.Bound() == 3.25);
  CHECK(bounds.Shift() - bounds.Bound() == -bounds.positive);
  CHECK(bounds.Shift() + bounds.Bound() == bounds.negative);
}

TEST_CASE("a Prandtl bristle is elastic up to the bound, a Dahl bristle gives gradually") {
  const Presliding prandtl = {300, 0, 1}, dahl = {300, 0, 0};
  CHECK(BristleStiffnessScale(prandtl, -1.99, 2, 1) == 1);
  CHECK(BristleStiffnessScale(prandtl, -2, 2, 1) == 1e-6);
  CHECK(BristleStiffnessScale(prandtl, -2, 2, -1) == 1);  // turning back
  CHECK(BristleStiffnessScale(prandtl, -2, 2, 0) == 1);
  CHECK(BristleStiffnessScale(prandtl, 0, 0, 1) == 1);
  CHECK(BristleStiffnessScale(dahl, -1, 2, 1) == 0.5);
  CHECK(BristleStiffnessScale(dahl, -1, 2, -1) == 1.5);
  CHECK(BristleStiffnessScale(dahl, 2, 2, 1) == 2);
}

TEST_CASE("the row of a bristle that slips, or is too stiff for the step, stays stiff") {
  CHECK(BristleStiffnessScaleInRow(1e-6, 0.01, 1, 1) == 1);
  CHECK(BristleStiffnessScaleInRow(0.01, 0.01, 1, 1) == 0.01);
  CHECK(BristleStiffnessScaleInRow(0.01, 0.01, 1e9, 1) == doctest::Approx(0.05).epsilon(1e-3));
  CHECK(BristleStiffnessScaleInRow(1.5, 0.01, 1e9, 1) == 1.5);
}

TEST_CASE("between break-away and the bound plasticity rises as half a sine") {
  CHECK(DupontAlpha(0.6, 0.6) == 0);
  CHECK(DupontAlpha(0.6, 0.7) == doctest::Approx(0.5 - std::sqrt(0.125)));
  CHECK(DupontAlpha(0.6, 0.8) == doctest::Approx(0.5));
  CHECK(DupontAlpha(0.6, 1) == 1);
  CHECK(DupontAlpha(0.6, -1) == 0);
  CHECK(DupontAlpha(1, 0.999) == 0);
  CHECK(DupontAlpha(1, 1) == 1);
}

TEST_CASE("the gravity offset is a sine of the position, or a force") {
  CHECK(GravityForce({0.3, -0.4, 0, 0.5}, 1.2) ==
        doctest::Approx(0.3 * std::sin(1.2) - 0.4 * std::cos(1.2)));
  CHECK(GravityForce({0, 0, 7, 0}, 1.2) == 7);
}

TEST_CASE("backlash is before the part, or behind it") {
  const Backlash behind = ParseEffects("backlash play=0.1 inertia=2 side=motor share=0.7").backlash;
  CHECK(behind.load == 2);
  CHECK(behind.handle == 0);
  CHECK(behind.share == 0.7);
  CHECK(ParseEffects("backlash play=0.1 inertia=2 side=load").backlash.handle == 2);
  CHECK(Error("backlash play=1 inertia=1 side=left") ==
        "effect 1 \"backlash\": side must be load or motor, got \"left\"");
  CHECK(Error("backlash play=1 inertia=1 side=motor share=1.1") ==
        "effect 1 \"backlash\": share must lie between 0 and 1");
  CHECK(Error("backlash play=1 inertia=1 share=0.5") ==
        "effect 1 \"backlash\": share is of what lies behind, where side=motor");
}

TEST_CASE("a load leaves the part its own inertia and resistance, and meets it with its momentum") {
  const Backlash backlash = {0.1, 0, 3, 0.75};
  const Resistance own = {2, {4, 6}};
  const Passage apart = Meet(backlash, 0.01, 4, 8, 1, own, 0, own, {0, -0.5});
  CHECK(apart.side == 0);
  CHECK(apart.scale == 4);
  CHECK(apart.On(own).drag == 2);
  CHECK(apart.On(own).dry.negative == 6);
  CHECK(apart.force == 0);
  // alone the load slows from 0.5, by 0.01 (3 + 1.5 v) / 3
  CHECK(apart.velocity == doctest::Approx((0.5 - 0.01) / 1.005));
  const Loose left = Settle(backlash, 0.01, apart, 1.2);
  CHECK(left.velocity == doctest::Approx(apart.velocity - 1.2));
  CHECK(left.gap == doctest::Approx(0.01 * left.velocity));
  const Passage met = Meet(backlash, 0.01, 4, 8, 1, own, 0, own, {-0.05, -0.5});
  CHECK(met.side == -1);
  CHECK(met.scale == 1);
  CHECK(met.On(own).drag == 2);
  CHECK(met.force == doctest::Approx(-3 * 0.5 / 0.01));
  const Loose along = Settle(backlash, 0.01, met, 0.625);
  CHECK(along.gap == -0.05);
  CHECK(along.velocity == 0);
  CHECK(Settle(backlash, 0.01, met, -0.1).velocity > 0.5);  // a stop has thrown the part back
  CHECK(Meet({0.1, 0, 5, 0}, 0.01, 4, 0, 0, own, 0, own, {}).scale ==
        doctest::Approx(1 / (1 - kHeaviestLoad)));
}

TEST_CASE("friction stops what coasts, and no more") {
  CHECK(Coast(2, 0.1, 0, {0, {4, 6}}, 1) == doctest::Approx(0.8));
  CHECK(Coast(2, 0.1, 0, {0, {4, 6}}, -1) == doctest::Approx(-0.7));
  CHECK(Coast(2, 0.1, 0, {0, {40, 6}}, 1) == 0);
  CHECK(Coast(2, 0.1, -5, {10, {4, 6}}, 0) == 0);
  CHECK(Coast(2, 0.1, -8, {10, {4, 6}}, 0) == doctest::Approx(-0.2 / 3));
}

TEST_CASE("a handle moves freely within its play and exerts nothing") {
  Loose handle;
  CHECK(BacklashForce({0.1, 2}, 0.01, 4, 0, &handle) == doctest::Approx(0));
  CHECK(handle.velocity == doctest::Approx(0.02));
  CHECK(handle.gap == doctest::Approx(0.0002));
}

TEST_CASE("a handle at the end of its play moves with the part and passes on its momentum") {
  Loose handle = {0.05, 3};
  CHECK(BacklashForce({0.1, 2}, 0.01, 4, 1, &handle) == doctest::Approx(4 + 2 * (3 - 1) / 0.01));
  CHECK(handle.velocity == 1);
  CHECK(handle.gap == 0.05);
  Loose outside = {9, 1};  // a profile with less play took over
  CHECK(BacklashForce({0.1, 2}, 0.01, 4, 1, &outside) == doctest::Approx(4));
  CHECK(outside.gap == 0.05);
}

}  // namespace
}  // namespace joda
