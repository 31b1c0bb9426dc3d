// Feeds texts to the attributes' parsers: attributes_fuzz SEED COUNT. A channel that is accepted
// must evaluate to what its components give alone, within their control points' magnitude, and the
// laws of accepted effects must stay finite and resist; what is refused is refused by
// std::invalid_argument (any other exception ends the program).
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "attributes.h"
#include "effects.h"

namespace {

using Random = std::mt19937_64;

int Below(Random& random, int n) { return static_cast<int>(random() % n); }

template <typename T, size_t n>
const T& Pick(Random& random, const T (&choices)[n]) {
  return choices[random() % n];
}

std::string Print(double value) {
  char out[32];
  std::snprintf(out, sizeof out, "%.17g", value);
  return out;
}

double Uniform(Random& random) { return std::uniform_real_distribution<>(0, 1)(random); }

std::string Number(Random& random) {
  static const char* const extremes[] = {
      "0",    "1",   "-0.0", "1e15",   "-1e15",     "1.1e15", "1e308", "-1e308", "1e309",
      "1e-9", "nan", "inf",  "5e-324", "-2.2e-308", "1e-160", "0x1p3", "+1",     "--1"};
  if (Below(random, 6) == 0) return Pick(random, extremes);
  const int exponent = Below(random, 8) == 0 ? Below(random, 40) - 24 : 0;
  return Print((2 * Uniform(random) - 1) * std::pow(10, exponent));
}

// Increasing numbers from 0 to 1, some of them next to each other.
std::vector<double> Knots(Random& random, int n) {
  std::vector<double> out = {0, 1};
  while (static_cast<int>(out.size()) < n) {
    const double near = out[Below(random, static_cast<int>(out.size()))];
    const double gap = Below(random, 4) ? Uniform(random) : std::pow(10, -10 * Uniform(random));
    out.push_back(std::clamp(near + (Below(random, 2) ? gap : -gap), 0.0, 1.0));
  }
  std::sort(out.begin(), out.end());
  if (Below(random, 10)) out.erase(std::unique(out.begin(), out.end()), out.end());
  return out;
}

// A component that mostly can be evaluated, without a label; its values may be kept from being
// negative.
std::string Curve(Random& random, bool nonnegative) {
  const std::vector<double> interval = Knots(random, Below(random, 2) ? 2 : 4);
  const size_t left = random() % (interval.size() - 1);
  const int n = Below(random, 100) == 0 ? 2000 : 2 + Below(random, 8);
  const double scale = std::pow(10, Below(random, 3) ? 0 : Below(random, 30) - 14);
  const bool flat = Below(random, 4) == 0;
  std::string out = Print(interval[left]) + " " + Print(interval[left + 1]) + " |", y;
  for (const double x : Knots(random, n)) {
    out += " " + Print(x);
    const double value = flat ? Below(random, 3) - 1 : 2 * Uniform(random) - 1;
    const double allowed = nonnegative ? std::abs(value) : value;
    y += " " + (Below(random, 200) ? Print(scale * allowed) : Number(random));
  }
  return out + " |" + y;
}

std::string Component(Random& random) {
  return (Below(random, 2) ? "label: " : "") + Curve(random, false);
}

std::string Positive(Random& random) {
  return Below(random, 30) ? Print(std::pow(10, 4 * Uniform(random) - 2)) : Number(random);
}

std::string Effect(Random& random) {
  static const char* const directions[] = {"positive", "negative", "both"};
  const std::string direction = std::string(" direction=") + Pick(random, directions);
  const std::string curve = ": " + Curve(random, true), part = Print(Uniform(random));
  switch (Below(random, 10)) {
    case 0:
      return "direction_dependent_damping" + direction + curve;
    case 1:
      return "quadratic_damping" + direction + curve;
    case 2:
      return "asymmetric_friction" + direction + curve;
    case 3:
      return "stribeck_friction exponent=" + Positive(random) + " velocity=" + Positive(random) +
             curve;
    case 4:
      return "load_dependent_friction coefficient=" + Positive(random);
    case 5:
      return "presliding_friction stiffness=" + Positive(random) + " damping=" + Positive(random) +
             " breakaway=" + (Below(random, 4) ? part : Print(Below(random, 2)));
    case 6:
      return "gravity_offset sin=" + Number(random) + " cos=" + Number(random);
    case 7:
      return "backlash play=" + Positive(random) + " inertia=" + Positive(random);
    case 8:
      return "added_inertia inertia=" + Positive(random);
    default:
      return "end_stop_restitution restitution=" + part;
  }
}

std::string Bytes(Random& random) {
  std::string out(random() % 60, '\0');
  for (char& byte : out) byte = static_cast<char>(random());
  return out;
}

// Replaces, inserts, removes or repeats a few characters.
std::string Mutate(Random& random, std::string text) {
  for (int k = Below(random, 4); k > 0 && !text.empty(); --k) {
    const size_t at = random() % text.size();
    switch (Below(random, 5)) {
      case 0:
        text[at] = Pick(random, "0123456789.eE+-|;: \n\xc3");
        break;
      case 1:
        text.insert(at, " " + Number(random) + " ");
        break;
      case 2:
        text.erase(at, 1 + random() % 8);
        break;
      case 3:
        text.insert(at, text.substr(at, random() % 40));
        break;
      default:
        text.insert(at, Bytes(random));
        break;
    }
  }
  return text;
}

// One piece or more, by `write`.
std::string Text(Random& random, std::string (*write)(Random&)) {
  if (Below(random, 10) == 0) return Bytes(random);
  std::string out = write(random);
  for (int k = Below(random, 40) == 0 ? 60 : Below(random, 5); k > 0; --k) {
    out += "; " + write(random);
  }
  return Below(random, 3) ? out : Mutate(random, out);
}

// Places where the channel may go wrong: all over, at its knots and right beside them.
std::vector<double> Places(Random& random, const Eigen::VectorXd& knots) {
  std::vector<double> out = {-1, 0, 1, 2, NAN, INFINITY};
  for (int k = 0; k < 30; ++k) out.push_back(3 * Uniform(random) - 1);
  for (Eigen::Index k = 0; k < knots.size(); ++k) {
    for (const double to : {-1.0, 2.0}) out.push_back(std::nextafter(knots[k], to));
    out.push_back(knots[k]);
  }
  return out;
}

// A channel that the parser accepted, and its components one by one.
struct Accepted {
  joda::PiecewiseCubic channel;
  std::vector<joda::Component> components;
  joda::Combine combine;
  double bound = 0;  // sum of the components' largest magnitudes
};

bool Parse(const std::string& text, const char* combine, Accepted* out) {
  try {
    out->channel = joda::ParsePiecewiseCubic(text, combine, false);
    out->components = joda::ParseChannel(text, false);
    out->combine = joda::ParseCombine(combine);
  } catch (const std::invalid_argument&) {
    return false;
  }
  for (const auto& c : out->components) out->bound += c.y.cwiseAbs().maxCoeff();
  return true;
}

// Whether the channel stays bounded and is what its components are when evaluated alone.
bool Check(Random& random, const Accepted& accepted) {
  std::vector<joda::PiecewiseCubic> alone;
  for (const auto& c : accepted.components) alone.push_back({{c}, joda::Combine::kSum});
  const double tolerance = 1e-6 * accepted.bound;
  bool good = std::isfinite(accepted.channel.MaxDescent());
  for (const double s : Places(random, accepted.channel.knots())) {
    std::vector<joda::Sample> samples;
    for (size_t k = 0; k < alone.size(); ++k) {
      const double inside = std::clamp(s, 0.0, 1.0);
      const auto& c = accepted.components[k];
      if (c.a <= inside && inside <= c.b) samples.push_back(alone[k](s));
    }
    const double expected = joda::internal::CombineSamples(samples, accepted.combine).value;
    const joda::Sample sample = accepted.channel(s);
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
bool Resist(Random& random, const joda::Effects& e) {
  const double s = 3 * Uniform(random) - 1, v = 2 * Uniform(random) - 1, h = 0.002;
  const double load = 10 * Uniform(random), held = 4 * Uniform(random) - 2;
  const double damping = joda::ExtraDamping(e, s, v);
  const joda::FrictionBounds bounds = joda::BoundFriction(e, 1, s, v, load);
  const double left = joda::BristleLeft(e.presliding, held, bounds.Bound(), v);
  joda::Handle handle = {0, v};
  const joda::Backlash backlash = e.backlash.play > 0 ? e.backlash : joda::Backlash{1, 1};
  const double force = joda::MoveHandle(backlash, h, load, -v, &handle);
  return damping >= 0 && std::isfinite(damping) && bounds.positive >= 0 && bounds.negative >= 0 &&
         std::isfinite(bounds.Bound()) && left > 0 && left <= 2 && std::isfinite(force) &&
         std::abs(handle.gap) <= 0.5 * backlash.play &&
         std::isfinite(joda::OffsetForce(e.gravity, v));
}

// Whether the effects are refused, or resist everywhere; counts those that are accepted.
bool CheckEffects(Random& random, const std::string& text, int* accepted) {
  joda::Effects effects;
  try {
    effects = joda::ParseEffects(text);
  } catch (const std::invalid_argument&) {
    return true;
  }
  ++*accepted;
  for (int k = 0; k < 20; ++k) {
    if (!Resist(random, effects)) return false;
  }
  return true;
}

bool CheckChannel(Random& random, const std::string& text, int* accepted) {
  Accepted candidate;
  if (!Parse(text, Below(random, 2) ? "sum" : "max", &candidate)) return true;
  ++*accepted;
  return Check(random, candidate);
}

// Tries `count` texts; returns whether all passed and enough were accepted.
bool Fuzz(Random& random, const char* what, std::string (*write)(Random&),
          bool (*check)(Random&, const std::string&, int*), int count) {
  int accepted = 0;
  for (int k = 0; k < count; ++k) {
    const std::string text = Text(random, write);
    if (check(random, text, &accepted)) continue;
    std::fprintf(stderr, "text %d of %s: %s\n", k, what, text.c_str());
    return false;
  }
  std::printf("%d texts of %s, %d of them accepted\n", count, what, accepted);
  return accepted > count / 10;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "expected SEED COUNT\n");
    return 1;
  }
  Random random(std::strtoull(argv[1], nullptr, 10));
  const int count = std::atoi(argv[2]);
  const bool good = Fuzz(random, "channels", Component, CheckChannel, count) &&
                    Fuzz(random, "effects", Effect, CheckEffects, count / 10);
  return good ? 0 : 1;
}
