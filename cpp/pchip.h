// Shape-preserving piecewise cubic Hermite interpolation (PCHIP) of one component's control points.
//
// Slopes: Fritsch & Butland (1984) weighted harmonic mean inside, the one-sided three-point formula
// with shape-preserving limiter at the ends: the rule of scipy.interpolate.PchipInterpolator.
#ifndef JODA_PCHIP_H_
#define JODA_PCHIP_H_

#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

namespace joda {

// c0..c3 of the cubic c0 + c1 t + c2 t^2 + c3 t^3.
using Coefficients = std::array<double, 4>;

namespace internal {

inline double Sign(double x) { return (x > 0) - (x < 0); }

// Slope at the end of the curve next to interval h0 (secant m0), followed by h1 (m1).
inline double EndSlope(double h0, double h1, double m0, double m1) {
  const double d = ((2 * h0 + h1) * m0 - h0 * m1) / (h0 + h1);
  if (Sign(d) != Sign(m0)) return 0;
  if (Sign(m0) != Sign(m1) && std::abs(d) > 3 * std::abs(m0)) return 3 * m0;
  return d;
}

}  // namespace internal

// Slopes dy/dx at the n >= 2 knots x (strictly increasing) with values y.
inline std::vector<double> PchipSlopes(const std::vector<double>& x, const std::vector<double>& y) {
  const size_t n = x.size();
  std::vector<double> h(n - 1), m(n - 1);
  for (size_t k = 0; k + 1 < n; ++k) {
    h[k] = x[k + 1] - x[k];
    m[k] = (y[k + 1] - y[k]) / h[k];
  }
  if (n == 2) return {m[0], m[0]};

  std::vector<double> d(n, 0);
  for (size_t k = 1; k < n - 1; ++k) {
    if (internal::Sign(m[k - 1]) * internal::Sign(m[k]) <= 0) continue;  // extremum or flat stays
    const double w1 = 2 * h[k] + h[k - 1];
    const double w2 = h[k] + 2 * h[k - 1];
    d[k] = (w1 + w2) / (w1 / m[k - 1] + w2 / m[k]);
  }
  d[0] = internal::EndSlope(h[0], h[1], m[0], m[1]);
  d[n - 1] = internal::EndSlope(h[n - 2], h[n - 3], m[n - 2], m[n - 3]);
  return d;
}

// The cubic of each interval [x[k], x[k + 1]] in t = x - x[k].
inline std::vector<Coefficients> PchipCubics(const std::vector<double>& x,
                                             const std::vector<double>& y) {
  const std::vector<double> d = PchipSlopes(x, y);
  std::vector<Coefficients> c(x.size() - 1);
  for (size_t k = 0; k < c.size(); ++k) {
    const double h = x[k + 1] - x[k];
    const double m = (y[k + 1] - y[k]) / h;
    c[k] = {y[k], d[k], (3 * m - 2 * d[k] - d[k + 1]) / h, (d[k] + d[k + 1] - 2 * m) / (h * h)};
  }
  return c;
}

}  // namespace joda

#endif  // JODA_PCHIP_H_
