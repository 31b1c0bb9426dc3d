#include "joint_dynamics.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <stdexcept>
#include <utility>

#include "config.h"

namespace joda {
namespace {

// Stiffest spring that stays explicit, as h^2 K / inertia (symplectic Euler is stable below 4).
// What is stiffer goes implicitly into the damping row; what is softer behaves as MuJoCo's own.
constexpr double kExplicitStiffness = 1;

// Largest part of the range through which the field alone may move the joint in one step.
constexpr double kStride = 0.25;

// The friction row's D over the joint's inertia. Larger is stiffer, but the solver's line search (50
// evaluations) must still find the narrow zone in which the joint sticks.
constexpr double kStiffRow = 1e4;

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

// Row among [first, last) of this step's constraints that belongs to the object, -1: none. Rows
// come in the order of their objects. `expected` is tried first, then bisection.
int FindRow(const mjData* d, int first, int last, int expected, int type, int id) {
  const auto at = [d](int row) { return std::make_pair(d->efc_type[row], d->efc_id[row]); };
  const auto wanted = std::make_pair(type, id);
  if (first + expected < last && at(first + expected) == wanted) return first + expected;
  int lo = first, hi = last;
  while (lo < hi) {
    const int mid = (lo + hi) / 2;
    if (at(mid) < wanted) {
      lo = mid + 1;
    } else {
      hi = mid;
    }
  }
  return lo < last && at(lo) == wanted ? lo : -1;
}

int FindFrictionRow(const mjData* d, int expected, int dof) {
  return FindRow(d, d->ne, d->ne + d->nf, expected, mjCNSTR_FRICTION_DOF, dof);
}

int FindDampingRow(const mjData* d, int equality) {
  if (equality < 0) return -1;
  return FindRow(d, 0, d->ne, equality, mjCNSTR_EQUALITY, equality);
}

// Makes the row resist the velocity at the end of the step: force = offset - D (a + v / h), within
// +-bound.
void SetRow(const mjModel* m, mjData* d, int row, double stiffness, double bound, double offset) {
  const double D = std::max(stiffness, mjMINVAL), R = 1 / D;
  if (mj_isDual(m)) {  // the dual solvers see R on the diagonal of A + R
    mjtNum* diagonal = d->efc_AR + static_cast<std::ptrdiff_t>(row) * (d->nefc + 1);
    if (mj_isSparse(m)) {
      const int* colind = d->efc_AR_colind + d->efc_AR_rowadr[row];
      const int* found = std::find(colind, colind + d->efc_AR_rownnz[row], row);
      diagonal = d->efc_AR + (found - d->efc_AR_colind);
    }
    *diagonal += R - d->efc_R[row];
  }
  d->efc_D[row] = D;
  d->efc_R[row] = R;
  d->efc_frictionloss[row] = bound;
  // the engine computes the reference a = -B v - K I pos from these right after the passive forces
  d->efc_pos[row] = -offset * R;
  mjtNum* KBIP = d->efc_KBIP + 4 * row;
  KBIP[0] = 1;
  KBIP[1] = 1 / m->opt.timestep;
  KBIP[2] = 1;
  if (d->nisland > 0) {
    const int i = d->map_efc2iefc[row];
    d->iefc_D[i] = D;
    d->iefc_R[i] = R;
    d->iefc_frictionloss[i] = bound;
  }
}

// Part of the field that must act implicitly for stability, as a stiffness: what is stiffer than
// kExplicitStiffness at the steepest place that the joint may reach within this step, or would move
// it by more than a fraction of its range (kStride).
double ImplicitStiffness(const Profile& p, double s, double v, double force, double h,
                         double inverse_inertia) {
  const double per_range = 1 / (p.hi - p.lo);
  const double mobility = h * h * inverse_inertia;  // displacement in a step, per force
  const double soft = kExplicitStiffness / mobility;
  double stiffness = std::abs(force) * per_range / kStride;
  if (p.conservative.MaxDescent() * per_range > soft) {
    const double reach = (h * std::abs(v) + mobility * std::abs(force)) * per_range;
    stiffness = std::max(stiffness, p.conservative.MaxDescent(s - reach, s + reach) * per_range);
  }
  return std::max(0.0, stiffness - soft);
}

// Whether the solver uses the damping row as it is set here: the discrete integrator makes the rows
// anew behind the plugin, and noslip drops their compliance, which would lock the joint.
bool KeepsRows(const mjModel* m) {
  return m->opt.integrator != mjINT_DISCRETE && m->opt.noslip_iterations == 0;
}

}  // namespace

JointDynamics::JointDynamics(const mjModel* m, int instance) {
  for (JointConfig& config : ReadConfig(m, instance)) {
    Joint joint;
    joint.id = config.joint;
    joint.body = m->jnt_bodyid[joint.id];
    joint.dof = m->jnt_dofadr[joint.id];
    joint.qpos = m->jnt_qposadr[joint.id];
    joint.equality = FindEquality(m, joint.id);
    joint.friction_row = CountPositive(m->dof_frictionloss, joint.dof);
    joint.profile = std::move(config.profile);
    joints_.push_back(std::move(joint));
  }
}

void JointDynamics::SetProfile(const mjModel* m, int joint, Profile profile) {
  for (Joint& mine : joints_) {
    if (mine.id != joint) continue;
    CheckFriction(m, joint, profile);
    mine.profile = std::move(profile);
    return;
  }
  throw std::invalid_argument(JointName(m, joint) +
                              " carries no profile; attach one first");
}

void JointDynamics::Compute(const mjModel* m, mjData* d, int instance) const {
  const mjtNum* state = d->plugin_state + m->plugin_stateadr[instance];
  for (size_t k = 0; k < joints_.size(); ++k) {
    if (d->body_awake[joints_[k].body] != mjS_ASLEEP) ComputeJoint(m, d, joints_[k], state + k);
  }
}

void JointDynamics::Advance(const mjModel* m, mjData* d, int instance) const {
  mjtNum* state = d->plugin_state + m->plugin_stateadr[instance];
  for (size_t k = 0; k < joints_.size(); ++k) {
    const Joint& joint = joints_[k];
    if (d->body_awake[joint.body] == mjS_ASLEEP) continue;
    const int row = FindFrictionRow(d, joint.friction_row, joint.dof);
    state[k] = row < 0 ? 0 : d->efc_force[row];
  }
}

void JointDynamics::ComputeJoint(const mjModel* m, mjData* d, const Joint& joint,
                                 const mjtNum* state) {
  const Profile& p = joint.profile;
  const double h = m->opt.timestep, v = d->qvel[joint.dof];
  const double s = (d->qpos[joint.qpos] - p.lo) / (p.hi - p.lo);
  const double inverse_inertia = m->dof_invweight0[joint.dof];

  double force = 0, stiffness = 0, damping = 0;
  if (!(m->opt.disableflags & mjDSBL_SPRING)) {
    force = p.conservative(s).value;
    stiffness = ImplicitStiffness(p, s, v, force, h, inverse_inertia);
  }
  if (!(m->opt.disableflags & mjDSBL_DAMPER)) damping = p.damping(s).value;
  double drag = damping + h * stiffness;
  double friction = p.friction(s).value;

  const int friction_row = FindFrictionRow(d, joint.friction_row, joint.dof);
  if (friction_row >= 0) {
    friction += m->dof_frictionloss[joint.dof];
    const double held = KeepsRows(m) ? std::clamp(*state, -friction, friction) : 0;
    SetRow(m, d, friction_row, kStiffRow / inverse_inertia, friction, held);
    friction = 0;
  } else if (m->opt.disableflags & mjDSBL_FRICTIONLOSS) {
    friction = 0;
  }
  const int damping_row = KeepsRows(m) ? FindDampingRow(d, joint.equality) : -1;
  if (damping_row >= 0) {
    SetRow(m, d, damping_row, h * drag, 0, 0);
    drag = 0;
  } else {
    force /= 1 + h * h * stiffness * inverse_inertia;
  }

  // what has no row becomes a force that at most stops the joint within the step
  if (friction > 0 || drag > 0) {
    const double stop = std::abs(v) / (h * inverse_inertia);
    const double resistance = friction + drag * std::abs(v) / (1 + h * drag * inverse_inertia);
    force -= std::copysign(std::min(resistance, stop), v);
  }
  d->qfrc_passive[joint.dof] += force;
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
  plugin.nstate = +[](const mjModel* m, int instance) { return CountJoints(m, instance); };
  plugin.init = +[](const mjModel* m, mjData* d, int instance) {
    try {
      d->plugin_data[instance] = reinterpret_cast<uintptr_t>(new JointDynamics(m, instance));
      return 0;
    } catch (const std::exception& error) {
      mju_warning("joda.joint_dynamics: instance '%s': %s",
                  m->names + m->name_pluginadr[instance], error.what());
      return -1;
    }
  };
  plugin.destroy = +[](mjData* d, int instance) {
    delete reinterpret_cast<JointDynamics*>(d->plugin_data[instance]);
    d->plugin_data[instance] = 0;
  };
  plugin.copy = +[](mjData* dest, const mjModel*, const mjData* src, int instance) {
    *reinterpret_cast<JointDynamics*>(dest->plugin_data[instance]) =
        *reinterpret_cast<const JointDynamics*>(src->plugin_data[instance]);
  };
  plugin.reset = +[](const mjModel* m, mjtNum* state, void*, int instance) {
    std::fill_n(state, m->plugin_statenum[instance], 0);
  };
  plugin.compute = +[](const mjModel* m, mjData* d, int instance, int) {
    reinterpret_cast<const JointDynamics*>(d->plugin_data[instance])->Compute(m, d, instance);
  };
  plugin.advance = +[](const mjModel* m, mjData* d, int instance) {
    reinterpret_cast<const JointDynamics*>(d->plugin_data[instance])->Advance(m, d, instance);
  };
  mjp_registerPlugin(&plugin);
}

}  // namespace joda

extern "C" int joda_set_profile(const mjModel* m, mjData* d, int joint, double lo, double hi,
                                const char* const texts[6], char* error, int error_size) {
  try {
    const int instance = m->body_plugin[m->jnt_bodyid[joint]];
    int slot = -1;
    mjp_getPlugin("joda.joint_dynamics", &slot);
    if (instance < 0 || m->plugin[instance] != slot) {
      throw std::invalid_argument("its body carries no joda.joint_dynamics; attach a profile first");
    }
    reinterpret_cast<joda::JointDynamics*>(d->plugin_data[instance])
        ->SetProfile(m, joint, joda::ParseProfile("", lo, hi, texts));
    return 0;
  } catch (const std::exception& exception) {
    std::snprintf(error, error_size, "%s", exception.what());
    return -1;
  }
}
