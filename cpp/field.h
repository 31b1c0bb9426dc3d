// A channel of a joint's profile: local PCHIP components, merged at load into one piecewise cubic.
//
// The channel is a function of the normalised joint position s = (q - lo) / (hi - lo). A component
// covers its closed interval [a, b]; outside it contributes nothing. Components are summed, or the
// largest of those that cover s is taken. Where none covers s the channel is zero. Beyond the range
// (s < 0 or s > 1) the channel keeps the value it has at that end.
#ifndef JODA_FIELD_H_
#define JODA_FIELD_H_

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "pchip.h"

namespace joda {

struct Component {
  std::string label;
  double a, b;            // interval in s, 0 <= a < b <= 1
  std::vector<double> x;  // control points in u = (s - a) / (b - a), from 0 to 1
  std::vector<double> y;  // values in physical units
};

enum class Combine { kSum, kMax };

struct Sample {
  double value = 0;
  double slope = 0;  // derivative with respect to s
};

namespace internal {

inline Sample Cubic(const Coefficients& c, double t) {
  return {((c[3] * t + c[2]) * t + c[1]) * t + c[0], (3 * c[3] * t + 2 * c[2]) * t + c[1]};
}

// p + factor q.
inline Coefficients Plus(Coefficients p, const Coefficients& q, double factor) {
  for (size_t i = 0; i < p.size(); ++i) p[i] += factor * q[i];
  return p;
}

// The same cubic about the origin t0.
inline Coefficients Shift(const Coefficients& c, double t0) {
  const Sample at = Cubic(c, t0);
  return {at.value, at.slope, 3 * c[3] * t0 + c[2], c[3]};
}

// Interior zeros of c1 + 2 c2 t + 3 c3 t^2 on (0, w): the turning points of the cubic.
inline std::vector<double> TurningPoints(const Coefficients& c, double w) {
  std::vector<double> out;
  const double qa = 3 * c[3], qb = 2 * c[2], qc = c[1];
  const double disc = qb * qb - 4 * qa * qc;
  if (disc < 0) return out;
  const double q = -0.5 * (qb + (qb < 0 ? -1 : 1) * std::sqrt(disc));
  for (const double t : {q / qa, qc / q}) {
    if (t > 0 && t < w) out.push_back(t);  // false for the infinities and NaN of a lower degree
  }
  std::sort(out.begin(), out.end());
  return out;
}

// Interior sign changes of the cubic on (0, w), to rounding: bisection between turning points. A
// turning point at zero is among them, as the cubic may cross with a level tangent.
inline std::vector<double> Roots(const Coefficients& c, double w) {
  std::vector<double> ends = TurningPoints(c, w), out;
  ends.insert(ends.begin(), 0);
  ends.push_back(w);
  for (size_t i = 0; i + 1 < ends.size(); ++i) {
    double lo = ends[i], hi = ends[i + 1];
    const double sign = Sign(Cubic(c, lo).value);
    if (sign == 0 && i > 0) out.push_back(lo);
    if (sign * Sign(Cubic(c, hi).value) >= 0) continue;
    for (int k = 0; k < 100 && lo < hi; ++k) {
      const double mid = 0.5 * (lo + hi);
      if (mid == lo || mid == hi) break;
      (sign == Sign(Cubic(c, mid).value) ? lo : hi) = mid;
    }
    out.push_back(hi);
  }
  return out;
}

// One component's cubics in s: knots t (size n + 1) and coefficients about each left knot.
struct Local {
  std::vector<double> t;
  std::vector<Coefficients> c;

  explicit Local(const Component& component)
      : t(component.x), c(PchipCubics(component.x, component.y)) {
    const double w = component.b - component.a;
    for (double& knot : t) knot = component.a + w * knot;
    t.front() = component.a;
    t.back() = component.b;
    for (Coefficients& cubic : c) {
      cubic[1] *= 1 / w;
      cubic[2] *= 1 / (w * w);
      cubic[3] *= 1 / (w * w * w);
    }
  }

  bool Covers(double s) const { return t.front() <= s && s <= t.back(); }

