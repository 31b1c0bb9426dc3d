// The field against SciPy's numbers and closed forms.
#include "field.h"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <vector>

#include "attributes.h"

namespace joda {
namespace {

struct Case {
  std::string name, combine, text;
  std::vector<double> s, value, slope;
};

// All cases of the goldens file; make_field.py describes its format.
std::vector<Case> ReadGoldens(const std::string& path) {
  std::vector<Case> out;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    std::istringstream rest(line);
    std::string key;
    rest >> key;
    const auto numbers = [&] {
      return std::vector<double>(std::istream_iterator<double>(rest), {});
    };
    if (key == "case") {
      out.emplace_back();
      rest >> out.back().name >> out.back().combine;
    } else if (key == "text") {
      std::getline(rest, out.back().text);
    } else if (key == "s") {
      out.back().s = numbers();
    } else if (key == "value") {
      out.back().value = numbers();
    } else {
      out.back().slope = numbers();
    }
  }
  return out;
}

double Largest(const std::vector<double>& values) {
  double out = 0;
  for (const double value : values) out = std::max(out, std::abs(value));
  return out;
}

Component Line(double a, double b, double from, double to) {
  return {"", a, b, {0, 1}, {from, to}};
}

TEST_CASE("the field agrees with SciPy's golden vectors") {
  const auto cases = ReadGoldens(JODA_GOLDENS);
  REQUIRE(cases.size() > 20);
  for (const Case& golden : cases) {
    CAPTURE(golden.name);
    REQUIRE(golden.s.size() == golden.value.size());
    REQUIRE(golden.s.size() == golden.slope.size());
    const PiecewiseCubic channel = ParsePiecewiseCubic(golden.text, golden.combine, false);
    for (size_t i = 0; i < golden.s.size(); ++i) {
      CAPTURE(golden.s[i]);
      const Sample sample = channel(golden.s[i]);
      CHECK(std::abs(sample.value - golden.value[i]) <= 1e-12 * Largest(golden.value));
      CHECK(std::abs(sample.slope - golden.slope[i]) <= 1e-12 * Largest(golden.slope));
    }
  }
}

TEST_CASE("an empty channel is zero") {
  CHECK(PiecewiseCubic()(0.5).value == 0);
  CHECK(PiecewiseCubic({}, Combine::kMax)(0.5).value == 0);
  CHECK(PiecewiseCubic().MaxStiffness() == 0);
}

TEST_CASE("a sum of lines is exact in closed form") {
  const PiecewiseCubic sum({Line(0, 1, 1, 3), Line(0.25, 0.75, 8, 0)}, Combine::kSum);
  CHECK(sum(0.125).value == 1.25);
  CHECK(sum(0.25).value == 9.5);
  CHECK(sum(0.5).value == 6);
  CHECK(sum(0.5).slope == -14);
  CHECK(sum(0.75).value == 2.5);
  CHECK(sum(0.875).value == 2.75);
}

TEST_CASE("a maximum of lines changes over exactly at their crossing") {
  const PiecewiseCubic max({Line(0, 1, 0, 4), Line(0, 1, 3, 0)}, Combine::kMax);
  const double crossing = 3.0 / 7;
  REQUIRE(max.Knots().size() == 3);
  CHECK(max.Knots()[1] == doctest::Approx(crossing).epsilon(1e-15));
  CHECK(max(0.25).value == 2.25);
  CHECK(max(0.25).slope == -3);
  CHECK(max(0.5).value == 2);
  CHECK(max(0.5).slope == 4);
}

TEST_CASE("a maximum changes over where the curves cross with a common tangent") {
  // cubics through (0, -1), (1/2, 0), (1, 1): 8 (t - 1/2)^3 against 0
  const Coefficients c = {-1, 6, -12, 8};
  const auto roots = internal::Roots(c, 1);
  REQUIRE(!roots.empty());
  for (const double root : roots) CHECK(root == doctest::Approx(0.5).epsilon(1e-5));
}

TEST_CASE("a maximum takes only components that cover the position") {
  const PiecewiseCubic max({Line(0.2, 0.5, -2, -2), Line(0.5, 0.8, -1, -3)}, Combine::kMax);
  CHECK(max(0.1).value == 0);
  CHECK(max(0.3).value == -2);
  CHECK(max(0.5).value == -1);
  CHECK(max(0.9).value == 0);
}

TEST_CASE("beyond the range the end's value is held, with slope 0") {
  const PiecewiseCubic line({Line(0, 1, 1, 3)}, Combine::kSum);
  CHECK(line(-2).value == 1);
  CHECK(line(-2).slope == 0);
  CHECK(line(0).slope == 2);
  CHECK(line(1).slope == 2);
  CHECK(line(7).value == 3);
  CHECK(line(7).slope == 0);
}

TEST_CASE("no component covers a position that is not a number") {
  const PiecewiseCubic line({Line(0, 1, 1, 3)}, Combine::kSum);
  CHECK(line(std::nan("")).value == 0);
  CHECK(line(INFINITY).value == 3);
  CHECK(line.MaxStiffness(std::nan(""), std::nan("")) == 0);
}

TEST_CASE("all three crossings of two cubics are found") {
  // 100 (t - 0.1) (t - 0.5) (t - 0.6)
  const auto roots = internal::Roots({-3, 41, -120, 100}, 1);
  REQUIRE(roots.size() == 3);
  CHECK(roots[0] == doctest::Approx(0.1).epsilon(1e-12));
  CHECK(roots[1] == doctest::Approx(0.5).epsilon(1e-12));
  CHECK(roots[2] == doctest::Approx(0.6).epsilon(1e-12));
}

TEST_CASE("the largest descent is met at the vertex of a cubic's slope") {
  // the smooth step from 1 to 0 has its steepest slope, -1.5, in the middle
  const Component step = {"", 0, 1, {0, 0.25, 0.75, 1}, {1, 1, 0, 0}};
  const PiecewiseCubic channel({step}, Combine::kSum);
  CHECK(channel.MaxStiffness() == doctest::Approx(3).epsilon(1e-14));
  CHECK(channel.MaxStiffness(0, 0.2) == 0);
  CHECK(channel.MaxStiffness(0.2, 0.3) == channel.MaxStiffness());
  CHECK(channel.MaxStiffness(2, 3) == 0);
  CHECK(PiecewiseCubic({Line(0, 1, 0, 1)}, Combine::kSum).MaxStiffness() == 0);
}

}  // namespace
}  // namespace joda
