// A C++ program that runs a scene with JODA's plugin: no Python, and no line about joints.
//
//   host PLUGIN_LIBRARY SCENE.xml SECONDS
//
// Prints the time and every joint's position at the end.
#include <mujoco/mujoco.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>

namespace {

int Fail(const char* what, const char* detail) {
  std::fprintf(stderr, "host: %s %s\n", what, detail);
  return 1;
}

void PrintJoints(const mjModel* m, const mjData* d) {
  for (int joint = 0; joint < m->njnt; ++joint) {
    const char* name = mj_id2name(m, mjOBJ_JOINT, joint);
    std::printf("%s", name ? name : "(unnamed)");
    const int end = joint + 1 < m->njnt ? m->jnt_qposadr[joint + 1] : m->nq;
    for (int k = m->jnt_qposadr[joint]; k < end; ++k) std::printf(" %.6f", d->qpos[k]);
    std::printf("\n");
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) return Fail("expected", "PLUGIN_LIBRARY SCENE.xml SECONDS");
  char* rest = nullptr;
  const double seconds = std::strtod(argv[3], &rest);
  if (*rest || !std::isfinite(seconds) || seconds < 0) {
    return Fail("SECONDS must be a number from 0 up, not", argv[3]);
  }

  const int before = mjp_pluginCount();
  mj_loadPluginLibrary(argv[1]);  // stops the program if the library cannot be loaded
  if (mjp_pluginCount() == before) return Fail("found no MuJoCo plugin in", argv[1]);

  char error[1024] = "";
  const std::unique_ptr<mjModel, decltype(&mj_deleteModel)> m(
      mj_loadXML(argv[2], nullptr, error, sizeof error), mj_deleteModel);
  if (!m) return Fail("cannot load the scene:", error);
  const std::unique_ptr<mjData, decltype(&mj_deleteData)> d(mj_makeData(m.get()), mj_deleteData);
  if (!d) return Fail("no memory to simulate", argv[2]);

  while (d->time < seconds) mj_step(m.get(), d.get());
  std::printf("time %.3f\n", d->time);
  PrintJoints(m.get(), d.get());
  return 0;
}
