// A learned force: its text, its table, its memory, in closed form.
#include <doctest/doctest.h>

#include <cmath>
#include <stdexcept>
#include <string>

#include "effects.h"

namespace joda {
namespace {

Learned Parse(const std::string& text) { return ParseEffects("learned_force" + text).learned; }

std::string Error(const std::string& text) {
  const std::string prefix = "effect 1 \"learned_force\": ";
  try {
    Parse(text);
  } catch (const std::invalid_argument& error) {
    const std::string out = error.what();
    return out.rfind(prefix, 0) == 0 ? out.substr(prefix.size()) : out;
  }
  return "";
}

// Resistance 2 v at s = 0.2 and before, 6 v at s = 0.6 and behind.
const char* const kLinear = ": 0 1 | 0.2 0.6 | -1 -0.5 0 2 | -2 -1 0 4 | -6 -3 0 12";
// Friction of 3 N that has come up at 0.01 m/s.
const char* const kSteep = ": 0 1 | 0 | -1 -0.01 0 0.01 1 | -3 -3 0 3 3";

TEST_CASE("a learned force is parsed") {
  const Learned learned = Parse(std::string(" memory=speed gain=-0.5 time=3") + kLinear);
  CHECK(learned.memory == Memory::kSpeed);
  CHECK(learned.gain == -0.5);
  CHECK(learned.time == 3);
  CHECK(!learned.table.Empty());
  CHECK(Parse(kLinear).memory == Memory::kNone);
  CHECK(Parse(kLinear).time == 1);
  CHECK(ParseEffects("").learned.table.Empty());
}

TEST_CASE("a table is PCHIP along velocity and linear along position") {
  const Table table = Parse(kLinear).table;
  for (const double v : {-1.0, -0.7, -1e-12, 0.0, 0.3, 1.99}) {
    CAPTURE(v);
    CHECK(table(-3, v).value == doctest::Approx(2 * v));
    CHECK(table(0.2, v).value == doctest::Approx(2 * v));
    CHECK(table(0.3, v).value == doctest::Approx(3 * v));
    CHECK(table(0.3, v).slope == doctest::Approx(3));
    CHECK(table(0.9, v).value == doctest::Approx(6 * v));
  }
  CHECK(table(0, 5).value == doctest::Approx(4));
  CHECK(table(0, 5).slope == 0);
  CHECK(table(0, -5).value == doctest::Approx(-2));
  // Fritsch and Butland between 0, 1 and 4 at 0, 1 and 2: slopes 0 and 1.5
  const Table bent = Parse(": 0 1 | 0 | -2 -1 0 1 2 | 0 0 0 1 4").table;
  CHECK(bent(0, 0.5).value == doctest::Approx(0.5 - 1.5 / 8));
  CHECK(bent(0, 0.5).slope == doctest::Approx(1.5 - 1.5 / 4));
}

TEST_CASE("a table fades to nothing inside the ends of its interval") {
  const Table table = Parse(": 0.3 1 | 0 | -1 0 1 | -2 0 2").table;
  CHECK(table(0.3, 1).value == 0);
  CHECK(table(0.1, 1).value == 0);
  CHECK(table(0.31, 1).value == doctest::Approx(1));
  CHECK(table(0.32, 1).value == doctest::Approx(2));
  CHECK(table(7, 1).value == doctest::Approx(2));
  const Table narrow = Parse(": 0.3 0.31 | 0 | -1 0 1 | -2 0 2").table;
  CHECK(narrow(0.305, 1).value == doctest::Approx(2));
}

TEST_CASE("a step never pushes a part beyond rest, and settles at a steady speed") {
  for (const double h : {0.0005, 0.002, 0.01, 0.02}) {
    CAPTURE(h);
    const Learned steep = Parse(kSteep);
    double v = 0.1;
    for (int k = 0; k < 2000; ++k) {
      const Push now = LearnedForce(steep, h, 0, v, 0);
      const double next = (v + h * now.push) / (1 + h * now.drag);
      REQUIRE(next <= v);
      REQUIRE(next >= 0);
      v = next;
    }
    CHECK(v < 1e-12);
    // nothing below 0.5 m/s, then 2000 N s/m: the explicit force alone would swing
    const Learned late = Parse(": 0 1 | 0 | -2 -0.5 0 0.5 2 | -3000 0 0 0 3000");
    for (int k = 0; k < 4000; ++k) {
      const Push now = LearnedForce(late, h, 0, v, 0);
      v = (v + h * (now.push + 5)) / (1 + h * now.drag);
    }
    CHECK(late.table(0, v).value == doctest::Approx(5).epsilon(1e-9));
  }
}

TEST_CASE("a memory of position is Maxwell's spring and damper in series") {
  const Learned maxwell = Parse(" memory=position gain=40 time=0.5: 0 1 | 0 | -1 0 1 | 0 0 0");
  const double h = 0.01;
  double stretch = 0;
  for (int k = 0; k < 50; ++k) {  // at 3 rad/s for one time constant
    const Push now = LearnedForce(maxwell, h, 0, 3, stretch);
    stretch = Remember(maxwell, h, 3, stretch);
    CHECK(now.push - now.drag * 3 == doctest::Approx(-40 * stretch));
  }
  CHECK(stretch == doctest::Approx(3 * 0.5 * (1 - std::exp(-1))));
  for (int k = 0; k < 100; ++k) stretch = Remember(maxwell, h, 0, stretch);
  CHECK(stretch == doctest::Approx(3 * 0.5 * (1 - std::exp(-1)) * std::exp(-2)));
  // a step gives the joint no more than the spring had, whatever its length
  for (const double step : {1e-4, 0.01, 0.3, 5.0}) {
    for (const double v : {-3.0, -0.2, 0.0, 0.7, 4.0}) {
      const Push now = LearnedForce(maxwell, step, 0, v, stretch);
      const double after = Remember(maxwell, step, v, stretch);
      const double work = step * v * (now.push - now.drag * v);
      CHECK(work <= 20 * (stretch * stretch - after * after) + 1e-12);
    }
  }
}

TEST_CASE("a memory of speed changes the table, and never turns it around") {
  const Learned warms = Parse(std::string(" memory=speed gain=-0.5 time=2") + kLinear);
  CHECK(Remember(warms, 0.1, -3, 1) == doctest::Approx(3 - 2 * std::exp(-0.05)));
  const Push now = LearnedForce(warms, 0.1, 0, 0.7, 0.4);
  CHECK(now.drag == doctest::Approx(2 * 0.8));
  CHECK(now.push == doctest::Approx(0));
  CHECK(LearnedForce(warms, 0.1, 0, 0.7, 3).drag == 0);
}

TEST_CASE("an active table may push") {
  const Learned motor = Parse(" power=active: 0 1 | 0 | -1 0 1 | 2 0 -2");
  const Push now = LearnedForce(motor, 0.1, 0, 0.5, 0);
  CHECK(now.push == doctest::Approx(1));
  CHECK(now.drag == 0);
}

TEST_CASE("each mistake in a learned force has its sentence") {
  const std::string table = ": 0 1 | 0 | -1 0 1 | 0 0 0";
  CHECK(Error("").rfind("expected its table, \": a b | positions | velocities | row | ...\"", 0) ==
        0);
  CHECK(Error(": 0 1 | 0 | -1 0 1").rfind("expected its table", 0) == 0);
  CHECK(Error(": 0 | 0 | -1 0 1 | 0 0 0") ==
        "expected the two numbers of the interval before the first |");
  CHECK(Error(": 0.5 0.4 | 0 | -1 0 1 | 0 0 0") ==
        "the interval must lie in 0 to 1 and be at least 1e-9 wide");
  for (const char* const positions : {"", "0.5 0.4", "0.5 1.1", "-0.1 1"}) {
    CHECK(Error(std::string(": 0 1 | ") + positions + " | -1 0 1 | 0 0 0 | 0 0 0") ==
          "positions must be 1 to 16 numbers that increase from 0 or more to 1 or less");
  }
  for (const char* const velocities :
       {"0 1", "-1 1 2", "0 1 2", "-2 -1 0", "-1 0 0", "-1e16 0 1"}) {
    CHECK(Error(std::string(": 0 1 | 0 | ") + velocities + " | 0 0 0") ==
          "velocities must be 3 to 24 numbers that increase, with 0 between the outermost");
  }
  CHECK(Error(": 0 1 | 0 1 | -1 0 1 | 0 0 0") ==
        "it has 2 positions and 1 rows; they must be equally many");
  CHECK(Error(": 0 1 | 0 | -1 0 1 | 0 0") ==
        "a row has 2 numbers and there are 3 velocities; they must be equally many");
  CHECK(Error(": 0 1 | 0 | -1 0 1 | 0 1 1") == "a row must have 0 at velocity 0");
  CHECK(Error(": 0 1 | 0 | -1 0 1 | 0 0 2e15") == "y must lie between -1e15 and 1e15");
  CHECK(Error(": 0 1 | 0 | -1 0 1 | 1 0 1") ==
        "a row must not have the sign opposite to its velocity unless power=active");
  CHECK(Error(" gain=1" + table) == "gain is a memory's; give memory");
  CHECK(Error(" memory=position gain=-1" + table) == "gain must not be negative");
  CHECK(Error(" memory=speed time=0" + table) == "time must be positive");
  CHECK(Error(" memory=heat" + table) == "memory must be none or position or speed, got \"heat\"");
  CHECK(Error(" power=some" + table) == "power must be passive or active, got \"some\"");
}

}  // namespace
}  // namespace joda
