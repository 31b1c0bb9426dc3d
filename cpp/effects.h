// The effects of a joint beyond its three channels: what it has, and their laws.
//
// s is the normalised joint position, v the velocity before the step. Units are those of a hinge
// (N m, rad, kg m^2); for a slide read N, m and kg. See docs/physics.md for the laws' place in the
// step.
#ifndef JODA_EFFECTS_H_
#define JODA_EFFECTS_H_

#include <algorithm>
#include <cmath>
#include <string_view>

#include "end_stop.h"
#include "field.h"
#include "table.h"

namespace joda {

// A curve for each direction of motion.
struct Directed {
  PiecewiseCubic positive, negative;

  const PiecewiseCubic& Along(double v) const { return v < 0 ? negative : positive; }
};

struct Stribeck {
  PiecewiseCubic excess;  // static minus Coulomb friction (N m)
  double velocity = 1;    // Stribeck velocity (rad/s)
  double exponent = 2;
};

struct Presliding {
  double stiffness = 0;  // of the bristle (N m/rad), 0: none
  double damping = 0;    // of the bristle (N m s/rad)
  double breakaway = 1;  // 0: Dahl's model, 1: elastic-perfectly plastic (Prandtl)
};

struct GravityOffset {
  double sin = 0, cos = 0;  // torque sin sin(q) + cos cos(q) of a hinge (N m)
  double force = 0;         // of a slide (N)
  double descent = 0;       // largest stiffness, hypot(sin, cos)
};

// Play before the joint's part, which a handle then moves, or behind it, which then moves a load:
// the one has inertia, the other none.
struct Backlash {
  double play = 0;    // total width (rad), 0: none
  double handle = 0;  // inertia of the handle, on which the applied force acts (kg m^2)
  double load = 0;    // inertia of the load, out of the joint's (kg m^2)
  double share = 0;   // of the joint's friction and damping, that acts on the load
};

enum class Memory { kNone, kPosition, kSpeed };

// What no formula says: a table, and one number that follows the joint's motion.
struct Learned {
  Table table;
  Memory memory = Memory::kNone;
  double time = 1;  // constant of the memory (s)
  double gain = 0;  // of position: stiffness (N m/rad); of speed: change of the table (s/rad)

  bool Remembers() const { return memory != Memory::kNone; }
};

// All effects of one joint; what it lacks is zero. Immutable after parsing.
struct Effects {
  Directed damping;            // added to the damping while moving that way (N m s/rad)
  Directed quadratic;          // times |v|, added to the damping (N m s^2/rad^2)
  Directed asymmetry;          // added to the friction against motion that way (N m)
  Stribeck stribeck;           // added to the friction
  double load = 0;             // times |load|, added to the friction
  Presliding presliding;       // of the friction row
  GravityOffset gravity;       // a passive force
  Backlash backlash;           // before or behind the part
  EndStops stops;              // of the range
  Learned learned;             // a force on the part
  double added_inertia = 0;    // that the joint's armature must hold (kg m^2)
  const char* needs_row = "";  // an effect that needs the friction row, "": none of them does

  bool IsAsymmetric() const { return !asymmetry.positive.Empty() || !asymmetry.negative.Empty(); }
};

// Throws std::invalid_argument, one sentence; the text is the one of the attribute "effects".
Effects ParseEffects(std::string_view text);

// Largest friction while moving in positive and in negative direction, both >= 0.
struct FrictionBounds {
  double positive, negative;

