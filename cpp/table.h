// A table of resistance over normalised position and velocity, as data show it.
//
// Along velocity each row is a PCHIP curve, along position the rows are mixed linearly: a mean of
// two rows resists as both do, and PCHIP lies between neighbouring values, so where the table only
// resists what is between its points does, too. Beyond the outermost points the outermost values
// hold; outside the interval there is nothing.
#ifndef JODA_TABLE_H_
#define JODA_TABLE_H_

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "attributes.h"
#include "field.h"

namespace joda {

// Part of the range within which the table fades to nothing, inside an end of its interval that is
// not an end of the range.
inline constexpr double kEdge = 0.02;

// Narrowest gap between a table's velocities (rad/s).
inline constexpr double kLeastStep = 1e-9;

// How many rows a table may have, and how many velocities.
inline constexpr size_t kMostRows = 16, kLeastSpeeds = 3, kMostSpeeds = 24;

class Table {
 public:
  Table() = default;  // zero everywhere

  // The resistance (N m) at rising positions in [0, 1], a row each, and rising velocities (rad/s).
  // Throws std::invalid_argument, one sentence; unless `active`, also where it would add energy.
  Table(std::pair<double, double> interval, std::vector<double> positions,
        std::vector<double> velocities, const std::vector<std::vector<double>>& rows, bool active)
      : a_(interval.first),
        b_(interval.second),
        positions_(std::move(positions)),
        velocities_(std::move(velocities)) {
    Check(rows, active);
    for (const auto& row : rows) {
      const auto cubics = PchipCubics(velocities_, row);
      cubics_.insert(cubics_.end(), cubics.begin(), cubics.end());
    }
  }

  bool Empty() const { return cubics_.empty(); }

  // How many positions there are, with a row each.
  size_t Rows() const { return positions_.size(); }

  // The cubics of the first row, of the second, ..., each about its left velocity.
  const std::vector<Coefficients>& Cubics() const { return cubics_; }

  // Resistance R(s, v) and its slope dR/dv.
  Sample operator()(double s, double v) const {
    if (Empty()) return {};
    s = std::clamp(s, 0.0, 1.0);
    const double present = Fade(a_ == 0, s - a_) * Fade(b_ == 1, b_ - s);
    if (!(present > 0)) return {};
    const size_t n = positions_.size(), k = Below(positions_, s);
    const double part =
        k + 1 < n ? std::clamp((s - positions_[k]) / (positions_[k + 1] - positions_[k]), 0.0, 1.0)
                  : 0;
    const double inside = std::clamp(v, velocities_.front(), velocities_.back());
    const size_t cubics = velocities_.size() - 1;
    const size_t i = std::min(Below(velocities_, inside), cubics - 1);
    const double t = inside - velocities_[i];
    Sample out = internal::Cubic(cubics_[k * cubics + i], t);
    if (part > 0) {
      const Sample next = internal::Cubic(cubics_[(k + 1) * cubics + i], t);
      out.value += part * (next.value - out.value);
      out.slope += part * (next.slope - out.slope);
    }
    return {present * out.value, inside == v ? present * out.slope : 0};
  }

 private:
  // The last knot at or below x, or the first one.
  static size_t Below(const std::vector<double>& knots, double x) {
    const auto above = std::upper_bound(knots.begin() + 1, knots.end(), x);
    return above - knots.begin() - 1;
  }

  // Cubic step over the part of the interval beside its end; `whole` where that is the range's.
  double Fade(bool whole, double inside) const {
    if (whole) return 1;
    const double t = std::clamp(inside / std::min(kEdge, 0.5 * (b_ - a_)), 0.0, 1.0);
    return t * t * (3 - 2 * t);
  }

  static bool Rises(const std::vector<double>& x, double least) {
    for (size_t k = 0; k + 1 < x.size(); ++k) {
      if (!(x[k + 1] - x[k] >= least)) return false;
    }
    return true;
  }

  void Check(const std::vector<std::vector<double>>& rows, bool active) const {
    const auto fail = [](const std::string& what) { throw std::invalid_argument(what); };
    if (!(0 <= a_ && b_ <= 1 && b_ - a_ >= kMinWidth)) {
      fail("the interval must lie in 0 to 1 and be at least 1e-9 wide");
    }
    const auto& x = positions_;
    if (x.empty() || x.size() > kMostRows || !Rises(x, kMinWidth) || x.front() < 0 ||
        x.back() > 1) {
      fail("positions must be 1 to 16 numbers that increase from 0 or more to 1 or less");
    }
    const auto& v = velocities_;
    const size_t n = v.size();
    const auto rest = std::find(v.begin(), v.end(), 0.0);
    if (n < kLeastSpeeds || n > kMostSpeeds || !Rises(v, kLeastStep) || rest == v.end() ||
        v.front() >= 0 || v.back() <= 0 || std::max(-v.front(), v.back()) > kMaxValue) {
      fail("velocities must be 3 to 24 numbers that increase, with 0 between the outermost");
    }
    if (rows.size() != x.size()) {
      fail("it has " + std::to_string(x.size()) + " positions and " + std::to_string(rows.size()) +
           " rows; they must be equally many");
    }
    for (const auto& row : rows) {
      if (row.size() != n) {
        fail("a row has " + std::to_string(row.size()) + " numbers and there are " +
             std::to_string(n) + " velocities; they must be equally many");
      }
      if (row[rest - v.begin()] != 0) fail("a row must have 0 at velocity 0");
      for (size_t k = 0; k < n; ++k) {
        if (!(std::abs(row[k]) <= kMaxValue)) fail("y must lie between -1e15 and 1e15");
        if (!active && internal::Sign(row[k]) * internal::Sign(v[k]) < 0) {
          fail("a row must not have the sign opposite to its velocity unless power=active");
        }
      }
    }
  }

  double a_ = 0, b_ = 1;
  std::vector<double> positions_, velocities_;
  std::vector<Coefficients> cubics_;  // of the first row, of the second, ...
};

}  // namespace joda

#endif  // JODA_TABLE_H_
