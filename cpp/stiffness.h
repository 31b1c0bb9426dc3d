// How stiff a step may be: the part of a spring that must act implicitly, and the solver's rows.
#ifndef JODA_STIFFNESS_H_
#define JODA_STIFFNESS_H_

#include <algorithm>
#include <cmath>

#include "effects.h"
#include "profile.h"

namespace joda {

// Stiffest spring that stays explicit, as h^2 K / inertia (symplectic Euler is stable below 4).
// What is stiffer goes implicitly into the damping row; what is softer behaves as MuJoCo's own.
inline constexpr double kExplicitStiffness = 1;

// Largest part of the range through which the field alone may move the joint in one step.
inline constexpr double kStride = 0.25;

// The friction row's D over the joint's inertia. Larger is stiffer, but the solver's line search
// (50 evaluations) must still find the narrow zone in which the joint sticks.
inline constexpr double kStiffRow = 1e4;

// The damping row's D over the joint's inertia where there is no damping: as good as no row.
inline constexpr double kIdleRow = 1e-12;

// Whether a step that begins beyond the range ends there too: all along it the channel is constant.
inline bool StaysBeyond(double s, double landing) {
  return (s < 0 && landing < 0) || (s > 1 && landing > 1);
}

// Part of the springs' force that must act implicitly for stability, as a stiffness: what is
// stiffer than kExplicitStiffness at the steepest place that the joint may reach within this step,
// or would move it by more than a fraction of its range (kStride). A constant force needs nothing.
// `field` says whether the conservative channel acts.
inline double ImplicitStiffness(const Profile& p, bool field, double h, double s, double v,
                                double force, double inertia) {
  const double soft = kExplicitStiffness * inertia / (h * h);
  const double gravity = p.effects ? p.effects->gravity.descent : 0;
  const double steepest = field ? p.conservative.MaxStiffness() * p.per_range : 0;
  double stiffness = std::abs(force) * p.per_range * (1 / kStride);
  if (std::max(stiffness, steepest + gravity) <= soft) return 0;
  if (StaysBeyond(s, s + h * (v + h / inertia * force) * p.per_range)) {
    return std::max(0.0, gravity - soft);
  }
  if (steepest + gravity > soft) {
    const double free = h * (std::abs(v) + h / inertia * std::abs(force));
    const double reach = free * p.per_range;
    const double near = p.conservative.MaxStiffness(s - reach, s + reach) * p.per_range;
    stiffness = std::max(stiffness, gravity + std::min(near, steepest));
  }
  return std::max(0.0, stiffness - soft);
}

// The friction row that held with the force `held` within +-bound, and what its bristles add to
// the damping; `part` of them are there.
struct FrictionRow {
  double D, damping;
};

inline FrictionRow StiffenFrictionRow(const Effects* effects, double h, double held, double bound,
                                      double v, double inertia, double part) {
  const double stiff = kStiffRow * inertia;
  if (!effects || !(effects->presliding.stiffness > 0)) return {stiff, 0};
  const Presliding& bristle = effects->presliding;
  const double left = BristleStiffnessScale(bristle, held, bound, v);
  const double stiffness = part * bristle.stiffness;
  const double in_row = BristleStiffnessScaleInRow(left, h, stiffness, inertia);
  return {std::clamp(h * h * stiffness * in_row, kIdleRow * inertia, stiff),
          part * bristle.damping * left};
}

}  // namespace joda

#endif  // JODA_STIFFNESS_H_
