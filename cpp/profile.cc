#include "profile.h"

#include <stdexcept>
#include <string_view>

#include "attributes.h"

namespace joda {
namespace {

// Adds the attribute's name to the errors of `parse`.
template <typename Parse>
auto Attribute(const std::string& key, const Parse& parse) {
  try {
    return parse();
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument("attribute \"" + key + "\": " + error.what());
  }
}

// A channel from its two texts, the components and sum or max.
PiecewiseCubic ParseNamed(const std::string& prefix, const char* const texts[], int first,
                          bool nonnegative) {
  const Combine combine =
      Attribute(prefix + kTextNames[first + 1], [&] { return ParseCombine(texts[first + 1]); });
  return Attribute(prefix + kTextNames[first], [&] {
    return PiecewiseCubic(ParseChannel(texts[first], nonnegative), combine);
  });
}

// The effects in the text, null if it is blank.
std::shared_ptr<const Effects> ParseShared(std::string_view text) {
  if (internal::Trim(text).empty()) return nullptr;
  return std::make_shared<const Effects>(ParseEffects(text));
}

}  // namespace

Profile ParseProfile(const std::string& prefix, double lo, double hi,
                     const char* const texts[kTexts]) {
  Profile profile;
  profile.lo = lo;
  profile.per_range = 1 / (hi - lo);
  profile.conservative = ParseNamed(prefix, texts, 0, false);
  profile.friction = ParseNamed(prefix, texts, 2, true);
  profile.damping = ParseNamed(prefix, texts, 4, true);
  profile.effects = Attribute(prefix + kTextNames[6], [&] { return ParseShared(texts[6]); });
  return profile;
}

int CountStates(const Effects* effects) {
  if (!effects) return 1;
  return 1 + (effects->backlash.play > 0 ? 3 : 0) + effects->learned.Remembers() +
         (effects->load > 0);
}

int CountStates(const char* effects) {
  try {
    return CountStates(ParseShared(effects).get());
  } catch (const std::invalid_argument&) {
    return CountStates(static_cast<const Effects*>(nullptr));
  }
}

}  // namespace joda
