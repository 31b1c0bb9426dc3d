// The profile of one joint: its three channels and its effects, from the texts of the attributes.
// Nothing here knows MuJoCo.
#ifndef JODA_PROFILE_H_
#define JODA_PROFILE_H_

#include <memory>
#include <string>

#include "effects.h"
#include "field.h"

namespace joda {

// How many texts a profile is made of: components and combine of conservative, friction and
// damping, then the effects.
inline constexpr int kTexts = 7;

// Names of the attributes that hold the texts, in this order.
inline constexpr const char* kTextNames[kTexts] = {
    "conservative", "conservative_combine", "friction", "friction_combine",
    "damping",      "damping_combine",      "effects"};

// The three channels of one joint, and its effects beyond them.
struct Profile {
  double lo = 0;                           // joint position at s = 0 (rad or m)
  double per_range = 1;                    // ds/dq = 1 / (position at s = 1 - lo)
  std::shared_ptr<const Effects> effects;  // null: none
  PiecewiseCubic conservative;             // N m or N
  PiecewiseCubic friction;                 // N m or N
  PiecewiseCubic damping;                  // N m s/rad or N s/m
};

// A profile from its texts; throws std::invalid_argument, one sentence, in which `prefix` stands
// before the attribute's name.
Profile ParseProfile(const std::string& prefix, double lo, double hi,
                     const char* const texts[kTexts]);

// How many numbers of the engine's state the effects (null: none) need. With load-dependent
// friction the last of them is the load's unknown part.
int CountStates(const Effects* effects);

// The same for effects as a text; what cannot be read counts as none.
int CountStates(const char* effects);

}  // namespace joda

#endif  // JODA_PROFILE_H_
