#include "joint_dynamics.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <optional>
#include <stdexcept>
#include <utility>

#include "config.h"
#include "engine.h"
#include "rows.h"
#include "stiffness.h"

namespace joda {
namespace {

// The equality constraint on the joint alone that is there to carry the damping, -1: none.
int FindEquality(const mjModel* m, int joint) {
  for (int e = 0; e < m->neq; ++e) {
    const char* name = mj_id2name(m, mjOBJ_EQUALITY, e);
    if (m->eq_type[e] == mjEQ_JOINT && m->eq_obj1id[e] == joint && m->eq_obj2id[e] < 0 && name &&
        std::string(name).find("joda_damping") != std::string::npos) {
      return e;
    }
  }
  return -1;
}

int CountPositive(const mjtNum* values, int n) {
  return static_cast<int>(std::count_if(values, values + n, [](mjtNum x) { return x > 0; }));
}

// Generalised force on the joint of gravity, less what gravcomp takes off, and of what is applied
// to it and to the bodies that it moves.
double ExternalForce(const mjModel* m, const mjData* d, int joint, int body) {
  const bool hinge = m->jnt_type[joint] == mjJNT_HINGE;
  const mjtNum* axis = d->xaxis + 3 * joint;
  const auto along = [&](const mjtNum force[3], const mjtNum point[3]) {
    if (!hinge) return mju_dot3(axis, force);
    mjtNum arm[3], torque[3];
    mju_sub3(arm, point, d->xanchor + 3 * joint);
    mju_cross(torque, arm, force);
    return mju_dot3(axis, torque);
  };
  const int dof = m->jnt_dofadr[joint];
  double out = d->qfrc_applied[dof];
  if (!(m->opt.disableflags & mjDSBL_GRAVITY)) {
    out += m->body_subtreemass[body] * along(m->opt.gravity, d->subtree_com + 3 * body);
  }
  if (!m->jnt_actgravcomp[joint]) out += d->qfrc_gravcomp[dof];  // else it is the actuator's
  for (int b = body; b < m->nbody && (b == body || m->body_parentid[b] >= body); ++b) {
    const mjtNum* applied = d->xfrc_applied + 6 * b;
    out += along(applied, d->xipos + 3 * b);
    if (hinge) out += mju_dot3(axis, applied + 3);
  }
  return out;
}

// What has no row becomes a force that at most stops the joint within the step.
double ResistingForce(const FrictionBounds& bounds, double drag, double v, double h,
                      double inertia) {
  const double dry = v < 0 ? bounds.negative : bounds.positive;
  if (!(dry > 0 || drag > 0)) return 0;
  const double stop = inertia * std::abs(v) / h;
  const double resistance = dry + drag * std::abs(v) / (1 + h * drag / inertia);
  return -std::copysign(std::min(resistance, stop), v);
}

bool HasHandle(const Effects* effects) { return effects && effects->backlash.handle > 0; }

bool Remembers(const Effects* effects) { return effects && effects->learned.Remembers(); }

bool HasLoad(const Effects* effects) { return effects && effects->backlash.load > 0; }

// None where MuJoCo has not made the instance, as while it compiles a model and measures the length
// of its muscles.
JointDynamics* Instance(const mjData* d, int instance) {
  return reinterpret_cast<JointDynamics*>(d->plugin_data[instance]);
}

}  // namespace

int JointDynamics::FindFrictionRow(const mjData* d, const Joint& joint) {
  const int last = d->ne + d->nf;
  return FindRow(d, d->ne, last, joint.friction_row, mjCNSTR_FRICTION_DOF, joint.dof);
}

int JointDynamics::FindDampingRow(const mjData* d, const Joint& joint) {
  const int id = joint.equality;
  return id < 0 ? -1 : FindRow(d, 0, d->ne, id, mjCNSTR_EQUALITY, id);
}

JointDynamics::JointDynamics(const mjModel* m, int instance) {
  int state = 0;
  for (JointConfig& config : ReadConfig(m, instance)) {
    Joint joint;
    joint.id = config.joint;
    joint.body = m->jnt_bodyid[joint.id];
    joint.dof = m->jnt_dofadr[joint.id];
    joint.qpos = m->jnt_qposadr[joint.id];
    joint.equality = FindEquality(m, joint.id);
    joint.friction_row = CountPositive(m->dof_frictionloss, joint.dof);
    joint.profile = std::move(config.profile);
    joint.state = state;
    state += CountStates(joint.profile.effects.get());
    joints_.push_back(std::move(joint));
  }
}

void JointDynamics::SetProfile(const mjModel* m, int joint, Profile profile) {
  for (Joint& mine : joints_) {
    if (mine.id != joint) continue;
    CheckProfile(m, joint, profile);
    const Effects *before = mine.profile.effects.get(), *after = profile.effects.get();
    if (CountStates(before) != CountStates(after) || Remembers(before) != Remembers(after)) {
      throw std::invalid_argument(JointName(m, joint) +
                                  " would gain or lose the effect \"backlash\" or "
                                  "\"load_dependent_friction\", or a memory, whose state needs "
                                  "room in the model; attach the profile and compile anew");
    }
    mine.profile = std::move(profile);
    mine.conservative = mine.friction = mine.damping = {};
    mine.load = {};
    return;
  }
  throw std::invalid_argument(JointName(m, joint) + " carries no profile; attach one first");
}

double JointDynamics::SetFrictionRow(const Step& step, mjData* d, int row, const Joint& joint,
                                     double bound, double state, double inertia, double part) {
  const double held = step.keeps_rows ? std::clamp(state, -bound, bound) : 0;
  const Effects* effects = step.keeps_rows ? joint.profile.effects.get() : nullptr;
  const FrictionRow stiffened =
      StiffenFrictionRow(effects, step.h, held, bound, d->qvel[joint.dof], inertia, part);
  SetRow(step, d, row, stiffened.D, bound, held);
  return stiffened.damping;
}

void JointDynamics::SetStops(const Step& step, mjData* d, const Joint& joint) {
  const EndStops& stops = joint.profile.effects->stops;
  if (!stops.low && !stops.high) return;
  ForEachLimit(step.m, d, joint.id, joint.dof, [&](int row, mjtNum side) {
    const std::optional<double>& damping = side > 0 ? stops.low : stops.high;
    if (damping) SetStop(step, d, row, FindStopRow(*damping, step.h, 1 / RowMobility(d, row)));
  });
}

double JointDynamics::UnknownLoad(const mjModel* m, const mjData* d, const Joint& joint) {
  double own = 0;
  for (const int row : {FindFrictionRow(d, joint), FindDampingRow(d, joint)}) {
    if (row >= 0) own += d->efc_force[row];
  }
  ForEachLimit(m, d, joint.id, joint.dof,
               [&](int row, mjtNum side) { own += side * d->efc_force[row]; });
  return d->qfrc_constraint[joint.dof] - own - d->qfrc_actuator[joint.dof];
}

double JointDynamics::PushThroughPlay(const mjData* d, const mjtNum* state, double h,
                                      Joint* joint) {
  joint->handle = {state[1], state[2]};
  const double pushed = joint->applied + state[3];
  return BacklashForce(joint->profile.effects->backlash, h, pushed, d->qvel[joint->dof],
                       &joint->handle) -
         pushed;
}

void JointDynamics::Compute(const mjModel* m, mjData* d, int instance) {
  const Step step(m);
  const mjtNum* state = d->plugin_state + m->plugin_stateadr[instance];
  for (Joint& joint : joints_) {
    if (IsAsleep(d, joint.body)) continue;
    const Profile& p = joint.profile;
    const Effects* effects = p.effects.get();
    const double h = step.h, inertia = 1 / m->dof_invweight0[joint.dof], v = d->qvel[joint.dof];
    const double q = d->qpos[joint.qpos], s = (q - p.lo) * p.per_range;

    double spring = step.spring ? p.conservative.Value(s, &joint.conservative) : 0;
    if (effects) {
      spring += GravityForce(effects->gravity, q);
      SetStops(step, d, joint);
    }
    double yielding = h * ImplicitStiffness(p, step.spring, h, s, v, spring, inertia);
    if (effects && step.damper) {
      const double remembered = Remembers(effects) ? state[MemoryState(joint)] : 0;
      const Push learned = LearnedForce(effects->learned, h, s, v, remembered);
      spring += learned.push;
      yielding += learned.drag;
    }

    const int friction_row = FindFrictionRow(d, joint);
    const double damping = step.damper ? p.damping.Value(s, &joint.damping) : 0;
    double friction = step.friction ? p.friction.Value(s, &joint.friction) : 0;
    if (friction_row >= 0) friction += m->dof_frictionloss[joint.dof];
    const bool rubs_by_load = effects && effects->load > 0;
    const bool needs_external = rubs_by_load || HasLoad(effects);
    const double external = needs_external ? ExternalForce(m, d, joint.id, joint.body) : 0;
    const double load = rubs_by_load ? external + state[LastState(joint)] : 0;
    const auto resist = [&](double velocity) {
      Resistance out = {damping, {friction, friction}};
      if (effects && step.damper) out.drag += ExtraDamping(*effects, s, velocity);
      if (effects && step.friction)
        out.dry = FindFrictionBounds(*effects, friction, s, velocity, load);
      return out;
    };
    Resistance own = resist(v);
    double part = 1;
    joint.applied = d->qfrc_applied[joint.dof];
    double force = 0;
    if (HasLoad(effects)) {
      const Loose behind = {state[joint.state + 1], state[joint.state + 2]};
      const double known = external + state[joint.state + 3];
      joint.load = Meet(effects->backlash, h, m->dof_M0[joint.dof], spring + known, v, own,
                        yielding, resist(v + behind.velocity), behind);
      force = joint.load.force + (joint.load.scale - 1) * known;
      spring *= joint.load.scale;
      yielding *= joint.load.scale;
      part = joint.load.resistance;
      own = joint.load.On(own);
    }
    FrictionBounds bounds = own.dry;
    double drag = own.drag + yielding;
    if (friction_row >= 0) {
      const double bristle = SetFrictionRow(step, d, friction_row, joint, bounds.Bound(),
                                            state[joint.state], inertia, part);
      if (step.damper) drag += bristle;
      force += bounds.Shift();  // as the row is symmetric
      bounds = {0, 0};
    }
    const int damping_row = step.keeps_rows ? FindDampingRow(d, joint) : -1;
    if (damping_row >= 0) {
      SetRow(step, d, damping_row, std::max(h * drag, kIdleRow * inertia), 0, 0);
      drag = 0;
    } else {
      spring /= 1 + h * yielding / inertia;
    }

    force += ResistingForce(bounds, drag, v, h, inertia);
    if (HasHandle(effects)) force += PushThroughPlay(d, state + joint.state, h, &joint);
    d->qfrc_passive[joint.dof] += spring + force;
  }
}

void JointDynamics::Advance(const mjModel* m, mjData* d, int instance) const {
  constexpr int kNoPassive = kNoSpring | kNoDamper;  // both: Compute was not called
  const bool computed = (m->opt.disableflags & kNoPassive) != kNoPassive;
  mjtNum* state = d->plugin_state + m->plugin_stateadr[instance];
  for (const Joint& joint : joints_) {
    if (IsAsleep(d, joint.body)) continue;
    const int row = FindFrictionRow(d, joint);
    state[joint.state] = row < 0 ? 0 : d->efc_force[row];
    const Effects* effects = joint.profile.effects.get();
    if (effects && effects->load > 0) state[LastState(joint)] = UnknownLoad(m, d, joint);
    if (computed && Remembers(effects)) {
      mjtNum& remembered = state[MemoryState(joint)];
      remembered = Remember(effects->learned, m->opt.timestep, d->qvel[joint.dof], remembered);
    }
    if (!computed || !(HasHandle(effects) || HasLoad(effects))) continue;
    const Loose loose = HasHandle(effects) ? joint.handle
                                           : Settle(effects->backlash, m->opt.timestep, joint.load,
                                                    d->qvel[joint.dof]);
    state[joint.state + 1] = loose.gap;
    state[joint.state + 2] = loose.velocity;
    state[joint.state + 3] = d->qfrc_applied[joint.dof] - joint.applied;
  }
}

void JointDynamics::Register() {
  static std::vector<const char*> attributes;
  for (const std::string& name : AttributeNames()) attributes.push_back(name.c_str());

  mjpPlugin plugin;
  mjp_defaultPlugin(&plugin);
  plugin.name = "joda.joint_dynamics";
  plugin.capabilityflags = mjPLUGIN_PASSIVE;
  plugin.nattribute = static_cast<int>(attributes.size());
  plugin.attributes = attributes.data();
  plugin.nstate = +[](const mjModel* m, int instance) { return CountStates(m, instance); };
  plugin.init = +[](const mjModel* m, mjData* d, int instance) {
    try {
      d->plugin_data[instance] = reinterpret_cast<uintptr_t>(new JointDynamics(m, instance));
      return 0;
    } catch (const std::exception& error) {
      mju_warning("joda.joint_dynamics: instance '%s': %s", m->names + m->name_pluginadr[instance],
                  error.what());
      return -1;
    }
  };
  plugin.destroy = +[](mjData* d, int instance) {
    delete Instance(d, instance);
    d->plugin_data[instance] = 0;
  };
  plugin.copy = +[](mjData* dest, const mjModel*, const mjData* src, int instance) {
    *Instance(dest, instance) = *Instance(src, instance);
  };
  plugin.reset = +[](const mjModel* m, mjtNum* state, void*, int instance) {
    std::fill_n(state, m->plugin_statenum[instance], 0);
  };
  plugin.compute = +[](const mjModel* m, mjData* d, int instance, int) {
    if (JointDynamics* own = Instance(d, instance)) own->Compute(m, d, instance);
  };
  plugin.advance = +[](const mjModel* m, mjData* d, int instance) {
    if (const JointDynamics* own = Instance(d, instance)) own->Advance(m, d, instance);
  };
  mjp_registerPlugin(&plugin);
}

}  // namespace joda

extern "C" int joda_slot() {
  int slot = -1;
  mjp_getPlugin("joda.joint_dynamics", &slot);
  return slot;
}

extern "C" int joda_set_profile(const mjModel* m, mjData* d, int joint, double lo, double hi,
                                const char* const texts[7], char* error, int error_size) {
  try {
    if (joint < 0 || joint >= m->njnt) {
      throw std::invalid_argument("the model has " + std::to_string(m->njnt) +
                                  " joints, none with id " + std::to_string(joint));
    }
    const int instance = m->body_plugin[m->jnt_bodyid[joint]];
    if (instance < 0 || m->plugin[instance] != joda_slot()) {
      throw std::invalid_argument(
          "its body carries no joda.joint_dynamics; attach a profile first");
    }
    joda::Instance(d, instance)->SetProfile(m, joint, joda::ParseProfile("", lo, hi, texts));
    return 0;
  } catch (const std::exception& exception) {
    std::snprintf(error, error_size, "%s", exception.what());
    return -1;
  }
}
