// Shape-preserving piecewise cubic Hermite interpolation (PCHIP) of one component's control points.
//
// Slopes: Fritsch & Butland (1984) weighted harmonic mean inside, the one-sided three-point formula
// with shape-preserving limiter at the ends: the rule of scipy.interpolate.PchipInterpolator.
#ifndef JODA_PCHIP_H_
#define JODA_PCHIP_H_

#include <Eigen/Core>
#include <cmath>

namespace joda {

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
inline Eigen::VectorXd PchipSlopes(const Eigen::VectorXd& x, const Eigen::VectorXd& y) {
  const Eigen::Index n = x.size();
  const Eigen::VectorXd h = x.tail(n - 1) - x.head(n - 1);
  const Eigen::VectorXd m = (y.tail(n - 1) - y.head(n - 1)).cwiseQuotient(h);
  if (n == 2) return Eigen::VectorXd::Constant(2, m[0]);

  Eigen::VectorXd d = Eigen::VectorXd::Zero(n);
  for (Eigen::Index k = 1; k < n - 1; ++k) {
    if (internal::Sign(m[k - 1]) * internal::Sign(m[k]) <= 0) continue;  // extremum or flat stays
    const double w1 = 2 * h[k] + h[k - 1];
    const double w2 = h[k] + 2 * h[k - 1];
    d[k] = (w1 + w2) / (w1 / m[k - 1] + w2 / m[k]);
  }
  d[0] = internal::EndSlope(h[0], h[1], m[0], m[1]);
  d[n - 1] = internal::EndSlope(h[n - 2], h[n - 3], m[n - 2], m[n - 3]);
  return d;
}

// Column k holds c0..c3 of the cubic c0 + c1 t + c2 t^2 + c3 t^3, t = x - x[k], on [x[k], x[k +
// 1]].
inline Eigen::Matrix4Xd PchipCubics(const Eigen::VectorXd& x, const Eigen::VectorXd& y) {
  const Eigen::VectorXd d = PchipSlopes(x, y);
  Eigen::Matrix4Xd c(4, x.size() - 1);
  for (Eigen::Index k = 0; k < c.cols(); ++k) {
    const double h = x[k + 1] - x[k];
    const double m = (y[k + 1] - y[k]) / h;
    c.col(k) << y[k], d[k], (3 * m - 2 * d[k] - d[k + 1]) / h, (d[k] + d[k + 1] - 2 * m) / (h * h);
  }
  return c;
}

}  // namespace joda

#endif  // JODA_PCHIP_H_
