// What the plugin's attributes may say, and the sentence for each mistake.
#include "attributes.h"

#include <doctest/doctest.h>

#include <string>
#include <vector>

namespace joda {
namespace {

std::string Error(const std::string& text, bool nonnegative = false) {
  try {
    ParseChannel(text, nonnegative);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

TEST_CASE("a channel is parsed with labels, white space and a closing semicolon") {
  const auto channel =
      ParseChannel("\n latch: 0 0.5 |0 .5 1| 1 -2e0 3;\t0.5 1 | 0 1 | 4 5 ; ", false);
  REQUIRE(channel.size() == 2);
  CHECK(channel[0].label == "latch");
  CHECK(channel[0].b == 0.5);
  CHECK(channel[0].x == std::vector<double>{0, 0.5, 1});
  CHECK(channel[0].y == std::vector<double>{1, -2, 3});
  CHECK(channel[1].label == "");
  CHECK(channel[1].a == 0.5);
}

TEST_CASE("a label may hold colons") {
  CHECK(ParseChannel("a: b: 0 1 | 0 1 | 0 0", false)[0].label == "a: b");
}

TEST_CASE("an empty text is an empty channel") {
  CHECK(ParseChannel("", false).empty());
  CHECK(ParseChannel(" \n", true).empty());
}

TEST_CASE("combine is sum or max") {
  CHECK(ParseCombine("") == Combine::kSum);
  CHECK(ParseCombine(" sum ") == Combine::kSum);
  CHECK(ParseCombine("max") == Combine::kMax);
  CHECK_THROWS_WITH(ParseCombine("min"), "must be \"sum\" or \"max\", got \"min\"");
}

TEST_CASE("each mistake has its sentence") {
  CHECK(Error("a: 0 1 | 0 1") ==
        "component 1 \"a\": expected \"label: a b | x ... | y ...\", got \"a: 0 1 | 0 1\"");
  CHECK(Error("0 1 | 0 1 | 1 1;; 0 1 | 0 1 | 1 1") ==
        "component 2: expected \"label: a b | x ... | y ...\", got \"\"");
  CHECK(Error("0 | 0 1 | 1 1") ==
        "component 1: expected the two numbers of the interval before the first |");
  CHECK(Error("0 1 | 0 1 | 1 1; b: 0 one | 0 1 | 1 1") ==
        "component 2 \"b\": \"one\" is not a finite number");
  CHECK(Error("0 1 | 0 1 | 1 nan") == "component 1: \"nan\" is not a finite number");
  CHECK(Error("0 1 | 0 1 | 1 1e999") == "component 1: \"1e999\" is not a finite number");
}

TEST_CASE("components that cannot be evaluated are refused") {
  CHECK(Error("0.2 1.2 | 0 1 | 1 1") ==
        "component 1: the interval must satisfy 0 <= a < b <= 1, in normalised joint position");
  CHECK(Error("0.5 0.50000000001 | 0 1 | 1 1") ==
        "component 1: the interval is narrower than 1e-9 of the range");
  CHECK(Error("0 1 | 0 | 1") == "component 1: at least two control points are needed");
  CHECK(Error("0 1 | 0 0.5 1 | 1 2") ==
        "component 1: x has 3 numbers and y has 2; they must be equally many");
  CHECK(Error("0 1 | 0 0.9 | 1 2") == "component 1: x must begin at 0 and end at 1");
}

TEST_CASE("a channel has at most 200 components and 2000 control points") {
  std::string text;
  for (int k = 0; k < 200; ++k) text += "0 1 | 0 1 | 1 1;";
  CHECK(ParseChannel(text, false).size() == 200);
  CHECK(Error(text + "0 1 | 0 1 | 1 1") ==
        "the channel has 201 components; at most 200 are possible");
  const auto curve = [](int points) {
    std::string x, y;
    for (int k = 0; k < points; ++k) {
      x += std::to_string(static_cast<double>(k) / (points - 1)) + " ";
      y += "1 ";
    }
    return "0 1 | " + x + "| " + y + ";";
  };
  CHECK(Error(curve(2000)) == "");
  CHECK(Error(curve(2001)) == "component 1: it has 2001 control points; at most 2000 are possible");
  CHECK(Error(curve(1000) + curve(1000)) == "");
  CHECK(Error(curve(1000) + curve(1001)) ==
        "the channel has 2001 control points; at most 2000 are possible");
}

TEST_CASE("friction and damping must not be negative") {
  CHECK(Error("0 1 | 0 1 | 1 -1") == "");
  CHECK(Error("0 1 | 0 1 | 1 -1", true) ==
        "component 1: values of friction and damping must not be negative");
}

}  // namespace
}  // namespace joda
