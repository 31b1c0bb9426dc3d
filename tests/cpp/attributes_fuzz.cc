// Feeds texts to the attributes' parsers: attributes_fuzz SEED COUNT. A channel that is accepted
// must evaluate to what its components give alone, within their control points' magnitude, and the
// laws of accepted effects must stay finite and resist; what is refused is refused by
// std::invalid_argument (any other exception ends the program).
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <stdexcept>
#include <string>
#include <vector>

#include "attributes.h"
#include "effects.h"
#include "fuzz.h"

namespace joda::fuzz {
namespace {

// Places where the channel may go wrong: all over, at its knots and right beside them.
std::vector<double> Places(Random& random, const std::vector<double>& knots) {
  std::vector<double> out = {-1, 0, 1, 2, NAN, INFINITY};
  for (int k = 0; k < 30; ++k) out.push_back(3 * Uniform(random) - 1);
  for (const double knot : knots) {
    for (const double to : {-1.0, 2.0}) out.push_back(std::nextafter(knot, to));
    out.push_back(knot);
  }
  return out;
}

// A channel that the parser accepted, and its components one by one.
struct Accepted {
  PiecewiseCubic channel;
  std::vector<Component> components;
  Combine combine;
  double bound = 0;  // sum of the components' largest magnitudes
};

bool Parse(const std::string& text, const char* combine, Accepted* out) {
  try {
    out->channel = ParsePiecewiseCubic(text, combine, false);
    out->components = ParseChannel(text, false);
    out->combine = ParseCombine(combine);
  } catch (const std::invalid_argument&) {
    return false;
  }
  for (const auto& c : out->components) {
    const auto [least, most] = std::minmax_element(c.y.begin(), c.y.end());
    out->bound += std::max(std::abs(*least), std::abs(*most));
  }
  return true;
}

// Whether the channel stays bounded and is what its components are when evaluated alone.
bool Check(Random& random, const Accepted& accepted) {
  std::vector<PiecewiseCubic> alone;
  for (const auto& c : accepted.components) alone.push_back({{c}, Combine::kSum});
  const double tolerance = 1e-6 * accepted.bound;
  bool good = std::isfinite(accepted.channel.MaxStiffness());
  for (const double s : Places(random, accepted.channel.Knots())) {
    std::vector<Sample> samples;
    for (size_t k = 0; k < alone.size(); ++k) {
      const double inside = std::clamp(s, 0.0, 1.0);
      const auto& c = accepted.components[k];
      if (c.a <= inside && inside <= c.b) samples.push_back(alone[k](s));
    }
    const double expected = internal::CombineSamples(samples, accepted.combine).value;
    const Sample sample = accepted.channel(s);
    if (std::abs(sample.value - expected) <= tolerance && std::isfinite(sample.slope) &&
        std::abs(sample.value) <= accepted.bound + tolerance) {
      continue;
    }
    std::fprintf(stderr, "at %.17g: value %.17g slope %g, its components alone give %.17g\n", s,
                 sample.value, sample.slope, expected);
    good = false;
  }
  return good;
}

// Whether the effects resist motion, and no law leaves its bounds, at some place and speed.
bool Resist(Random& random, const Effects& e) {
  const double s = 3 * Uniform(random) - 1, v = 2 * Uniform(random) - 1, h = 0.002;
  const double load = 10 * Uniform(random), held = 4 * Uniform(random) - 2;
  const double damping = ExtraDamping(e, s, v);
  const FrictionBounds bounds = FindFrictionBounds(e, 1, s, v, load);
  const double left = BristleStiffnessScale(e.presliding, held, bounds.Bound(), v);
  Loose handle = {0, v};
  const Backlash backlash = e.backlash.handle > 0 ? e.backlash : Backlash{1, 1};
  const double force = BacklashForce(backlash, h, load, -v, &handle);
  const Backlash behind = e.backlash.load > 0 ? e.backlash : Backlash{1, 0, 0.5, 0.5};
  const Resistance own = {damping, bounds};
  const Passage passage = Meet(behind, h, 1, load, v, own, 0, own, {held, v});
  const Loose after = Settle(behind, h, passage, -v);
  const Push learned = LearnedForce(e.learned, h, s, v, held);
  return damping >= 0 && std::isfinite(damping) && bounds.positive >= 0 && bounds.negative >= 0 &&
         std::isfinite(bounds.Bound()) && left > 0 && left <= 2 && std::isfinite(force) &&
         std::abs(handle.gap) <= 0.5 * backlash.play && std::isfinite(GravityForce(e.gravity, v)) &&
         passage.scale >= 1 && passage.scale <= 1 / (1 - kHeaviestLoad) + 1e-9 &&
         learned.drag >= 0 && std::isfinite(learned.push + learned.drag) &&
         std::isfinite(Remember(e.learned, h, v, held)) &&
         std::isfinite(passage.force + after.velocity) && std::abs(after.gap) <= 0.5 * behind.play;
}

Trial TryChannel(Random& random) {
  Trial out = {Disturb(random, List(random, WriteComponent))};
  Accepted candidate;
  out.accepted = Parse(out.text, Below(random, 2) ? "sum" : "max", &candidate);
  out.good = !out.accepted || Check(random, candidate);
  return out;
}

Trial TryEffects(Random& random) {
  Trial out = {Disturb(random, WriteEffects(random))};
  try {
    const Effects effects = ParseEffects(out.text);
    out.accepted = true;
    for (int k = 0; k < 20; ++k) out.good = out.good && Resist(random, effects);
  } catch (const std::invalid_argument&) {
  }
  return out;
}

// Numbers must be those that strtod reads, word by word.
Trial TryNumbers(Random& random) {
  Trial out = {Number(random)};
  for (int k = Below(random, 5); k > 0; --k) out.text += " " + Number(random);
  out.text = Disturb(random, out.text);
  try {
    const std::vector<double> numbers = ParseNumbers(out.text);
    const auto words = internal::Words(out.text);
    out.accepted = true;
    out.good =
        numbers.size() == words.size() &&
        std::all_of(numbers.begin(), numbers.end(), [](double x) { return std::isfinite(x); });
    for (size_t k = 0; out.good && k < words.size(); ++k) {
      out.good = numbers[k] == std::strtod(std::string(words[k]).c_str(), nullptr);
    }
  } catch (const std::invalid_argument&) {
  }
  return out;
}

Trial TryCombine(Random& random) {
  static const char* const texts[] = {"sum", "max", "", " max\n", "min", "summax", "Sum", "s um"};
  Trial out = {Below(random, 2) ? Pick(random, texts) : Mutate(random, Pick(random, texts))};
  const auto trimmed = internal::Trim(out.text);
  try {
    const bool largest = ParseCombine(out.text) == Combine::kMax;
    out.accepted = true;
    out.good = largest ? trimmed == "max" : trimmed.empty() || trimmed == "sum";
  } catch (const std::invalid_argument&) {
    out.good = !(trimmed.empty() || trimmed == "sum" || trimmed == "max");
  }
  return out;
}

}  // namespace
}  // namespace joda::fuzz

int main(int argc, char** argv) {
  using namespace joda::fuzz;
  constexpr Target kTargets[] = {{"numbers", TryNumbers, 1},
                                 {"combinations", TryCombine, 10},
                                 {"channels", TryChannel, 1},
                                 {"effects", TryEffects, 2}};
  return Run(argc, argv, kTargets);
}