  // The cubic around s (inside the interval), about the origin s0.
  Coefficients About(double s, double s0) const {
    const auto right = std::upper_bound(t.begin(), t.end(), s);
    const size_t k = std::min<size_t>(right - t.begin(), c.size()) - 1;
    return Shift(c[k], s0 - t[k]);
  }
};

// Combines the cubics' samples at one point: their sum, or the largest.
inline Sample CombineSamples(const std::vector<Sample>& samples, Combine combine) {
  Sample out;
  for (size_t i = 0; i < samples.size(); ++i) {
    if (combine == Combine::kSum) {
      out.value += samples[i].value;
      out.slope += samples[i].slope;
    } else if (i == 0 || samples[i].value > out.value) {
      out = samples[i];
    }
  }
  return out;
}

}  // namespace internal

// One channel, ready to evaluate. Immutable after construction.
class PiecewiseCubic {
 public:
  // A cubic with all that its evaluation reads, in one line of the processor's cache.
  struct alignas(64) Piece {
    double left = 0, right = 0;  // it covers [left, right)
    Coefficients c = {};         // about the left end
    Sample at_left;              // exact, also where closed intervals meet

    bool Covers(double s) const { return left <= s && s < right; }

    Sample At(double s) const { return s == left ? at_left : internal::Cubic(c, s - left); }
  };

  PiecewiseCubic() = default;  // zero everywhere

  PiecewiseCubic(const std::vector<Component>& components, Combine combine) {
    std::vector<internal::Local> locals(components.begin(), components.end());
    std::vector<double> breaks;
    for (const auto& local : locals) breaks.insert(breaks.end(), local.t.begin(), local.t.end());
    std::sort(breaks.begin(), breaks.end());
    breaks.erase(std::unique(breaks.begin(), breaks.end()), breaks.end());
    if (breaks.empty()) return;

    const auto add = [&](double left, const Coefficients& c) {
      pieces_.push_back({left, 0, c, AtKnot(locals, combine, left)});
    };
    for (size_t i = 0; i + 1 < breaks.size(); ++i) {
      AddPiece(locals, combine, breaks[i], breaks[i + 1], add);
    }
    add(breaks.back(), {});  // for the value at the right end
    pieces_.back().right = std::numeric_limits<double>::infinity();
    for (size_t k = 0; k < Count(); ++k) {
      pieces_[k].right = pieces_[k + 1].left;
      max_stiffness_ = std::max(max_stiffness_, Descent(pieces_[k]));
    }
    first_ = pieces_.front().left;
    last_ = pieces_.back().left;
    FillBuckets();
  }

  // Value and slope at s; s beyond [0, 1] is held at the end.
  Sample operator()(double s) const {
    const bool beyond = s < 0 || s > 1;
    s = std::clamp(s, 0.0, 1.0);
    if (!(first_ <= s && s <= last_)) return {};  // also where s is not a number
    Sample out = pieces_[Find(s)].At(s);
    if (beyond) out.slope = 0;
    return out;
  }

  // The value at s, where it is asked for again and again: `last` is a copy of the piece that was
  // found last, or an empty one.
  double Value(double s, Piece* last) const {
    s = std::clamp(s, 0.0, 1.0);
    if (!last->Covers(s)) {
      if (!(first_ <= s && s <= last_)) return 0;
      *last = pieces_[Find(s)];
    }
    return last->At(s).value;
  }

  // Steepest descent max(-dF/ds, 0) met anywhere on the channel: its largest stiffness.
  double MaxStiffness() const { return max_stiffness_; }

  // The same over the pieces that touch [lo, hi].
  double MaxStiffness(double lo, double hi) const {
    const size_t n = Count();
    double out = 0;
    if (hi < first_ || lo > last_) return out;
    for (size_t k = lo > first_ ? std::min(Find(lo), n - 1) : 0; k < n && pieces_[k].left <= hi;
         ++k) {
      out = std::max(out, Descent(pieces_[k]));
    }
    return out;
  }

  // Whether no component is there.
  bool Empty() const { return pieces_.empty(); }

  // Whether it is zero everywhere.
  bool IsZero() const {
    return std::all_of(pieces_.begin(), pieces_.end(), [](const Piece& piece) {
      return std::all_of(piece.c.begin(), piece.c.end(), [](double x) { return x == 0; });
    });
  }