  // The friction lies in [-positive, negative]: a symmetric bound about a constant force.
  double Bound() const { return 0.5 * (positive + negative); }
  double Shift() const { return 0.5 * (negative - positive); }
};

// Speed below which a joint counts as still: what a stuck joint has left is rounding, and so would
// be its direction (rad/s).
inline constexpr double kStill = 1e-9;

// What the effects add to the damping (N m s/rad).
inline double ExtraDamping(const Effects& e, double s, double v) {
  if (std::abs(v) < kStill) return 0;
  const double out = e.damping.Along(v)(s).value + e.quadratic.Along(v)(s).value * std::abs(v);
  return std::max(0.0, out);  // a curve's zero may be -1e-17
}

// Friction above Coulomb's that fades as the joint moves: e(s) exp(-(|v| / vs)^exponent).
inline double StribeckFriction(const Stribeck& stribeck, double s, double v) {
  const double excess = stribeck.excess(s).value;
  if (!(excess > 0)) return 0;
  const double x = std::abs(v) / stribeck.velocity;
  if (stribeck.exponent == 2) return excess * std::exp(-x * x);
  if (stribeck.exponent == 1) return excess * std::exp(-x);
  return excess * std::exp(-std::pow(x, stribeck.exponent));
}

// The bounds where the channel, the joint's own frictionloss included, gives `friction`.
inline FrictionBounds FindFrictionBounds(const Effects& e, double friction, double s, double v,
                                         double load) {
  const double both = friction + StribeckFriction(e.stribeck, s, v) + e.load * std::abs(load);
  return {std::max(0.0, both + e.asymmetry.positive(s).value),
          std::max(0.0, both + e.asymmetry.negative(s).value)};
}

// How far the bristle gives plastically (0 to 1) where it carries the part r of its largest force
// against the motion (Dupont et al. 2002).
inline double DupontAlpha(double breakaway, double r) {
  constexpr double kPi = 3.141592653589793;
  if (breakaway == 0 || r >= 1) return 1;
  if (r <= breakaway) return 0;
  return 0.5 + 0.5 * std::sin(kPi * (r - 0.5 * (1 + breakaway)) / (1 - breakaway));
}

// The least part of the bristle that is left: while it slips.
inline constexpr double kMinBristleStiffness = 1e-6;

// Part of the bristle's stiffness and damping that is left where it holds with the force `held`
// within +-bound: 1 at rest, 2 for Dahl's model at a reversal, (almost) 0 while it slips.
inline double BristleStiffnessScale(const Presliding& presliding, double held, double bound,
                                    double v) {
  const double against = std::abs(v) < kStill ? 0 : -held * internal::Sign(v);
  const double r = bound > 0 ? std::clamp(against / bound, -1.0, 1.0) : 0;
  return std::max(kMinBristleStiffness, 1 - DupontAlpha(presliding.breakaway, r) * r);
}

// The same for a step of the solver's row, which must also stop a part that turns back within the
// step. While it slips the row's bound gives the law's force, so that all of the stiffness can be
// there; else what is too stiff for the step to resolve (h^2 stiffness / inertia > 20) keeps 5 %.
inline double BristleStiffnessScaleInRow(double left, double h, double stiffness, double inertia) {
  if (left <= kMinBristleStiffness) return 1;
  return std::max(left, 0.05 - inertia / (h * h * stiffness));
}

// The force at the joint position q.
inline double GravityForce(const GravityOffset& gravity, double q) {
  if (gravity.descent == 0) return gravity.force;
  return gravity.force + gravity.sin * std::sin(q) + gravity.cos * std::cos(q);
}

// A force of which part acts implicitly: push - drag v at the end of the step.
struct Push {
  double push = 0, drag = 0;  // N m, N m s/rad
};

// What the learned force does in a step of h that begins at velocity v with `remembered`. Its drag
// is at least the table's chord through rest and at least its slope: with the one a step never
// pushes the part beyond rest, with the other it comes to a steady speed without swinging about it.
inline Push LearnedForce(const Learned& learned, double h, double s, double v, double remembered) {
  Sample r = learned.table(s, v);
  if (learned.memory == Memory::kSpeed) {
    const double factor = std::max(0.0, 1 + learned.gain * remembered);
    r = {factor * r.value, factor * r.slope};
  }
  const double chord = std::abs(v) < kStill ? r.slope : r.value / v;
  const double drag = std::max({0.0, chord, r.slope});
  Push out = {drag * v - r.value, drag};
  if (learned.memory == Memory::kPosition) {  // Maxwell's: -gain times the stretch after the step
    const double gone = -std::expm1(-h / learned.time);
    out.push -= learned.gain * (1 - gone) * remembered;
    out.drag += learned.gain * gone * learned.time;
  }
  return out;
}

// What is remembered after a step of h, at whose end the part moves at v: of position the stretch
// of a spring whose other end follows (rad), of speed its mean (rad/s).
inline double Remember(const Learned& learned, double h, double v, double remembered) {
  const double gone = -std::expm1(-h / learned.time);
  const double toward = learned.memory == Memory::kPosition ? learned.time * v : std::abs(v);
  return remembered + gone * (toward - remembered);
}

// What is loose beside the part: its position minus the part's (within +-play / 2), and its
// velocity, a load's minus the part's.
struct Loose {
  double gap = 0, velocity = 0;
};

// Moves the handle, on which `applied` acts, by a step beside the part that moves at v; returns the
// force that it exerts on the part.
inline double BacklashForce(const Backlash& backlash, double h, double applied, double v,
                            Loose* handle) {
  const double half = 0.5 * backlash.play;
  const double gap = std::clamp(handle->gap, -half, half);  // the profile may have been replaced
  const double free = handle->velocity + h * applied / backlash.handle;
  const double next = std::clamp(gap + h * (free - v), -half, half);
  const double velocity = v + (next - gap) / h;
  const double force = applied - backlash.handle * (velocity - handle->velocity) / h;
  *handle = {next, velocity};
  return force;
}

// What resists a motion: damping (N m s/rad) and dry friction.
struct Resistance {
  double drag;
  FrictionBounds dry;

