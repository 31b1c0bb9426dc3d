// MuJoCo from 3.3 to 4.0: what one version has and another has not, under one name.
//
// The layouts of mjModel and mjData change with every release, so the plugin is compiled once for
// each; this is all in which its source differs.
#ifndef JODA_ENGINE_H_
#define JODA_ENGINE_H_

#include <mujoco/mujoco.h>

// mjVERSION_HEADER is 340 for 3.4.0, and from 3.5.0 on 3005000.
#if mjVERSION_HEADER < 330
#error "joda needs MuJoCo 3.3.0 or newer"
#endif

// Begins the function that runs when the library is loaded.
#if mjVERSION_HEADER >= 3007000
#define JODA_AT_LOAD mjPLUGIN_LIB_INIT(joda_joint_dynamics)
#else
#define JODA_AT_LOAD mjPLUGIN_LIB_INIT
#endif

namespace joda {

#if mjVERSION_HEADER >= 336
inline constexpr int kNoSpring = mjDSBL_SPRING, kNoDamper = mjDSBL_DAMPER;
#else  // one flag for both
inline constexpr int kNoSpring = mjDSBL_PASSIVE, kNoDamper = mjDSBL_PASSIVE;
#endif

// Whether the body sleeps (from 3.4.0 on): nothing of it is computed then.
inline bool IsAsleep([[maybe_unused]] const mjData* d, [[maybe_unused]] int body) {
#if mjVERSION_HEADER >= 340
  return d->body_awake[body] == mjS_ASLEEP;
#else
  return false;
#endif
}

// Whether the rows are made anew after the passive forces (from 3.13.0 on).
inline bool IsDiscrete([[maybe_unused]] const mjModel* m) {
#if mjVERSION_HEADER >= 3013000
  return m->opt.integrator == mjINT_DISCRETE;
#else
  return false;
#endif
}

// 1 / (inertia that the row moves).
inline mjtNum RowMobility(const mjData* d, int row) {
#if mjVERSION_HEADER >= 3010000
  return d->efc_diagA[row];
#else
  return d->efc_diagApprox[row];
#endif
}

// Gives the islands' copies of the row (from 3.3.3 on; they were gathered before) what it has.
inline void CopyToIsland([[maybe_unused]] mjData* d, [[maybe_unused]] int row) {
#if mjVERSION_HEADER >= 333
  if (d->nisland == 0) return;
  const int i = d->map_efc2iefc[row];
  d->iefc_D[i] = d->efc_D[row];
  d->iefc_R[i] = d->efc_R[row];
  d->iefc_frictionloss[i] = d->efc_frictionloss[row];
#endif
}

}  // namespace joda

#endif  // JODA_ENGINE_H_