  // Ends of the cubics, one more than there are cubics.
  std::vector<double> Knots() const {
    std::vector<double> out;
    for (const Piece& piece : pieces_) out.push_back(piece.left);
    return out;
  }

  // The cubics, each about its left end.
  std::vector<Coefficients> Cubics() const {
    std::vector<Coefficients> out;
    for (size_t k = 0; k < Count(); ++k) out.push_back(pieces_[k].c);
    return out;
  }

  // Their largest descents max(-dF/ds, 0).
  std::vector<double> Descents() const {
    std::vector<double> out;
    for (size_t k = 0; k < Count(); ++k) out.push_back(Descent(pieces_[k]));
    return out;
  }

 private:
  static constexpr size_t kBuckets = 32;

  // How many cubics there are.
  size_t Count() const { return pieces_.empty() ? 0 : pieces_.size() - 1; }

  // Index of the last piece that begins at or before s, for s within the knots: from the bucket of
  // s onwards.
  size_t Find(double s) const {
    size_t k = buckets_[static_cast<size_t>(s * kBuckets)];
    while (pieces_[k].right <= s) ++k;
    return k;
  }

  // First guesses for Find: the last piece at or before the left edge of each bucket of [0, 1].
  void FillBuckets() {
    size_t k = 0;
    for (size_t i = 0; i <= kBuckets; ++i) {
      const double s = static_cast<double>(i) / kBuckets;
      while (pieces_[k].right <= s) ++k;
      buckets_[i] = static_cast<int>(k);
    }
  }

  // Largest -dF/ds on the piece (or 0): a parabola, so at an end or at its vertex.
  static double Descent(const Piece& piece) {
    const double w = piece.right - piece.left;
    const Coefficients& c = piece.c;
    double out = std::max({0.0, -c[1], -internal::Cubic(c, w).slope});
    const double vertex = -c[2] / (3 * c[3]);
    if (vertex > 0 && vertex < w) out = std::max(out, -internal::Cubic(c, vertex).slope);
    return out;
  }

  static Sample AtKnot(const std::vector<internal::Local>& locals, Combine combine, double s) {
    std::vector<Sample> samples;
    for (const auto& local : locals) {
      if (local.Covers(s)) samples.push_back(internal::Cubic(local.About(s, s), 0));
    }
    return internal::CombineSamples(samples, combine);
  }

  // Emits the cubics of the open interval (left, right), on which no component starts or ends.
  template <typename Add>
  static void AddPiece(const std::vector<internal::Local>& locals, Combine combine, double left,
                       double right, const Add& add) {
    const double w = right - left, middle = left + 0.5 * w;
    std::vector<Coefficients> active;
    for (const auto& local : locals) {
      if (local.Covers(middle)) active.push_back(local.About(middle, left));
    }
    if (combine == Combine::kSum || active.size() < 2) {
      Coefficients sum = {};
      for (const auto& c : active) sum = internal::Plus(sum, c, 1);
      add(left, sum);
      return;
    }
    std::vector<double> cuts = {0, w};
    for (size_t i = 0; i < active.size(); ++i) {
      for (size_t j = 0; j < i; ++j) {
        const auto roots = internal::Roots(internal::Plus(active[i], active[j], -1), w);
        cuts.insert(cuts.end(), roots.begin(), roots.end());
      }
    }
    std::sort(cuts.begin(), cuts.end());
    double last = -1;
    for (size_t k = 0; k + 1 < cuts.size(); ++k) {
      const double from = left + cuts[k], to = left + cuts[k + 1];
      if (!(to > from) || from <= last) continue;  // two crossings within rounding
      const double t = 0.5 * (cuts[k] + cuts[k + 1]);
      const auto top = std::max_element(
          active.begin(), active.end(), [t](const Coefficients& p, const Coefficients& q) {
            return internal::Cubic(p, t).value < internal::Cubic(q, t).value;
          });
      add(from, internal::Shift(*top, cuts[k]));
      last = from;
    }
  }

  double first_ = 1, last_ = 0;  // where the pieces begin and end; none: nothing is between
  double max_stiffness_ = 0;
  std::vector<Piece> pieces_;  // increasing; the last is only the end of the one before
  std::array<int, kBuckets + 1> buckets_{};
};

}  // namespace joda

#endif  // JODA_FIELD_H_
