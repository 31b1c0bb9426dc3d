// What the fuzzers share: random texts, mostly of the attributes' grammar, and the loop over them.
//
// A text is written by the grammar, so that it reaches behind the parser, and then often rearranged
// by its structure (pieces, parts, words) or changed byte by byte.
#ifndef JODA_TESTS_FUZZ_H_
#define JODA_TESTS_FUZZ_H_

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "attributes.h"

namespace joda::fuzz {

using Random = std::mt19937_64;

inline int Below(Random& random, int n) { return static_cast<int>(random() % n); }

template <typename T, size_t n>
const T& Pick(Random& random, const T (&choices)[n]) {
  return choices[random() % n];
}

inline std::string Print(double value) {
  char out[32];
  std::snprintf(out, sizeof out, "%.17g", value);
  return out;
}

inline double Uniform(Random& random) { return std::uniform_real_distribution<>(0, 1)(random); }

inline std::string Number(Random& random) {
  static const char* const extremes[] = {
      "0",    "1",   "-0.0", "1e15",   "-1e15",     "1.1e15", "1e308", "-1e308", "1e309",
      "1e-9", "nan", "inf",  "5e-324", "-2.2e-308", "1e-160", "0x1p3", "+1",     "--1"};
  if (Below(random, 6) == 0) return Pick(random, extremes);
  const int exponent = Below(random, 8) == 0 ? Below(random, 40) - 24 : 0;
  return Print((2 * Uniform(random) - 1) * std::pow(10, exponent));
}

// Increasing numbers from 0 to 1, some of them next to each other.
inline std::vector<double> Knots(Random& random, int n) {
  std::vector<double> out = {0, 1};
  while (static_cast<int>(out.size()) < n) {
    const double near = out[Below(random, static_cast<int>(out.size()))];
    const double gap = Below(random, 4)
                           ? Uniform(random)
                           : std::pow(10, (Below(random, 9) ? -6 : -10) * Uniform(random));
    out.push_back(std::clamp(near + (Below(random, 2) ? gap : -gap), 0.0, 1.0));
  }
  std::sort(out.begin(), out.end());
  if (Below(random, 60)) out.erase(std::unique(out.begin(), out.end()), out.end());
  return out;
}

// A component that mostly can be evaluated, without a label; its values may be kept from being
// negative.
inline std::string Curve(Random& random, bool nonnegative) {
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
    y += " " + (Below(random, 900) ? Print(scale * allowed) : Number(random));
  }
  return out + " |" + y;
}

inline std::string WriteComponent(Random& random) {
  return (Below(random, 2) ? "label: " : "") + Curve(random, false);
}

inline std::string Positive(Random& random) {
  return Below(random, 30) ? Print(std::pow(10, 4 * Uniform(random) - 2)) : Number(random);
}

// A learned force, mostly one that only resists.
inline std::string WriteLearned(Random& random) {
  static const char* const heads[] = {"", " power=active", " memory=position", " memory=speed"};
  const int way = Below(random, 4), n = 1 + Below(random, 3), half = 1 + Below(random, 4);
  std::string out = std::string("learned_force") + heads[way];
  if (way > 1) out += " time=" + Positive(random) + " gain=" + Positive(random);
  std::vector<double> x = Knots(random, std::max(2, n)), v = {0};
  x.resize(n);
  for (int k = 0; k < half; ++k) {
    const double gap = std::pow(10, (Below(random, 9) ? -3 : -10) * Uniform(random));
    v.insert(v.begin(), v.front() - gap);
    v.push_back(v.back() + 3 * gap);
  }
  out += ": " + Print(Below(random, 2) ? 0 : 0.3 * Uniform(random)) + " 1 |";
  for (const double one : x) out += " " + Print(one);
  out += " |";
  for (const double one : v) out += " " + Print(one);
  const double scale = std::pow(10, Below(random, 3) ? 0 : Below(random, 30) - 14);
  for (int row = 0; row < n; ++row) {
    out += " |";
    for (const double one : v) {
      const double y = scale * Uniform(random) * ((one > 0) - (one < 0));
      out += " " +
             (Below(random, 900) ? Print(way == 1 && Below(random, 2) ? -y : y) : Number(random));
    }
  }
  return out;
}

