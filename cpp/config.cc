#include "config.h"

#include <algorithm>
#include <cstdio>
#include <iterator>
#include <stdexcept>
#include <utility>

#include "attributes.h"
#include "engine.h"

namespace joda {
namespace {

constexpr int kMaxJoints = 6;  // hinges and slides that one MuJoCo body can have
constexpr const char* kRange = "range";

const char* Value(const mjModel* m, int instance, const std::string& key) {
  const char* value = mj_getPluginConfig(m, instance, key.c_str());
  return value ? value : "";
}

bool IsConfigured(const mjModel* m, int instance, const std::string& prefix) {
  return *Value(m, instance, prefix + kRange) ||
         std::any_of(std::begin(kTextNames), std::end(kTextNames),
                     [&](const char* key) { return *Value(m, instance, prefix + key); });
}

// Before the attributes of the joint at `place` in its body; -1 stands for the only one.
std::string Prefix(int place) { return place < 0 ? "" : std::to_string(place) + "."; }

std::string Name(const mjModel* m, int type, int id, const std::string& kind) {
  const char* name = mj_id2name(m, type, id);
  return name ? kind + " '" + name + "'" : "unnamed " + kind + " " + std::to_string(id);
}

int FindBody(const mjModel* m, int instance) {
  const int* first = m->body_plugin;
  const int* last = m->body_plugin + m->nbody;
  const auto count = std::count(first, last, instance);
  if (count != 1) {
    throw std::invalid_argument(
        count == 0 ? "no body refers to it; put <plugin instance=\"...\"/> into the one body that "
                     "the joint moves"
                   : std::to_string(count) +
                         " bodies refer to it, as in a <replicate>; each needs an instance of its "
                         "own, as joda attach writes them");
  }
  return static_cast<int>(std::find(first, last, instance) - first);
}

// The joint at `place` among those of the body; -1 stands for the only one.
int FindJoint(const mjModel* m, int body, int place) {
  const int count = m->body_jntnum[body];
  const std::string has =
      Name(m, mjOBJ_BODY, body, "body") + " has " + std::to_string(count) + " joints";
  if (place < 0 && count > 1) {
    throw std::invalid_argument(has +
                                "; write each attribute with the joint's place in the body in "
                                "front, as in \"0.friction\"");
  }
  if (std::max(place, 0) >= count) {
    throw std::invalid_argument(has + ", none at place " + std::to_string(std::max(place, 0)));
  }
  const int joint = m->body_jntadr[body] + std::max(place, 0);
  const int type = m->jnt_type[joint];
  if (type != mjJNT_HINGE && type != mjJNT_SLIDE) {
    throw std::invalid_argument(JointName(m, joint) + " is a " +
                                (type == mjJNT_BALL ? "ball" : "free") +
                                " joint; a profile needs a hinge or a slide");
  }
  return joint;
}

// Joint positions at s = 0 and s = 1: the attribute, or else the joint's own limits.
std::pair<double, double> ParseRange(const mjModel* m, int joint, const std::string& key,
                                     const char* text) try {
  const mjtNum* own = m->jnt_range + 2 * joint;
  if (!*text && own[0] < own[1]) return {own[0], own[1]};
  if (!*text) {
    throw std::invalid_argument(JointName(m, joint) +
                                " has no range; give it one, or write this attribute");
  }
  const auto range = ParseNumbers(text);
  if (range.size() != 2 || !(range[0] < range[1])) {
    throw std::invalid_argument("expected two increasing numbers, got " + internal::Quote(text));
  }
  return {range[0], range[1]};
} catch (const std::invalid_argument& error) {
  throw std::invalid_argument("attribute \"" + key + "\": " + error.what());
}

std::string Print(double value) {
  char out[32];
  std::snprintf(out, sizeof out, "%g", value);
  return out;
}

void CheckFriction(const mjModel* m, int joint, const Profile& profile) {
  const bool has_row = m->dof_frictionloss[m->jnt_dofadr[joint]] > 0;
  const std::string effect = profile.effects ? profile.effects->needs_row : "";
  std::string what;
  if (!effect.empty()) what = "the effect \"" + effect + "\"";
  if (!profile.friction.IsZero()) what = "a friction channel";
  if (has_row || what.empty()) return;
  throw std::invalid_argument(JointName(m, joint) + " has " + what +
                              " but no friction row in the solver; add "
                              "frictionloss=\"1e-12\" to the joint");
}

// Whether the degree of freedom has a friction row of its own as stiff as it can be: about -1 / h
// and 0.9999. The discrete integrator uses that one, not the plugin's.
bool HoldsInDiscrete(const mjModel* m, int dof) {
  const mjtNum* solref = m->dof_solref + mjNREF * dof;
  const double steps = -solref[1] * m->opt.timestep;
  return solref[0] <= 0 && 0.5 <= steps && steps <= 1.001 && m->dof_solimp[mjNIMP * dof] >= 0.999;
}

void CheckGravityOffset(const mjModel* m, int joint, const GravityOffset& gravity) {
  const bool hinge = m->jnt_type[joint] == mjJNT_HINGE;
  if (hinge ? gravity.force == 0 : gravity.descent == 0) return;
  throw std::invalid_argument(JointName(m, joint) + " is a " + (hinge ? "hinge" : "slide") +
                              "; its effect \"gravity_offset\" takes " +
                              (hinge ? "sin and cos" : "force"));
}

void CheckInertia(const mjModel* m, int joint, const Effects& effects) {
  const int dof = m->jnt_dofadr[joint];
  if (m->dof_armature[dof] < 0.999999 * effects.added_inertia) {
    const std::string needed = Print(effects.added_inertia);
    throw std::invalid_argument(JointName(m, joint) + " has armature " +
                                Print(m->dof_armature[dof]) + ", less than its effect " +
                                "\"added_inertia\" of " + needed + "; write armature=\"" + needed +
                                "\" on the joint");
  }
  const auto check = [&](const char* what, double part, double whole, double most,
                         const char* told) {
    if (part <= most * whole) return;
    throw std::invalid_argument(JointName(m, joint) + " has inertia " + Print(whole) +
                                ", and the " + what + " of its effect \"backlash\" " + Print(part) +
                                "; at most " + told + " is possible");
  };
  const Backlash& backlash = effects.backlash;
  // a heavier handle would make the contact, which is explicit, unstable
  check("handle", backlash.handle, 1 / m->dof_invweight0[dof], 0.5, "half");
  check("load", backlash.load, m->dof_M0[dof], kHeaviestLoad, "0.95 of it");
}

// Throws where the integrator, or noslip, gives the effect no place in which it would be right.
void CheckIntegrator(const mjModel* m, int joint, const Effects& effects) {
  const bool discrete = IsDiscrete(m);
  const bool noslip = m->opt.noslip_iterations > 0;
  const auto fail = [&](const char* effect, const std::string& what) {
    throw std::invalid_argument(JointName(m, joint) + " has the effect \"" + effect + "\", " +
                                what);
  };
  if (effects.backlash.play > 0 && m->opt.integrator == mjINT_RK4) {
    fail("backlash", std::string("whose ") + (effects.backlash.load > 0 ? "load" : "handle") +
                         " would have half its inertia with integrator=\"RK4\"; choose "
                         "integrator=\"implicitfast\"");
  }
  if (effects.presliding.stiffness > 0 && (discrete || noslip)) {
    fail("presliding_friction",
         std::string("which does nothing with ") +
             (discrete ? "integrator=\"discrete\"; choose integrator=\"implicitfast\""
                       : "noslip_iterations; set them to 0"));
  }
  if ((effects.stops.low || effects.stops.high) && discrete) {
    fail("end_stop_restitution",
         "which at one end alone does nothing with integrator=\"discrete\"; choose "
         "integrator=\"implicitfast\"");
  }
  if (effects.IsAsymmetric() && discrete && !HoldsInDiscrete(m, m->jnt_dofadr[joint])) {
    fail("asymmetric_friction",
         "which makes it creep at rest with integrator=\"discrete\"; write solreffriction=\"0 " +
             Print(-1 / m->opt.timestep) + "\" solimpfriction=\"0.9999 0.9999\" on the joint");
  }
}

}  // namespace

const std::vector<std::string>& AttributeNames() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> out;
    for (int place = -1; place < kMaxJoints; ++place) {
      out.push_back(Prefix(place) + kRange);
      for (const char* key : kTextNames) out.push_back(Prefix(place) + key);
    }
    return out;
  }();
  return names;
}

