// The configuration of a plugin instance: which joints it serves, and their profiles.
//
// An instance serves the joints of the one body that refers to it, so it needs no joint's full name
// and survives mjs_attach with prefixes. The attributes of the body's only joint are "range",
// "conservative", "conservative_combine", "friction", ...; in a body of several joints each is
// preceded by the joint's place there, as in "0.friction", "2.range".
#ifndef JODA_CONFIG_H_
#define JODA_CONFIG_H_

#include <mujoco/mujoco.h>

#include <string>
#include <vector>

#include "field.h"

namespace joda {

// The three channels of one joint.
struct Profile {
  double lo = 0;                // joint position at s = 0 (rad or m)
  double per_range = 1;         // ds/dq = 1 / (position at s = 1 - lo)
  PiecewiseCubic conservative;  // N m or N
  PiecewiseCubic friction;      // N m or N
  PiecewiseCubic damping;       // N m s/rad or N s/m
};

struct JointConfig {
  int joint;
  Profile profile;
};

// Every attribute that an instance may have, in all spellings.
const std::vector<std::string>& AttributeNames();

// How many joints the instance is configured for; usable before the model is complete.
int CountJoints(const mjModel* m, int instance);

// The joints that the instance serves; throws std::invalid_argument, one sentence.
std::vector<JointConfig> ReadConfig(const mjModel* m, int instance);

// A profile from the six texts of its channels (components and combine of conservative, friction,
// damping); `prefix` stands before the attributes' names in errors.
Profile ParseProfile(const std::string& prefix, double lo, double hi, const char* const texts[6]);

// Throws if the profile has dry friction and the solver has no row for it.
void CheckFriction(const mjModel* m, int joint, const Profile& profile);

// "joint 'door'" or "unnamed joint 3".
std::string JointName(const mjModel* m, int joint);

}  // namespace joda

#endif  // JODA_CONFIG_H_