inline std::string WriteEffect(Random& random, int kind) {
  static const char* const directions[] = {"positive", "negative", "both"};
  static const char* const ends[] = {"low", "high", "both"};
  const std::string direction = std::string(" direction=") + Pick(random, directions);
  const std::string curve = ": " + Curve(random, true), part = Print(Uniform(random));
  switch (kind) {
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
      return "backlash play=" + Positive(random) + " inertia=" + Positive(random) +
             (Below(random, 2) ? " side=motor share=" + part : "");
    case 8:
      return "added_inertia inertia=" + Positive(random);
    case 9:
      return WriteLearned(random);
    default:
      return "end_stop_restitution restitution=" + part +
             (Below(random, 3) ? std::string(" end=") + Pick(random, ends) : "");
  }
}

inline std::string Bytes(Random& random) {
  std::string out(random() % 60, '\0');
  for (char& byte : out) byte = static_cast<char>(random());
  return out;
}

// Takes, repeats, drops, swaps or empties what stands between two separators of one kind, or puts
// another number or key in its place.
inline std::string Rearrange(Random& random, const std::string& text) {
  const char separator = Pick(random, ";;||:=   ");
  std::vector<std::string> parts;
  for (const auto part : internal::Split(text, separator ? separator : ' ')) {
    parts.emplace_back(part);
  }
  static const char* const words[] = {"direction", "positive", "velocity", "play",
                                      "end",       "0 1",      "",         "|"};
  std::string& part = parts[random() % parts.size()];
  const std::string copy = parts[random() % parts.size()];
  switch (Below(random, 5)) {
    case 0:
      part = copy;
      break;
    case 1:
      std::swap(part, parts.front());
      break;
    case 2:
      part = Number(random);
      break;
    case 3:
      part = Pick(random, words);
      break;
    default:
      parts.insert(parts.begin() + Below(random, static_cast<int>(parts.size())), copy);
      break;
  }
  std::string out;
  for (const auto& one : parts)
    out += (&one == &parts.front() ? "" : std::string(1, separator)) + one;
  return out;
}

// Replaces, inserts, removes or repeats a few characters.
inline std::string Mutate(Random& random, std::string text) {
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

// Some effects, mostly each once.
inline std::string WriteEffects(Random& random) {
  std::string out;
  for (int kind = 0; kind < 11; ++kind) {
    if (Below(random, 3) == 0) out += WriteEffect(random, kind) + "; ";
  }
  return Below(random, 20) ? out : out + WriteEffect(random, Below(random, 11));
}

// The text, or what became of it.
inline std::string Disturb(Random& random, std::string text) {
  if (Below(random, 10) == 0) return Bytes(random);
  for (int k = Below(random, 4); k > 1; --k) text = Rearrange(random, text);
  return Below(random, 3) ? text : Mutate(random, text);
}

// One piece or more, by `write`.
inline std::string List(Random& random, std::string (*write)(Random&)) {
  std::string out = write(random);
  for (int k = Below(random, 40) == 0 ? 60 : Below(random, 5); k > 0; --k) {
    out += "; " + write(random);
  }
  return out;
}

// A text that was tried: whether it was accepted, and whether all went as promised.
struct Trial {
  std::string text;
  bool accepted = false, good = true;
};

struct Target {
  const char* what;
  Trial (*attempt)(Random& random);
  int share;  // of COUNT, as COUNT / share
};

// Tries `count` texts; returns whether all passed and enough were accepted.
inline bool Fuzz(Random& random, const Target& target, int count) {
  int accepted = 0;
  for (int k = 0; k < count; ++k) {
    const Trial trial = target.attempt(random);
    accepted += trial.accepted;
    if (trial.good) continue;
    std::fprintf(stderr, "text %d of %s: %s\n", k, target.what, trial.text.c_str());
    return false;
  }
  std::printf("%d texts of %s, %d of them accepted\n", count, target.what, accepted);
  std::fflush(stdout);
  return accepted > count / 50;
}

// The program of a fuzzer: SEED COUNT.
template <size_t n>
int Run(int argc, char** argv, const Target (&targets)[n]) {
  if (argc != 3) {
    std::fprintf(stderr, "expected SEED COUNT\n");
    return 1;
  }
  std::printf("seed %s\n", argv[1]);
  for (const Target& target : targets) {
    Random random(std::strtoull(argv[1], nullptr, 10));
    if (!Fuzz(random, target, std::max(std::atoi(argv[2]) / target.share, 200))) return 1;
  }
  return 0;
}

}  // namespace joda::fuzz

#endif  // JODA_TESTS_FUZZ_H_