std::string JointName(const mjModel* m, int joint) { return Name(m, mjOBJ_JOINT, joint, "joint"); }

void CheckProfile(const mjModel* m, int joint, const Profile& profile) {
  CheckFriction(m, joint, profile);
  if (!profile.effects) return;
  CheckGravityOffset(m, joint, profile.effects->gravity);
  CheckInertia(m, joint, *profile.effects);
  CheckIntegrator(m, joint, *profile.effects);
}

int CountStates(const mjModel* m, int instance) {
  int count = 0;
  for (int place = -1; place < kMaxJoints; ++place) {
    const std::string prefix = Prefix(place);
    if (!IsConfigured(m, instance, prefix)) continue;
    count += CountStates(Value(m, instance, prefix + kTextNames[kTexts - 1]));
  }
  return count;
}

std::vector<JointConfig> ReadConfig(const mjModel* m, int instance) {
  const int body = FindBody(m, instance);
  std::vector<JointConfig> out;
  for (int place = -1; place < kMaxJoints; ++place) {
    const std::string prefix = Prefix(place);
    if (!IsConfigured(m, instance, prefix)) continue;
    const int joint = FindJoint(m, body, place);
    if (!out.empty() && out.back().joint == joint) {
      throw std::invalid_argument(JointName(m, joint) +
                                  " is configured twice, with and without \"0.\" in front");
    }
    const std::string key = prefix + kRange;
    const auto [lo, hi] = ParseRange(m, joint, key, Value(m, instance, key));
    const char* texts[kTexts];
    for (int i = 0; i < kTexts; ++i) texts[i] = Value(m, instance, prefix + kTextNames[i]);
    out.push_back({joint, ParseProfile(prefix, lo, hi, texts)});
    CheckProfile(m, joint, out.back().profile);
  }
  return out;
}

}  // namespace joda
