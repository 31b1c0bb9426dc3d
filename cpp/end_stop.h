// An end of the range that throws the joint back: the solver's row of a stop with a restitution.
//
// MuJoCo's limit is a spring and a damper that only push ("Solver parameters" in its
// documentation). With the stiffness times h^2 and the damping times h, both per unit of inertia,
// speed after over speed before a knock depends neither on the speed nor on the timestep h.
#ifndef JODA_END_STOP_H_
#define JODA_END_STOP_H_

#include <algorithm>
#include <optional>

namespace joda {

// How many steps a knock lasts without damping: enough for the ratio to hardly depend on where
// within a step the stop is met, few enough for a stop to be hard.
inline constexpr int kImpactSteps = 16;
inline constexpr double kStopStiffness =  // (pi / kImpactSteps)^2
    9.869604401089358 / (kImpactSteps * kImpactSteps);
inline constexpr double kStopImpedance = 0.99;

// Damping of the stops that have a restitution of their own; an end without one is the scene's.
struct EndStops {
  std::optional<double> low, high;
  bool both = false;  // the scene's limit has one restitution for both ends
};

// Speed after a knock that begins with speed 1, as MuJoCo steps it; mean over where within a step
// the stop is met.
inline double Rebound(double damping) {
  constexpr int kPhases = 16;
  double sum = 0;
  for (int k = 0; k < kPhases; ++k) {
    double x = -(k + 0.5) / kPhases, v = -1;
    for (int step = 0; step < 20 * kImpactSteps && (x < 0 || v < 0); ++step) {
      if (x < 0) v += std::max(-kStopStiffness * x - damping * v, 0.0);
      x += v;
    }
    sum += v;
  }
  return sum / kPhases;
}

// The damping for a restitution in [0, 1); at most 1, which stops the joint within one step.
inline double StopDamping(double restitution) {
  if (restitution <= Rebound(1)) return 1;
  double lo = 0, hi = 1;
  for (int k = 0; k < 40; ++k) {
    const double middle = 0.5 * (lo + hi);
    (Rebound(middle) > restitution ? lo : hi) = middle;
  }
  return 0.5 * (lo + hi);
}

// A stop's row: its D (kg m^2), and the stiffness (1/s^2) and damping (1/s) of the acceleration
// that it aims at. It makes the share kStopImpedance of that, which the damping makes up for.
struct StopRow {
  double D, stiffness, damping;
};

inline StopRow FindStopRow(double damping, double h, double inertia) {
  return {kStopImpedance / (1 - kStopImpedance) * inertia, kStopStiffness / (h * h),
          damping / (kStopImpedance * h)};
}

}  // namespace joda

#endif  // JODA_END_STOP_H_
