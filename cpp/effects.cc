// The text of the effects, as it stands in the plugin's MJCF attributes.
//
//   name key=value key=value: a b | x0 x1 ... | y0 y1 ... ; name key=value ; ...
//
// One effect after another, separated by ';'. Only effects with a curve have the part from ':' on,
// or, for a learned force, a table: a b | positions | velocities | row | row | ...
#include "effects.h"

#include <algorithm>
#include <iterator>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "attributes.h"

namespace joda {
namespace {

[[noreturn]] void Fail(const std::string& what) { throw std::invalid_argument(what); }

// One effect: its name, parameters and curve.
class EffectText {
 public:
  explicit EffectText(std::string_view text) {
    const auto colon = text.find(':');
    const auto words = internal::Words(text.substr(0, colon));
    if (words.empty()) Fail("expected the name of an effect, got " + internal::Quote(text));
    name_ = words[0];
    values_.assign(words.begin() + 1, words.end());
    has_curve_ = colon != std::string_view::npos;
    if (has_curve_) curve_ = text.substr(colon + 1);
  }

  const std::string_view& name() const { return name_; }

  // Throws unless each word is key=value with one of the keys ("a b c"), and no key comes twice.
  void CheckKeys(std::string_view keys) const {
    const auto known = internal::Words(keys);
    std::set<std::string_view> seen;
    for (const std::string_view word : values_) {
      const std::string_view key = word.substr(0, word.find('='));
      if (key.size() == word.size()) Fail("expected key=value, got " + internal::Quote(word));
      if (std::find(known.begin(), known.end(), key) == known.end()) {
        Fail("unknown key " + internal::Quote(key) + "; its keys: " + std::string(keys));
      }
      if (!seen.insert(key).second) Fail(std::string(key) + " is given twice");
    }
  }

  bool Has(std::string_view key) const { return Find(key) != values_.end(); }

  std::string_view Value(std::string_view key) const {
    const auto found = Find(key);
    if (found == values_.end()) Fail(std::string(key) + " is missing");
    return found->substr(key.size() + 1);
  }

  double Number(const std::string& key) const {
    const std::string_view text = Value(key);
    const auto numbers = ParseNumbers(text);
    if (numbers.size() != 1) Fail(key + " must be one number, got " + internal::Quote(text));
    if (std::abs(numbers[0]) > kMaxValue) Fail(key + " must lie between -1e15 and 1e15");
    return numbers[0];
  }

  double Number(const std::string& key, double missing) const {
    return Has(key) ? Number(key) : missing;
  }

  double NotNegative(const std::string& key) const {
    const double value = Number(key);
    if (value < 0) Fail(key + " must not be negative");
    return value;
  }

  double Positive(const std::string& key) const {
    const double value = Number(key);
    if (!(value > 0)) Fail(key + " must be positive");
    return value;
  }

  PiecewiseCubic Curve() const {
    const auto parts = internal::Split(curve_, '|');
    if (!has_curve_ || parts.size() != 3) {
      Fail("expected its curve, \": a b | x ... | y ...\", got " + internal::Quote(curve_));
    }
    return PiecewiseCubic({ParseComponent(parts[0], parts[1], parts[2], true)}, Combine::kSum);
  }

  // The table, with a row for each position.
  Table ReadTable(bool active) const {
    const auto parts = internal::Split(curve_, '|');
    if (!has_curve_ || parts.size() < 4) {
      Fail("expected its table, \": a b | positions | velocities | row | ...\", got " +
           internal::Quote(curve_));
    }
    const auto ends = ParseNumbers(parts[0]);
    if (ends.size() != 2) Fail("expected the two numbers of the interval before the first |");
    std::vector<std::vector<double>> rows;
    std::transform(parts.begin() + 3, parts.end(), std::back_inserter(rows), ParseNumbers);
    return Table({ends[0], ends[1]}, ParseNumbers(parts[1]), ParseNumbers(parts[2]), rows, active);
  }

  void CheckNoCurve() const {
    if (has_curve_) Fail("it has no curve, but a \":\" follows");
  }

