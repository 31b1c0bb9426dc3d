#include "joint_simulator.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "stiffness.h"

// The step is compiled into its loop, so that the state stays in registers.
#if defined(_MSC_VER)
#define JODA_INLINE __forceinline
#else
#define JODA_INLINE [[gnu::always_inline]] inline
#endif

namespace joda {
namespace {

// MuJoCo's mjMINIMP, mjMAXIMP and mjMINVAL.
constexpr double kLeastImpedance = 0.0001, kMostImpedance = 0.9999, kLeastWidth = 1e-15;

// Runs that are replayed at once.
constexpr size_t kSideBySide = 2;

// Part of a step that tells how fast the joint slows down before it turns.
constexpr double kProbe = 1e-3;

// Friction: force = offset - stiff a, within +-bound.
struct Friction {
  double offset, stiff, bound;
};

struct Motion {
  double acceleration, held;
};

// Solves mass a = drive + friction(a). The processor divides for both cases at once.
Motion Solve(double mass, double drive, const Friction& friction) {
  const double per_mass = 1 / mass, per_both = 1 / (mass + friction.stiff);
  const double stuck = (drive + friction.offset) * per_both;
  const double held = friction.offset - friction.stiff * stuck;
  if (held > friction.bound) return {(drive + friction.bound) * per_mass, friction.bound};
  if (held < -friction.bound) return {(drive - friction.bound) * per_mass, -friction.bound};
  return {stuck, held};
}

// Part of the damping that acts by the velocity after a step, the rest by that before: a half is of
// second order, but more is needed where a step would damp the velocity beyond rest.
double Implicit(Scheme scheme, double h, double drag, double inertia) {
  if (scheme == Scheme::kEngine || h * drag >= 1e3 * inertia) return 1;
  return h * drag > 2 * inertia ? 1 - inertia / (h * drag) : 0.5;
}

double Impedance(const std::array<double, 5>& solimp, double depth) {
  const auto [dmin, dmax, width, middle, exponent] = solimp;
  if (dmin == dmax || width <= kLeastWidth) return 0.5 * (dmin + dmax);
  const double x = std::min(depth / width, 1.0);
  const double power = std::max(exponent, 1.0);
  const auto raise = [power](double base) {
    return power == 2 ? base * base : std::pow(base, power);
  };
  const double rise =
      x < middle ? middle * raise(x / middle) : 1 - (1 - middle) * raise((1 - x) / (1 - middle));
  return dmin + rise * (dmax - dmin);
}

// A stop's row, as in "Solver parameters" of MuJoCo's documentation: its D, and the acceleration
// back into the range that it aims at.
template <typename Row>
Row StoppedBy(const Stop& stop, double inertia, double h, double depth, double back) {
  const double dmax = stop.solimp[1], impedance = Impedance(stop.solimp, depth);
  double stiffness = -stop.solref[0], damping = -stop.solref[1];
  if (stop.solref[0] > 0) {
    const double constant = std::max(stop.solref[0], 2 * h);  // the engine's "refsafe"
    const double per_second = 1 / (constant * stop.solref[1]);
    stiffness = per_second * per_second;
    damping = 2 / constant;
  }
  stiffness /= dmax * dmax;
  damping /= dmax;
  return {impedance / (1 - impedance) * inertia, stiffness * impedance * depth - damping * back};
}

template <bool kEffects>
bool IsFinite(const JointSimulator::State& state) {
  if (!kEffects) return std::isfinite(state.q + state.v + state.held);
  return std::isfinite(state.q + state.v + state.held + state.loose.gap + state.loose.velocity +
                       state.remembered);
}

}  // namespace

JointSimulator::JointSimulator(const Body& body, const Servo& servo,
                               const char* const texts[kTexts], Scheme scheme)
    : body_(body),
      servo_(servo),
      profile_(ParseProfile("", body.range[0], body.range[1], texts)),
      scheme_(scheme) {
  if (!(body_.range[0] < body_.range[1])) {
    throw std::invalid_argument("the range must be two increasing numbers");
  }
  const auto [low, high] = servo_.limits;
  if (!(low < high)) {
    throw std::invalid_argument("a servo's limits must be two increasing numbers");
  }
  if (!(servo_.delay >= 0)) throw std::invalid_argument("a servo's delay must not be negative");
  if (body_.hinge) {
    heaviest_ = std::hypot(body_.weight[0], body_.weight[1]);
    heaviest_at_ = std::atan2(body_.weight[1], body_.weight[0]);
  }
  if (profile_.effects) body_.inertia += profile_.effects->added_inertia;
  if (!(body_.inertia > 0)) throw std::invalid_argument("the inertia must be positive");
  if (!(body_.row_inertia > 0)) body_.row_inertia = body_.inertia;
  for (Stop* stop : {&body_.stop, &body_.second}) {
    for (const int k : {0, 1, 3}) {
      stop->solimp[k] = std::clamp(stop->solimp[k], kLeastImpedance, kMostImpedance);
    }
  }
}

template <bool kEffects, bool kDriven>
JODA_INLINE void JointSimulator::Advance(double h, double force, double command, Near* near,
                                         State* state) const {
  const Profile& p = profile_;
  const Effects* effects = kEffects ? p.effects.get() : nullptr;
  const double q = state->q, v = state->v, s = (q - p.lo) * p.per_range;
  const double inertia = body_.row_inertia, weight = Weight(q);
  const double servo = kDriven ? Actuate(command, q, v) : 0;
  const double load = weight + force - state->servo;

  const double damping = p.damping.Value(s, &near->damping);
  const double dry = p.friction.Value(s, &near->friction);
  const auto resist = [&](double velocity) {
    if (!effects) return Resistance{damping, {dry, dry}};
    return Resistance{damping + ExtraDamping(*effects, s, velocity),
                      FindFrictionBounds(*effects, dry, s, velocity, load)};
  };
  const Resistance own = resist(v);
  double spring = p.conservative.Value(s, &near->conservative), pushed = force;
  if (effects) spring += GravityForce(effects->gravity, q);
  // without the plugin the engine takes springs as they are before the step, and integrates damping
  // after all rows, as it does an actuator's
  const bool bare = scheme_ == Scheme::kEngine && body_.friction_row[1] > 0;
  double yielding = bare ? 0 : h * ImplicitStiffness(p, true, h, s, v, spring, inertia);
  if (effects) {
    const Push learned = LearnedForce(effects->learned, h, s, v, state->remembered);
    spring += learned.push;
    yielding += learned.drag;
  }

  Passage behind;
  const bool has_load = effects && effects->backlash.load > 0;
  if (effects && effects->backlash.handle > 0) {
    pushed = BacklashForce(effects->backlash, h, force, v, &state->loose);
  } else if (has_load) {
    behind = Meet(effects->backlash, h, body_.inertia, spring + weight + force, v, own, yielding,
                  resist(v + state->loose.velocity), state->loose);
  }
  const FrictionBounds bounds = behind.On(own).dry;
  double drag = behind.On(own).drag;
  yielding *= behind.scale;

  const double bound = bounds.Bound(), held = std::clamp(state->held, -bound, bound);
  const FrictionRow row =
      StiffenFrictionRow(effects, h, held, bound, v, inertia, behind.resistance);
  drag += row.damping;
  Friction friction = {held - row.D * v / h, row.D, bound};
  if (const auto [per_second, stiff] = body_.friction_row; stiff > 0) {
    const double D = stiff * inertia;  // MuJoCo's own: no memory of what held before
    friction = {-D * per_second * v, D, bound};
  }

  const double implicit = bare ? 0 : Implicit(scheme_, h, drag, body_.inertia);
  const double mass = body_.inertia + h * (implicit * drag + yielding);
  const double drive = behind.scale * (spring + weight + pushed) + behind.force + servo +
                       bounds.Shift() - (drag + yielding) * v;
  Motion motion = Solve(mass, drive, friction);
  if (const bool low = q < body_.range[0]; low || q > body_.range[1]) {
    const double sign = low ? 1 : -1, depth = sign * (body_.range[low ? 0 : 1] - q);
    std::array<Limit, 2> rows = {OwnLimit(h, low, depth, sign * v),
                                 SecondLimit(h, low, depth, sign * v)};
    if (rows[0].reference < rows[1].reference) std::swap(rows[0], rows[1]);
    double D = 0, push = 0;  // what aims at more acts first, the other one beside it
    for (const Limit& row : rows) {
      if (row.D == 0 || sign * motion.acceleration >= row.reference) break;
      D += row.D;
      push += row.D * row.reference;
      motion = Solve(mass + D, drive + sign * push, friction);
    }
  }
  const bool free = kDriven && servo_.limits[0] < servo && servo < servo_.limits[1];
  const double later = (bare ? drag : 0) + (free ? servo_.damping : 0);
  const double slowed = later > 0 ? body_.inertia / (body_.inertia + h * later) : 1;
  state->v = v + h * slowed * motion.acceleration;
  state->q = q + h * state->v;
  state->held = motion.held;
  state->servo = servo;
  if (effects && effects->learned.Remembers()) {
    state->remembered = Remember(effects->learned, h, state->v, state->remembered);
  }
  if (has_load) state->loose = Settle(effects->backlash, h, behind, state->v);
}

// In the leapfrog that steps of symplectic Euler are, v is the velocity half a step before q: where
// it turns within the step, friction does so too.
template <bool kEffects, bool kDriven>
void JointSimulator::Turn(double h, double force, double command, const State& before, Near* near,
                          State* state) const {
  State turned = before;
  Advance<kEffects, kDriven>(kProbe * h, force, command, near, &turned);
  const double turns = kProbe * h * before.v / (before.v - turned.v);  // after that time
  if (!(turns > kProbe * h && turns < (1 - kProbe) * h)) return;
  turned = before;
  Advance<kEffects, kDriven>(turns, force, command, near, &turned);
  Advance<kEffects, kDriven>(h - turns, force, command, near, &turned);
  turned.q = before.q + h * turned.v;
  *state = turned;
}

void JointSimulator::Restart(const Start& start, bool fresh, State* state) const {
  if (fresh) *state = {};
  const Effects* effects = profile_.effects.get();
  // a load's velocity is beside the part's as it is
  if (effects && effects->backlash.handle > 0) state->loose.velocity += start.v - state->v;
  state->q = start.q;
  state->v = start.v;
}

void JointSimulator::Replay(double h, const double* force, const double* command, std::int64_t n,
                            const std::vector<Start>& starts, double* before, double* after) const {
  const auto with = [&](auto replay) {
    (this->*replay)(h, force, command, n, starts, before, after);
  };
  const bool driven = command || IsDriven();
  if (profile_.effects) {
    with(driven ? &JointSimulator::ReplayWith<true, true>
                : &JointSimulator::ReplayWith<true, false>);
  } else {
    with(driven ? &JointSimulator::ReplayWith<false, true>
                : &JointSimulator::ReplayWith<false, false>);
  }
}

// Runs do not depend on one another: side by side, a step of one hides the latency of another's.
template <bool kEffects, bool kDriven>
void JointSimulator::ReplayWith(double h, const double* force, const double* command,
                                std::int64_t n, const std::vector<Start>& starts, double* before,
                                double* after) const {
  struct Run {
    size_t start, last;                      // the current one, and the first of the next run
    std::int64_t k = 0, end = 0, first = 0;  // the latter is that of its fresh start
    bool lost = true;
    State state = {};
    Near near = {};
  };
  size_t next = 0;
  const auto begin = [&] {
    Run run = {next, next + 1};
    while (run.last < starts.size() && !starts[run.last].fresh) ++run.last;
    next = run.last;
    return run;
  };
  const double late = servo_.delay / h;
  // Commands are means over a step; what is late by a part of one is part of two of them.
  const auto commanded = [&](const Run& run, std::int64_t k) {
    if (!command) return 0.0;
    const double at = std::max(k - late, static_cast<double>(run.first));
    const auto i = static_cast<std::int64_t>(std::floor(at));
    const double part = at - i;
    return part > 0 ? (1 - part) * command[i] + part * command[i + 1] : command[i];
  };
  const auto restart = [&](Run* run) {
    const Start& start = starts[run->start++];
    if (start.fresh) run->first = start.step;
    Restart(start, start.fresh || run->lost, &run->state);
    if (kDriven) run->state.servo = Actuate(commanded(*run, start.step), start.q, start.v);
    run->lost = false;
    run->k = start.step;
    run->end = run->start < starts.size() ? starts[run->start].step : n;
  };
  const auto lose = [&](Run* run) {
    constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
    after[run->k - 1] = kNan;
    std::fill(before + run->k, before + run->end, kNan);
    std::fill(after + run->k, after + run->end, kNan);
    run->lost = true;
    run->k = run->end;
  };

  std::vector<Run> runs;
  while (next < starts.size() && runs.size() < kSideBySide) runs.push_back(begin());
  while (!runs.empty()) {
    for (size_t i = 0; i < runs.size(); ++i) {
      Run& run = runs[i];
      if (run.k == run.end) {
        if (run.start == run.last) {
          if (next < starts.size()) {
            run = begin();
          } else {
            run = runs.back();
            runs.pop_back();
            --i;
            continue;
          }
        }
        restart(&run);
      }
      const State first = run.state;
      const double wanted = kDriven ? commanded(run, run.k) : 0;
      before[run.k] = first.q;
      Advance<kEffects, kDriven>(h, force[run.k], wanted, &run.near, &run.state);
      if (scheme_ == Scheme::kTrapezoidal && first.v * run.state.v <= 0 &&
          std::abs(first.v) >= kStill) {
        Turn<kEffects, kDriven>(h, force[run.k], wanted, first, &run.near, &run.state);
      }
      after[run.k++] = run.state.q;
      if (!IsFinite<kEffects>(run.state)) lose(&run);
    }
  }
}

double JointSimulator::Weight(double q) const {
  if (!body_.hinge) return body_.weight[0];
  return heaviest_ == 0 ? 0 : heaviest_ * std::cos(q - heaviest_at_);
}

// Whether the actuator may exert a force without a command.
bool JointSimulator::IsDriven() const {
  const auto [low, high] = servo_.limits;
  return servo_.stiffness != 0 || servo_.damping != 0 || low > 0 || high < 0;
}

double JointSimulator::Actuate(double command, double q, double v) const {
  const double wanted = servo_.gain * (command - servo_.stiffness * q) - servo_.damping * v;
  return std::clamp(wanted, servo_.limits[0], servo_.limits[1]);
}

JointSimulator::Limit JointSimulator::OwnLimit(double h, bool low, double depth,
                                               double back) const {
  if (const Effects* effects = profile_.effects.get()) {
    if (const auto& own = low ? effects->stops.low : effects->stops.high) {
      const StopRow stop = FindStopRow(*own, h, body_.row_inertia);
      return {stop.D, stop.stiffness * depth - stop.damping * back};
    }
  }
  return StoppedBy<Limit>(body_.stop, body_.row_inertia, h, depth, back);
}

JointSimulator::Limit JointSimulator::SecondLimit(double h, bool low, double depth,
                                                  double back) const {
  if (body_.second_end != (low ? -1 : 1)) return {0, -HUGE_VAL};
  return StoppedBy<Limit>(body_.second, body_.inertia, h, depth, back);
}

}  // namespace joda
