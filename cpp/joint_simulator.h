// One joint by itself, all others held: the step of MuJoCo with the plugin, in closed form.
//
// The step's constraint problem has one unknown then, the acceleration, and at most three rows: dry
// friction, damping, an end of the range. Its optimality condition is increasing and piecewise
// linear, so that its solution can be written down.
#ifndef JODA_JOINT_SIMULATOR_H_
#define JODA_JOINT_SIMULATOR_H_

#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "effects.h"
#include "profile.h"

namespace joda {

// The stop at an end of a range, in MuJoCo's solver parameters.
struct Stop {
  std::array<double, 2> solref = {0.02, 1};
  std::array<double, 5> solimp = {0.9, 0.95, 0.001, 0.5, 2};
};

// What of a joint is not in its profile. Units are those of a hinge; for a slide read N, m and kg.
struct Body {
  std::array<double, 2> range;   // joint positions at s = 0 and s = 1
  double inertia;                // without the effects' added inertia (kg m^2)
  double row_inertia;            // what MuJoCo's rows take for it, <= 0: all of it (kg m^2)
  std::array<double, 2> weight;  // hinge: cos q and sin q of gravity's torque; slide: force and 0
  bool hinge;
  Stop stop;  // of both of the range's ends
  // Of MuJoCo's own friction row: damping (1/s), and stiffness over inertia; 0: the plugin's row.
  // Where the engine's steps have it, the joint's damping is the engine's own too.
  std::array<double, 2> friction_row = {0, 0};
  // What acts besides at one end, as the limit of a tendon does: -1 the low one, 1 the high one.
  int second_end = 0;
  Stop second = {};
};

// How steps stand for the motion between them.
enum class Scheme {
  kEngine,      // as MuJoCo steps with the plugin
  kTrapezoidal  // second order: damping acts by the mean velocity of a step, and friction turns
                // when the joint does, not with the step
};

// An actuator on the joint: gain (command - stiffness q) - damping v, within limits.
struct Servo {
  double gain = 1;
  double stiffness = 0, damping = 0;
  std::array<double, 2> limits = {-HUGE_VAL, HUGE_VAL};
  double delay = 0;  // of commands (s)
};

class JointSimulator {
 public:
  // What a step begins with.
  struct State {
    double q = 0, v = 0;
    double held = 0;   // friction force of the step before
    double servo = 0;  // the actuator's
    Loose loose;
    double remembered = 0;  // by a learned force
  };

  // Where a stretch of steps begins, and whether the joint has forgotten what was before.
  struct Start {
    std::int64_t step;
    double q, v;
    bool fresh;
  };

  // Throws std::invalid_argument, one sentence; the texts are as in ParseProfile.
  JointSimulator(const Body& body, const Servo& servo, const char* const texts[kTexts],
                 Scheme scheme = Scheme::kEngine);

  // Steps through n forces and as many commands (null: zeros), which come later by the delay; what
  // was before a fresh start is its first command. before[k] and after[k] are the positions at both
  // ends of step k. At each start position and velocity are set; unless fresh, friction's memory
  // stays and the handle or the load as it is beside the part. What follows a number that is not
  // finite is NaN until the next start, which then is fresh. Starts are in increasing order, the
  // first one at step 0.
  void Replay(double h, const double* force, const double* command, std::int64_t n,
              const std::vector<Start>& starts, double* before, double* after) const;

 private:
  // A row of the end that is overstepped: D (0: none), and the acceleration back into the range
  // that it aims at.
  struct Limit {
    double D, reference;
  };

  // The pieces of the channels that a run found last.
  struct Near {
    PiecewiseCubic::Piece conservative, friction, damping;
  };

  // What acts in steps: compiled for each, as most joints have neither effects nor an actuator.
  template <bool kEffects, bool kDriven>
  void ReplayWith(double h, const double* force, const double* command, std::int64_t n,
                  const std::vector<Start>& starts, double* before, double* after) const;

  void Restart(const Start& start, bool fresh, State* state) const;

  // One step of h under the applied force and the actuator's command.
  template <bool kEffects, bool kDriven>
  void Advance(double h, double force, double command, Near* near, State* state) const;

  // The same where the joint turns within the step, with friction that turns when it does.
  template <bool kEffects, bool kDriven>
  void Turn(double h, double force, double command, const State& before, Near* near,
            State* state) const;

  bool IsDriven() const;
  double Weight(double q) const;
  double Actuate(double command, double q, double v) const;
  // The rows of an end: how deep the joint is in it, and how fast it comes out.
  Limit OwnLimit(double h, bool low, double depth, double back) const;
  Limit SecondLimit(double h, bool low, double depth, double back) const;

  Body body_;
  // Of a hinge's weight: its largest torque, and the position of that.
  double heaviest_ = 0, heaviest_at_ = 0;
  Servo servo_;
  Profile profile_;
  Scheme scheme_;
};

}  // namespace joda

#endif  // JODA_JOINT_SIMULATOR_H_
