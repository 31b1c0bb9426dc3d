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

// The friction row's D over the joint's inertia. Larger is stiffer, but the solver's line search
// (50 evaluations) must still find the narrow zone in which the joint sticks.
constexpr double kStiffRow = 1e4;

// The damping row's D over the joint's inertia where there is no damping: as good as no row.
constexpr double kIdleRow = 1e-12;

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
inline int FindRow(const mjData* d, int first, int last, int expected, int type, int id) {
  int row = first + expected;
  if (row < last && d->efc_type[row] == type && d->efc_id[row] == id) return row;
  int lo = first, hi = last;
  while (lo < hi) {
    row = (lo + hi) / 2;
    if (d->efc_type[row] == type && d->efc_id[row] == id) return row;
    const bool before =
        d->efc_type[row] < type || (d->efc_type[row] == type && d->efc_id[row] < id);
    (before ? lo : hi) = before ? row + 1 : row;
  }
  return -1;
}

// What of the step is the same for all joints.
struct Step {
  double h, per_h;
  bool spring, damper, friction;  // not disabled
  bool keeps_rows;                // the solver will use the rows as they are set here
  bool dual, sparse;

  explicit Step(const mjModel* m)
      : h(m->opt.timestep),
        per_h(1 / h),
        spring(!(m->opt.disableflags & mjDSBL_SPRING)),
        damper(!(m->opt.disableflags & mjDSBL_DAMPER)),
        friction(!(m->opt.disableflags & mjDSBL_FRICTIONLOSS)),
        // the discrete integrator makes the rows anew behind the plugin, and noslip drops the
        // compliance of friction rows
        keeps_rows(m->opt.integrator != mjINT_DISCRETE && m->opt.noslip_iterations == 0),
        dual(m->opt.solver == mjSOL_PGS || m->opt.noslip_iterations > 0),
        sparse(dual && mj_isSparse(m)) {}
};

// Makes the row resist the velocity at the end of the step: force = offset - D (a + v / h), within
// +-bound.
void SetRow(const Step& step, mjData* d, int row, double D, double bound, double offset) {
  const double R = 1 / D;
  if (step.dual) {  // the dual solvers see R on the diagonal of A + R
    mjtNum* diagonal = d->efc_AR + static_cast<std::ptrdiff_t>(row) * (d->nefc + 1);
    if (step.sparse) {
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
  KBIP[1] = step.per_h;
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
double ImplicitStiffness(const Step& step, const Profile& p, double s, double v, double force,
                         double inertia) {
  const double soft = kExplicitStiffness * inertia * step.per_h * step.per_h;
  double stiffness = std::abs(force) * p.per_range * (1 / kStride);
  if (p.conservative.MaxDescent() * p.per_range > soft) {
    const double free = step.h * (std::abs(v) + step.h / inertia * std::abs(force));
    const double reach = free * p.per_range;
    stiffness = std::max(stiffness, p.conservative.MaxDescent(s - reach, s + reach) * p.per_range);
  }
  return std::max(0.0, stiffness - soft);
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
  throw std::invalid_argument(JointName(m, joint) + " carries no profile; attach one first");
}

void JointDynamics::Compute(const mjModel* m, mjData* d, int instance) const {
  const Step step(m);
  const mjtNum* state = d->plugin_state + m->plugin_stateadr[instance];
  for (size_t k = 0; k < joints_.size(); ++k) {
    const Joint& joint = joints_[k];
    if (d->body_awake[joint.body] == mjS_ASLEEP) continue;
    const Profile& p = joint.profile;
    const double h = step.h, inertia = 1 / m->dof_invweight0[joint.dof], v = d->qvel[joint.dof];
    const double s = (d->qpos[joint.qpos] - p.lo) * p.per_range;

    double force = 0, stiffness = 0, drag = 0, friction = 0;
    if (step.spring) {
      force = p.conservative(s).value;
      stiffness = ImplicitStiffness(step, p, s, v, force, inertia);
      drag = h * stiffness;
    }
    if (step.damper) drag += p.damping(s).value;
    if (step.friction) friction = p.friction(s).value;

    const int friction_row = FindFrictionRow(d, joint);
    if (friction_row >= 0) {
      friction += m->dof_frictionloss[joint.dof];
      const double held = step.keeps_rows ? std::clamp(state[k], -friction, friction) : 0;
      SetRow(step, d, friction_row, kStiffRow * inertia, friction, held);
      friction = 0;
    }
    const int damping_row = step.keeps_rows ? FindDampingRow(d, joint) : -1;
    if (damping_row >= 0) {
      SetRow(step, d, damping_row, std::max(h * drag, kIdleRow * inertia), 0, 0);
      drag = 0;
    } else {
      force /= 1 + h * h * stiffness / inertia;
    }

    // what has no row becomes a force that at most stops the joint within the step
    if (friction > 0 || drag > 0) {
      const double stop = inertia * std::abs(v) / h;
      const double resistance = friction + drag * std::abs(v) / (1 + h * drag / inertia);
      force -= std::copysign(std::min(resistance, stop), v);
    }
    d->qfrc_passive[joint.dof] += force;
  }
}

void JointDynamics::Advance(const mjModel* m, mjData* d, int instance) const {
  mjtNum* state = d->plugin_state + m->plugin_stateadr[instance];
  for (size_t k = 0; k < joints_.size(); ++k) {
    const Joint& joint = joints_[k];
    if (d->body_awake[joint.body] == mjS_ASLEEP) continue;
    const int row = FindFrictionRow(d, joint);
    state[k] = row < 0 ? 0 : d->efc_force[row];
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
  plugin.nstate = +[](const mjModel* m, int instance) { return CountJoints(m, instance); };
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
    if (joint < 0 || joint >= m->njnt) {
      throw std::invalid_argument("the model has " + std::to_string(m->njnt) +
                                  " joints, none with id " + std::to_string(joint));
    }
    const int instance = m->body_plugin[m->jnt_bodyid[joint]];
    int slot = -1;
    mjp_getPlugin("joda.joint_dynamics", &slot);
    if (instance < 0 || m->plugin[instance] != slot) {
      throw std::invalid_argument(
          "its body carries no joda.joint_dynamics; attach a profile first");
    }
    reinterpret_cast<joda::JointDynamics*>(d->plugin_data[instance])
        ->SetProfile(m, joint, joda::ParseProfile("", lo, hi, texts));
    return 0;
  } catch (const std::exception& exception) {
    std::snprintf(error, error_size, "%s", exception.what());
    return -1;
  }
}
