// The text of a channel, as it stands in the plugin's MJCF attributes, to components.
//
//   label: a b | x0 x1 ... | y0 y1 ... ; label: a b | x... | y...
//
// One component after another, separated by ';'. The label and its ':' may be left out. [a, b] is
// the interval in normalised joint position, x the control points in the component's own coordinate
// (from 0 to 1), y their values in physical units. Every error is one sentence
// (std::invalid_argument).
#ifndef JODA_ATTRIBUTES_H_
#define JODA_ATTRIBUTES_H_

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <locale>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "field.h"

namespace joda {

inline constexpr double kMinWidth = 1e-9;  // narrowest interval or gap between control points
inline constexpr double kMaxValue = 1e15;  // largest |y|; no coefficient of a cubic can overflow
inline constexpr size_t kMaxComponents = 200;  // of one channel
inline constexpr size_t kMaxPoints = 2000;     // of one channel: its components' together

namespace internal {

inline std::string_view Trim(std::string_view text) {
  const auto first = text.find_first_not_of(" \t\r\n");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t\r\n") - first + 1);
}

// Splits at every separator; "a;b;" gives "a", "b" and "".
inline std::vector<std::string_view> Split(std::string_view text, char separator) {
  std::vector<std::string_view> out;
  for (;;) {
    const auto at = text.find(separator);
    out.push_back(text.substr(0, at));
    if (at == std::string_view::npos) return out;
    text.remove_prefix(at + 1);
  }
}

// What stands between white space.
inline std::vector<std::string_view> Words(std::string_view text) {
  std::vector<std::string_view> out;
  for (text = Trim(text); !text.empty(); text = Trim(text.substr(out.back().size()))) {
    out.push_back(text.substr(0, text.find_first_of(" \t\r\n")));
  }
  return out;
}

// The text in quotes, cut after some 40 bytes but never within a UTF-8 character.
inline std::string Quote(std::string_view text) {
  size_t end = std::min<size_t>(text.size(), 40);
  while (end > 0 && end < text.size() && (text[end] & 0xC0) == 0x80) --end;
  return "\"" + std::string(text.substr(0, end)) + (end < text.size() ? "...\"" : "\"");
}

// Whether all of the word is a number, which `value` then is; infinities and NaN are or are not.
inline bool ReadNumber(std::string_view word, double* value) {
#ifdef __cpp_lib_to_chars
  const char* end = word.data() + word.size();
  const auto result = std::from_chars(word.data(), end, *value);
  return result.ec == std::errc() && result.ptr == end;
#else  // LLVM's library, before 20, reads only integers so
  if (word.find_first_not_of("0123456789+-.eE") != word.npos || word.front() == '+') return false;
  std::istringstream stream{std::string(word)};
  stream.imbue(std::locale::classic());
  return stream >> *value && stream.peek() == EOF;
#endif
}

}  // namespace internal

// Numbers separated by white space; throws for anything else, infinities and NaN included.
inline std::vector<double> ParseNumbers(std::string_view text) {
  std::vector<double> out;
  for (const std::string_view word : internal::Words(text)) {
    double value;
    if (!internal::ReadNumber(word, &value) || !std::isfinite(value)) {
      throw std::invalid_argument(internal::Quote(word) + " is not a finite number");
    }
    out.push_back(value);
  }
  return out;
}

// Throws unless the component is one that can be evaluated; `nonnegative` for friction and damping.
inline void Validate(const Component& c, bool nonnegative) {
  const auto fail = [](const std::string& what) { throw std::invalid_argument(what); };
  if (!(0 <= c.a && c.a < c.b && c.b <= 1)) {
    fail("the interval must satisfy 0 <= a < b <= 1, in normalised joint position");
  }
  if (c.b - c.a < kMinWidth) fail("the interval is narrower than 1e-9 of the range");
  if (c.x.size() < 2) fail("at least two control points are needed");
  if (c.x.size() > kMaxPoints) {
    fail("it has " + std::to_string(c.x.size()) + " control points; at most " +
         std::to_string(kMaxPoints) + " are possible");
  }
  if (c.x.size() != c.y.size()) {
    fail("x has " + std::to_string(c.x.size()) + " numbers and y has " +
         std::to_string(c.y.size()) + "; they must be equally many");
  }
  const size_t n = c.x.size();
  if (c.x[0] != 0 || c.x[n - 1] != 1) fail("x must begin at 0 and end at 1");
  for (size_t k = 0; k + 1 < n; ++k) {
    if (!((c.x[k + 1] - c.x[k]) * (c.b - c.a) >= kMinWidth)) {
      fail("x must increase, by at least 1e-9 of the joint's range");
    }
  }
  for (const double y : c.y) {
    if (!(std::abs(y) <= kMaxValue)) fail("y must lie between -1e15 and 1e15");
    if (nonnegative && y < 0) fail("values of friction and damping must not be negative");
  }
}

// One component from its three parts; it has no label.
inline Component ParseComponent(std::string_view interval, std::string_view x, std::string_view y,
                                bool nonnegative) {
  const auto ends = ParseNumbers(interval);
  if (ends.size() != 2) {
    throw std::invalid_argument("expected the two numbers of the interval before the first |");
  }
  const Component out = {"", ends[0], ends[1], ParseNumbers(x), ParseNumbers(y)};
  Validate(out, nonnegative);
  return out;
}

// Throws if the components are more than one channel may have; merging them takes the longer the
// more there are (docs/physics.md).
inline void CheckSize(const std::vector<Component>& components) {
  size_t points = 0;
  for (const Component& c : components) points += c.x.size();
  const bool many = components.size() > kMaxComponents;
  if (!many && points <= kMaxPoints) return;
  throw std::invalid_argument("the channel has " +
                              std::to_string(many ? components.size() : points) +
                              (many ? " components" : " control points") + "; at most " +
                              std::to_string(many ? kMaxComponents : kMaxPoints) + " are possible");
}

// All components of one channel; the text may be empty.
inline std::vector<Component> ParseChannel(std::string_view text, bool nonnegative) {
  std::vector<Component> out;
  if (internal::Trim(text).empty()) return out;
  const auto pieces = internal::Split(text, ';');
  for (size_t i = 0; i < pieces.size(); ++i) {
    const std::string_view piece = internal::Trim(pieces[i]);
    if (piece.empty() && i + 1 == pieces.size()) break;  // a closing ';'
    const auto parts = internal::Split(piece, '|');
    const auto colon = parts[0].rfind(':');
    const bool labelled = colon != std::string_view::npos;
    const std::string label(internal::Trim(labelled ? parts[0].substr(0, colon) : ""));
    try {
      if (parts.size() != 3) {
        throw std::invalid_argument("expected \"label: a b | x ... | y ...\", got " +
                                    internal::Quote(piece));
      }
      const auto interval = labelled ? parts[0].substr(colon + 1) : parts[0];
      out.push_back(ParseComponent(interval, parts[1], parts[2], nonnegative));
      out.back().label = label;
    } catch (const std::invalid_argument& error) {
      const std::string name = label.empty() ? "" : " " + internal::Quote(label);
      throw std::invalid_argument("component " + std::to_string(i + 1) + name + ": " +
                                  error.what());
    }
  }
  CheckSize(out);
  return out;
}

// "sum" (also for an empty text) or "max".
inline Combine ParseCombine(std::string_view text) {
  text = internal::Trim(text);
  if (text.empty() || text == "sum") return Combine::kSum;
  if (text == "max") return Combine::kMax;
  throw std::invalid_argument("must be \"sum\" or \"max\", got " + internal::Quote(text));
}

// One channel from its two attributes.
inline PiecewiseCubic ParsePiecewiseCubic(std::string_view text, std::string_view combine,
                                          bool nonnegative) {
  return PiecewiseCubic(ParseChannel(text, nonnegative), ParseCombine(combine));
}

}  // namespace joda

#endif  // JODA_ATTRIBUTES_H_
