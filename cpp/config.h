// The configuration of a plugin instance: which joints it serves, and their profiles.
//
// An instance serves the joints of the one body that refers to it, so it needs no joint's full name
// and survives mjs_attach with prefixes. The attributes of the body's only joint are "range",
// "conservative", "conservative_combine", "friction", ..., "effects"; in a body of several joints
// each is preceded by the joint's place there, as in "0.friction", "2.range".
#ifndef JODA_CONFIG_H_
#define JODA_CONFIG_H_

#include <mujoco/mujoco.h>

#include <string>
#include <vector>

#include "profile.h"

namespace joda {

struct JointConfig {
  int joint;
  Profile profile;
};

// Every attribute that an instance may have, in all spellings.
const std::vector<std::string>& AttributeNames();

// How many numbers of the engine's state all joints of the instance need; usable before the model
// is complete.
int CountStates(const mjModel* m, int instance);

// The joints that the instance serves; throws std::invalid_argument, one sentence.
std::vector<JointConfig> ReadConfig(const mjModel* m, int instance);

// Throws if the profile cannot act on the joint as the model has it.
void CheckProfile(const mjModel* m, int joint, const Profile& profile);

// "joint 'door'" or "unnamed joint 3".
std::string JointName(const mjModel* m, int joint);

}  // namespace joda

#endif  // JODA_CONFIG_H_
