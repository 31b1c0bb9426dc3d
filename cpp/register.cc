// Registers the plugin when the library is loaded, unless it was built for another MuJoCo: the
// layouts of mjModel and mjData change with every release.
#include <mujoco/mujoco.h>

#include <cstdio>

#include "engine.h"
#include "joint_dynamics.h"

JODA_AT_LOAD {
  if (mj_version() != mjVERSION_HEADER) {
    std::fprintf(stderr,
                 "joda: this plugin was built for MuJoCo version code %d and found %d (%s); load "
                 "the one of your MuJoCo, which python -c \"import joda; "
                 "print(joda.plugin_path())\" names\n",
                 mjVERSION_HEADER, mj_version(), mj_versionString());
    return;
  }
  joda::JointDynamics::Register();
}