  // Puts the curve where `direction` says.
  void PlaceCurve(bool may_be_both, Directed* out) const {
    const std::string_view direction = Value("direction");
    const bool both = may_be_both && direction == "both";
    if (!both && direction != "positive" && direction != "negative") {
      Fail(std::string("direction must be positive") +
           (may_be_both ? ", negative or both" : " or negative") + ", got " +
           internal::Quote(direction));
    }
    if (both || direction == "positive") PlaceCurve(&out->positive, "positive");
    if (both || direction == "negative") PlaceCurve(&out->negative, "negative");
  }

 private:
  std::vector<std::string_view>::const_iterator Find(std::string_view key) const {
    return std::find_if(values_.begin(), values_.end(), [key](std::string_view word) {
      return word.substr(0, word.find('=')) == key;
    });
  }

  void PlaceCurve(PiecewiseCubic* out, const std::string& direction) const {
    if (!out->Empty()) Fail("there are two of it for the " + direction + " direction");
    *out = Curve();
  }

  std::string_view name_, curve_;
  std::vector<std::string_view> values_;
  bool has_curve_;
};

void ReadStribeck(const EffectText& text, Effects* out) {
  out->stribeck.velocity = text.Positive("velocity");
  if (text.Has("exponent")) out->stribeck.exponent = text.Positive("exponent");
  out->stribeck.excess = text.Curve();
}

void ReadPresliding(const EffectText& text, Effects* out) {
  out->presliding.stiffness = text.Positive("stiffness");
  if (text.Has("damping")) out->presliding.damping = text.NotNegative("damping");
  const double breakaway = text.Number("breakaway", 1);
  if (breakaway < 0 || breakaway > 1) Fail("breakaway must lie between 0 and 1");
  out->presliding.breakaway = breakaway;
}

void ReadGravityOffset(const EffectText& text, Effects* out) {
  const bool hinge = text.Has("sin") || text.Has("cos");
  if (hinge == text.Has("force")) Fail("it takes sin and cos for a hinge, or force for a slide");
  const double sin = text.Number("sin", 0), cos = text.Number("cos", 0);
  out->gravity = {sin, cos, text.Number("force", 0), std::hypot(sin, cos)};
}

void ReadRestitution(const EffectText& text, EndStops* out) {
  const double restitution = text.NotNegative("restitution");
  if (restitution >= 1) Fail("restitution must be less than 1");
  const std::string_view end = text.Has("end") ? text.Value("end") : "both";
  const bool both = end == "both";
  if (!both && end != "low" && end != "high") {
    Fail("end must be low, high or both, got " + internal::Quote(end));
  }
  if (out->both || (both && (out->low || out->high))) {
    Fail("one at both ends excludes another");
  }
  if (both) {
    out->both = true;
    return;
  }
  std::optional<double>& stop = end == "low" ? out->low : out->high;
  if (stop) Fail("there are two of it at the " + std::string(end) + " end");
  stop = StopDamping(restitution);
}

void ReadBacklash(const EffectText& text, Effects* out) {
  const double play = text.Positive("play"), inertia = text.Positive("inertia");
  const std::string_view side = text.Has("side") ? text.Value("side") : "load";
  if (side != "load" && side != "motor") {
    Fail("side must be load or motor, got " + internal::Quote(side));
  }
  const double share = text.Number("share", 0);
  if (share < 0 || share > 1) Fail("share must lie between 0 and 1");
  if (side == "load" && share > 0) Fail("share is of what lies behind, where side=motor");
  out->backlash = {play, 0, 0, share};
  (side == "load" ? out->backlash.handle : out->backlash.load) = inertia;
}

// The place among `names` of the key's word; the first one where there is none.
int ReadChoice(const EffectText& text, const std::string& key,
               const std::vector<std::string_view>& names) {
  if (!text.Has(key)) return 0;
  const auto found = std::find(names.begin(), names.end(), text.Value(key));
  if (found != names.end()) return static_cast<int>(found - names.begin());
  std::string known;
  for (const auto& name : names)
    known += std::string(known.empty() ? "" : " or ") + std::string(name);
  Fail(key + " must be " + known + ", got " + internal::Quote(text.Value(key)));
}

void ReadLearned(const EffectText& text, Effects* out) {
  Learned& learned = out->learned;
  constexpr Memory kMemories[] = {Memory::kNone, Memory::kPosition, Memory::kSpeed};
  learned.memory = kMemories[ReadChoice(text, "memory", {"none", "position", "speed"})];
  if (text.Has("time")) learned.time = text.Positive("time");
  learned.gain = text.Number("gain", 0);
  if (!learned.Remembers() && learned.gain != 0) Fail("gain is a memory's; give memory");
  if (learned.memory == Memory::kPosition && learned.gain < 0) Fail("gain must not be negative");
  learned.table = text.ReadTable(ReadChoice(text, "power", {"passive", "active"}) == 1);
}

struct Kind {
  const char* name;
  const char* keys;
  bool has_curve;
  bool needs_row;  // acts through the solver's friction row
  void (*read)(const EffectText& text, Effects* out);
};

// What the plugin does not read is in the scene.
constexpr Kind kKinds[] = {
    {"direction_dependent_damping", "direction", true, false,
     [](const EffectText& text, Effects* out) { text.PlaceCurve(false, &out->damping); }},
    {"quadratic_damping", "direction", true, false,
     [](const EffectText& text, Effects* out) { text.PlaceCurve(true, &out->quadratic); }},
    {"asymmetric_friction", "direction", true, true,
     [](const EffectText& text, Effects* out) { text.PlaceCurve(false, &out->asymmetry); }},
    {"stribeck_friction", "velocity exponent", true, true, ReadStribeck},
    {"load_dependent_friction", "coefficient", false, true,
     [](const EffectText& text, Effects* out) { out->load = text.NotNegative("coefficient"); }},
    {"presliding_friction", "stiffness damping breakaway", false, true, ReadPresliding},
    {"gravity_offset", "sin cos force", false, false, ReadGravityOffset},
    {"backlash", "play inertia side share", false, false, ReadBacklash},
    {"added_inertia", "inertia", false, false,
     [](const EffectText& text, Effects* out) { out->added_inertia = text.Positive("inertia"); }},
    {"end_stop_restitution", "restitution end", false, false,
     [](const EffectText& text, Effects* out) { ReadRestitution(text, &out->stops); }},
    {"learned_force", "memory time gain power", true, false, ReadLearned},
};

const Kind& FindKind(std::string_view name) {
  std::string names;
  for (const Kind& kind : kKinds) {
    if (name == kind.name) return kind;
    names += std::string(names.empty() ? "" : ", ") + kind.name;
  }
  Fail("there is no such effect; there are " + names);
}

// Whether the effect may be there once for each direction or end, which its reader sees to.
bool HasSides(const Kind& kind) {
  const auto keys = internal::Words(kind.keys);
  return std::any_of(keys.begin(), keys.end(),
                     [](std::string_view key) { return key == "direction" || key == "end"; });
}

void ReadEffect(const EffectText& text, std::set<std::string_view>* seen, Effects* out) {
  const Kind& kind = FindKind(text.name());
  text.CheckKeys(kind.keys);
  if (!kind.has_curve) text.CheckNoCurve();
  if (!seen->insert(kind.name).second && !HasSides(kind)) Fail("there are two of it");
  kind.read(text, out);
  if (kind.needs_row) out->needs_row = kind.name;
}

}  // namespace

Effects ParseEffects(std::string_view text) {
  Effects out;
  std::set<std::string_view> seen;
  const auto pieces = internal::Split(internal::Trim(text), ';');
  for (size_t i = 0; i < pieces.size(); ++i) {
    const std::string_view piece = internal::Trim(pieces[i]);
    if (piece.empty() && i + 1 == pieces.size()) break;  // a closing ';', or no effect at all
    std::string where = "effect " + std::to_string(i + 1);
    try {
      const EffectText effect(piece);
      where += " " + internal::Quote(effect.name());
      ReadEffect(effect, &seen, &out);
    } catch (const std::invalid_argument& error) {
      Fail(where + ": " + error.what());
    }
  }
  return out;
}

}  // namespace joda
