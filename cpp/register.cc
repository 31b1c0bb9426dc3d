// Registers the plugin when the library is loaded, unless it was built for another MuJoCo: the
// layouts of mjModel and mjData change with every release.
#include <mujoco/mujoco.h>

#include <cstdio>

#include "joint_dynamics.h"

mjPLUGIN_LIB_INIT(joda_joint_dynamics) {
  if (mj_version() != mjVERSION_HEADER) {
    std::fprintf(stderr,
                 "joda: this plugin was built for MuJoCo %d.%d.%d and found %s; install the joda "
                 "that matches your MuJoCo, or the MuJoCo that matches this joda\n",
                 mjVERSION_HEADER / 1000000, mjVERSION_HEADER / 1000 % 1000,
                 mjVERSION_HEADER % 1000, mj_versionString());
    return;
  }
  joda::JointDynamics::Register();
}