  Resistance Part(double share) const {
    return {share * drag, {share * dry.positive, share * dry.negative}};
  }
};

// Velocity after a step of a mass by itself, which friction may stop.
inline double Coast(double inertia, double h, double force, const Resistance& against, double v) {
  const double per_mass = 1 / (inertia + h * against.drag);
  const double free = per_mass * (inertia * v + h * force), dry = per_mass * h;
  return free > 0 ? std::max(0.0, free - dry * against.dry.positive)
                  : std::min(0.0, free + dry * against.dry.negative);
}

// What a load makes of the joint's step. Where the part moves alone, MuJoCo's inertia, which is
// that of both, moves as the part does if all that acts on the part is larger by `scale`.
struct Passage {
  double side = 0;        // of the part, at which it moves the load: 1, -1, or 0 for none
  double scale = 1;       // of the known forces on the part
  double resistance = 1;  // of friction and damping
  double force = 0;       // besides: the load's blow (N m)
  double gap = 0;         // the load's before the step
  double velocity = 0;    // of the load after the step, by itself

  Resistance On(const Resistance& own) const { return own.Part(resistance); }
};

// Largest part of the joint's inertia that a load may be.
inline constexpr double kHeaviestLoad = 0.95;

// Whether part and load move together in the step that begins with the part at v: if they
// overlapped after a step by themselves. `force` is what is known to act on the part, `own` and
// `other` are the joint's resistance at the part's velocity and at the load's, `spring` is
// resistance of the part alone.
inline Passage Meet(const Backlash& backlash, double h, double inertia, double force, double v,
                    const Resistance& own, double spring, const Resistance& other,
                    const Loose& load) {
  const double half = 0.5 * backlash.play, share = backlash.share;
  const double part = std::max(inertia - backlash.load, (1 - kHeaviestLoad) * inertia);
  Passage out;
  out.gap = std::clamp(load.gap, -half, half);
  out.velocity = Coast(backlash.load, h, 0, other.Part(share), v + load.velocity);
  Resistance alone = own.Part(1 - share);
  alone.drag += spring;
  const double next = out.gap + h * (out.velocity - Coast(part, h, force, alone, v));
  if (std::abs(next) >= half) {
    out.side = internal::Sign(next);
    out.force = backlash.load * load.velocity / h;
  } else {
    out.scale = inertia / part;
    out.resistance = out.scale * (1 - share);
  }
  return out;
}

// The load after the step, at whose end the part moves at v. Where they met, it is left behind only
// if it is slower, as where a stop has thrown the part back.
inline Loose Settle(const Backlash& backlash, double h, const Passage& passage, double v) {
  const double half = 0.5 * backlash.play, ahead = passage.velocity - v;
  if (passage.side * ahead >= 0 && passage.side != 0) return {passage.side * half, 0};
  return {std::clamp(passage.gap + h * ahead, -half, half), ahead};
}

}  // namespace joda

#endif  // JODA_EFFECTS_H_
