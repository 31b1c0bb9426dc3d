// MuJoCo engine plugin "joda.joint_dynamics": position-dependent joint dynamics inside the step.
//
// Per joint three channels over its position: conservative force F(s), dry friction f_max(s) and
// damping C(s). F is a passive force; friction and damping are rows of MuJoCo's convex solver, so
// they are coupled with contacts and limits and stable at any timestep. The effects beyond them act
// through the same force and rows. See docs/physics.md.
//
// The plugin never writes to mjModel, and all its state is in plugin_state: any thread, any mjData.
#ifndef JODA_JOINT_DYNAMICS_H_
#define JODA_JOINT_DYNAMICS_H_

#include <mujoco/mujoco.h>

#include <vector>

#include "config.h"
#include "effects.h"
#include "rows.h"

#ifdef _WIN32
#define JODA_API __declspec(dllexport)
#else
#define JODA_API __attribute__((visibility("default")))
#endif

namespace joda {

class JointDynamics {
 public:
  // Reads the configuration of the plugin instance; throws std::invalid_argument, one sentence.
  JointDynamics(const mjModel* m, int instance);

  // Adds the forces of all its joints to the step being computed.
  void Compute(const mjModel* m, mjData* d, int instance);

  // Remembers the dry friction of the step just taken, one number per joint in plugin_state: the
  // next step's friction continues from it, so that a held joint does not creep. A joint with
  // backlash has three numbers more: those of the handle or the load, and the force that was
  // applied after Compute (between mj_step1 and mj_step2, or by mjcb_control). That force reached
  // the part directly: the next step gives it to the handle and takes it back from the part, or
  // makes up for the load's inertia. A learned force with a memory has one more. Load-dependent
  // friction has one more: what of the load the next step cannot know before its solver has run.
  void Advance(const mjModel* m, mjData* d, int instance) const;

  // Replaces the profile of a joint; throws std::invalid_argument if the instance lacks the joint
  // or the profile needs other state.
  void SetProfile(const mjModel* m, int joint, Profile profile);

  static void Register();

 private:
  struct Joint {
    // what a step reads of a joint without effects comes first, in as few lines of the cache
    int id;              // joint
    int dof;             // its degree of freedom
    int qpos;            // its place in qpos
    int body;            // the body it moves
    int equality;        // equality constraint whose row carries the damping, -1: none
    int friction_row;    // expected place of its friction row among the friction rows
    int state;           // its place in the instance's state
    double applied = 0;  // the force that Compute knew of, until Advance
    PiecewiseCubic::Piece conservative, friction, damping;  // where the channels were last
    alignas(64) Profile profile;
    Loose handle;  // after the step being computed, until Advance
    Passage load;  // in the step being computed, until Advance
  };

  // Rows of this step's constraints, -1: none.
  static int FindFrictionRow(const mjData* d, const Joint& joint);
  static int FindDampingRow(const mjData* d, const Joint& joint);

  // Sets the joint's friction row, whose last force is `state`, for the `part` of the bristle that
  // is there; returns the bristle's damping.
  static double SetFrictionRow(const Step& step, mjData* d, int row, const Joint& joint,
                               double bound, double state, double inertia, double part);

  // Where the last number of the joint's state is.
  static int LastState(const Joint& joint) {
    return joint.state + CountStates(joint.profile.effects.get()) - 1;
  }

  // Where what a learned force remembers is.
  static int MemoryState(const Joint& joint) {
    return LastState(joint) - (joint.profile.effects->load > 0);
  }

  // Of the load, what contacts and all other constraints exert, but for the joint's own friction,
  // damping and ends of range, minus what its actuators do.
  static double UnknownLoad(const mjModel* m, const mjData* d, const Joint& joint);

  // Sets the rows of those ends of the joint's range that have a restitution of their own.
  static void SetStops(const Step& step, mjData* d, const Joint& joint);

  // Moves the joint's handle; returns what it exerts on the part beyond the applied force.
  static double PushThroughPlay(const mjData* d, const mjtNum* state, double h, Joint* joint);

  std::vector<Joint> joints_;
};

}  // namespace joda

// The number under which MuJoCo has the plugin: that of its instances in mjModel.plugin.
extern "C" JODA_API int joda_slot();

// Replaces the profile of `joint` in `d` only; the texts are as in the attributes. Returns 0, or -1
// with one sentence in `error`.
extern "C" JODA_API int joda_set_profile(const mjModel* m, mjData* d, int joint, double lo,
                                         double hi, const char* const texts[7], char* error,
                                         int error_size);

#endif  // JODA_JOINT_DYNAMICS_H_
