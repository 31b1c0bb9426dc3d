// The effects in MuJoCo's step, against closed forms.
#include <doctest/doctest.h>
#include <mujoco/mujoco.h>

#include <cmath>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "joint_dynamics.h"

namespace {

constexpr double kTimestep = 0.002;
constexpr int kWhole = mjSTATE_FULLPHYSICS | mjSTATE_PLUGIN | mjSTATE_USER | mjSTATE_WARMSTART;

using Model = std::unique_ptr<mjModel, decltype(&mj_deleteModel)>;
using Data = std::unique_ptr<mjData, decltype(&mj_deleteData)>;

// A part of 1 kg, its centre of mass 0.5 m beside the joint, on a slide along x or a hinge about y.
struct Scene {
  std::string effects;
  std::string friction = "0";  // N or N m
  std::string damping = "0";   // N s/m or N m s/rad
  std::string joint = "type='slide' axis='1 0 0'";
  std::string gravity = "0 0 0";
};

std::string Channel(const std::string& name, const std::string& value) {
  return "<config key='" + name + "' value='0 1 | 0 1 | " + value + " " + value + "'/>";
}

std::string Text(const Scene& scene) {
  return "<mujoco><option timestep='0.002' gravity='" + scene.gravity +
         "'/><compiler angle='radian'/><extension><plugin plugin='joda.joint_dynamics'>"
         "<instance name='part'><config key='range' value='-1 1'/>"
         "<config key='effects' value='" +
         scene.effects + "'/>" + Channel("friction", scene.friction) +
         Channel("damping", scene.damping) +
         "</instance></plugin></extension><worldbody><body><joint name='part' " + scene.joint +
         " frictionloss='1e-12'/><geom type='sphere' size='0.1' pos='0.5 0 0' mass='1'/>"
         "<plugin instance='part'/></body></worldbody><equality><joint name='joda_damping_part' "
         "joint1='part' solref='-1e-12 -1e-12' solimp='1e-4 1e-4'/></equality></mujoco>";
}

// A model and its data; `error` has the parser's complaint where there is none.
struct Simulation {
  std::string error;
  Model m{nullptr, mj_deleteModel};
  Data d{nullptr, mj_deleteData};

  explicit Simulation(const Scene& scene) {
    std::string text = Text(scene);
    mjSpec* spec = mj_parseXMLString(text.c_str(), nullptr, nullptr, 0);
    REQUIRE(spec);
    m.reset(mj_compile(spec, nullptr));
    if (m) d.reset(mj_makeData(m.get()));
    error = mjs_getError(spec);
    mj_deleteSpec(spec);
  }

  // Simulates for some seconds under an applied force; returns the joint's velocity.
  double Push(double force, double seconds) {
    d->qfrc_applied[0] = force;
    for (int k = static_cast<int>(std::lround(seconds / kTimestep)); k > 0; --k) {
      mj_step(m.get(), d.get());
    }
    return d->qvel[0];
  }

  double q() const { return d->qpos[0]; }

  std::vector<mjtNum> State() const {
    std::vector<mjtNum> out(mj_stateSize(m.get(), kWhole));
    mj_getState(m.get(), d.get(), out.data(), kWhole);
    return out;
  }

  // Replaces the effects of the joint; returns the error's sentence.
  std::string Replace(const char* effects) {
    const char* const texts[7] = {"", "", "", "", "", "", effects};
    char out[1024] = "";
    joda_set_profile(m.get(), d.get(), 0, -1, 1, texts, out, sizeof out);
    return out;
  }
};

std::string Curve(const std::string& head, const std::string& value) {
  return head + ": 0 1 | 0 1 | " + value + " " + value + ";";
}

const char* const kHinge = "type='hinge' axis='0 1 0'";
const char* const kVertical = "type='slide' axis='0 0 1'";

// All that has a state or a direction, on a joint that sticks and slips.
const Scene kEverything = {Curve("stribeck_friction velocity=0.05", "0.4") +
                               Curve("quadratic_damping direction=both", "0.2") +
                               Curve("direction_dependent_damping direction=positive", "0.3") +
                               Curve("asymmetric_friction direction=negative", "0.5") +
                               "presliding_friction stiffness=300 damping=2 breakaway=0.7;"
                               "load_dependent_friction coefficient=0.02;"
                               "gravity_offset sin=0.3 cos=0.2; backlash play=0.02 inertia=0.05;"
                               "learned_force memory=position time=0.3 gain=2: 0 1 | 0 0.5 | "
                               "-1 0 1 3 | -0.2 0 0.1 0.4 | -0.1 0 0.2 0.3",
                           "1", "0.5", kHinge, "0 0 -1"};

// Positions of the joint that is pushed to and fro, from step `first` to `last`.
std::vector<mjtNum> Shake(const Simulation& simulation, mjData* d, int first, int last) {
  std::vector<mjtNum> out;
  for (int k = first; k < last; ++k) {
    d->qfrc_applied[0] = 3 * std::sin(0.03 * k);
    mj_step(simulation.m.get(), d);
    out.push_back(d->qpos[0]);
  }
  return out;
}

TEST_CASE("quadratic damping holds the speed sqrt(F / c2)") {
  Simulation both({Curve("quadratic_damping direction=both", "0.2")});
  CHECK(both.Push(5, 30) == doctest::Approx(5).epsilon(1e-8));
  CHECK(both.Push(-0.8, 60) == doctest::Approx(-2).epsilon(1e-8));
}

TEST_CASE("direction-dependent damping holds F / C in its direction") {
  Simulation one({Curve("direction_dependent_damping direction=negative", "3"), "0", "1"});
  CHECK(one.Push(2, 40) == doctest::Approx(2).epsilon(1e-8));
  CHECK(one.Push(-2, 40) == doctest::Approx(-0.5).epsilon(1e-8));
}

TEST_CASE("asymmetric friction brakes harder in its direction, and holds both ways") {
  Simulation part({Curve("asymmetric_friction direction=positive", "2"), "1"});
  CHECK(part.Push(5, 0.5) == doctest::Approx((5 - 3) * 0.5).epsilon(1e-6));
  part.Push(0, 2);
  const double at = part.q();
  part.Push(2.99, 10);
  CHECK(part.q() == doctest::Approx(at).epsilon(1e-6));
  part.Push(-0.99, 10);
  CHECK(part.q() == doctest::Approx(at).epsilon(1e-6));
  CHECK(part.Push(-2, 0.5) == doctest::Approx(-(2 - 1) * 0.5).epsilon(1e-4));
}

TEST_CASE("Stribeck friction holds up to the static friction and slips with Coulomb's") {
  Simulation part({Curve("stribeck_friction velocity=0.01", "2"), "1"});
  part.Push(2.99, 1);
  CHECK(std::abs(part.q()) < 1e-3);
  part.Push(3.1, 1);
  const double fast = part.Push(2, 1), faster = part.Push(2, 1);
  CHECK(faster - fast == doctest::Approx(2 - 1).epsilon(1e-6));
}

TEST_CASE("friction by load is that part of the weight and of the applied force") {
  const char* const load = "load_dependent_friction coefficient=0.25";
  Simulation slide({load, "0", "0", kVertical, "0 0 -10"});
  CHECK(slide.Push(0, 0.5) == doctest::Approx(-10 * 0.75 * 0.5).epsilon(1e-6));
  mj_resetData(slide.m.get(), slide.d.get());
  CHECK(slide.Push(30, 0.5) == doctest::Approx(20 * 0.75 * 0.5).epsilon(1e-6));

  Simulation hinge({load, "0", "0", kHinge, "0 0 -10"});
  const double inertia = 1 / hinge.m->dof_invweight0[0], torque = 10 * 0.5;
  CHECK(hinge.Push(0, kTimestep) ==
        doctest::Approx(torque * 0.75 * kTimestep / inertia).epsilon(1e-6));
}

TEST_CASE("a Prandtl bristle is a spring below break-away and slips above it") {
  Simulation part({"presliding_friction stiffness=300 damping=40", "3"});
  part.Push(1.5, 10);
  CHECK(part.q() == doctest::Approx(1.5 / 300).epsilon(1e-6));
  part.Push(0, 10);
  CHECK(std::abs(part.q()) < 1e-8);
  part.Push(2.95, 10);
  CHECK(part.q() == doctest::Approx(2.95 / 300).epsilon(1e-6));
  const double slow = part.Push(4, 1), fast = part.Push(4, 1);
  CHECK(fast - slow == doctest::Approx(4 - 3).epsilon(1e-4));
}

TEST_CASE("a Dahl bristle follows its exponential") {
  // driven quasi-statically, its force is f (1 - exp(-sigma q / f))
  Simulation part({"presliding_friction stiffness=300 breakaway=0", "3", "2000"});
  for (int k = 0; k < 40000; ++k) part.Push(2.4 * k / 40000, kTimestep);
  part.Push(2.4, 60);
  CHECK(part.q() == doctest::Approx(-3.0 / 300 * std::log(1 - 2.4 / 3)).epsilon(1e-3));
}

TEST_CASE("a stiff bristle stops a part that slips, and does not throw it back") {
  for (const char* const breakaway : {"0", "0.7", "1"}) {
    CAPTURE(breakaway);
    Simulation part({std::string("presliding_friction stiffness=1e8 breakaway=") + breakaway, "3"});
    double speed = part.Push(3.5, 0.1);
    CHECK(speed == doctest::Approx(0.05).epsilon(1e-2));
    while (speed > 0) speed = part.Push(0, kTimestep);
    CHECK(speed > -1e-4);
    CHECK(std::abs(part.Push(0, 1)) < 1e-12);
  }
}

TEST_CASE("the gravity offset is a passive force, whatever the flags") {
  Simulation hinge({"gravity_offset sin=0.3 cos=-0.4", "0", "0", kHinge});
  hinge.m->opt.disableflags |= mjDSBL_SPRING;
  hinge.d->qpos[0] = 0.7;
  mj_forward(hinge.m.get(), hinge.d.get());
  CHECK(hinge.d->qfrc_passive[0] ==
        doctest::Approx(0.3 * std::sin(0.7) - 0.4 * std::cos(0.7)).epsilon(1e-12));
  Simulation slide({"gravity_offset force=2"});
  CHECK(slide.Push(0, 1) == doctest::Approx(2).epsilon(1e-9));
}

TEST_CASE("flags switch the effects on friction and damping off") {
  Simulation part({Curve("quadratic_damping direction=both", "5") +
                       Curve("asymmetric_friction direction=positive", "2") +
                       "presliding_friction stiffness=300 damping=20",
                   "1", "0"});
  part.m->opt.disableflags |= mjDSBL_FRICTIONLOSS | mjDSBL_DAMPER;
  CHECK(part.Push(2, 1) == doctest::Approx(2).epsilon(1e-9));
}

TEST_CASE("a learned table holds the speed at which it resists as much as is pushed") {
  const char* const table = "learned_force: 0 1 | 0 | -2 -1 0 1 4 | -3 -1 0 2 2";
  for (const mjtNum h : {0.0005, 0.01, 0.2}) {
    Simulation part({table});
    part.m->opt.timestep = h;
    CHECK(part.Push(-1, 60) == doctest::Approx(-1).epsilon(1e-8));
    CHECK(part.Push(0, 60) == doctest::Approx(0));
    part.m->opt.disableflags |= mjDSBL_DAMPER;
    CHECK(part.Push(1, 2 * kTimestep) == doctest::Approx(2 * h));
  }
}

TEST_CASE("a memory of position lets a part creep at F / (gain time), and draws it back") {
  Simulation part(
      {"learned_force memory=position gain=50 time=2: 0 1 | 0 | -1 0 1 | 0 0 0", "0", "5"});
  CHECK(part.Push(3, 60) == doctest::Approx(3 / (50 * 2 + 5.0)).epsilon(1e-8));
  CHECK(part.d->plugin_state[1] == doctest::Approx(2 * part.d->qvel[0]).epsilon(1e-8));
  const double at = part.q(), stretch = part.d->plugin_state[1];
  part.Push(0, 60);  // a spring of 50 that relaxes while a damper of 5 lets it go
  CHECK(at - part.q() == doctest::Approx(stretch * 100 / 105).epsilon(2e-3));
}

TEST_CASE("a memory of speed fades out the table as the part works") {
  Simulation part({"learned_force memory=speed gain=-0.1 time=1: 0 1 | 0 | -8 0 8 | -16 0 16"});
  const double v = part.Push(4, 60);  // 2 (1 - 0.1 v) v = 4
  CHECK(v == doctest::Approx(5 - std::sqrt(5.0)).epsilon(1e-6));
  CHECK(part.d->plugin_state[1] == doctest::Approx(v).epsilon(1e-6));
}

TEST_CASE("a part that a steep table stops comes to rest and does not shake") {
  for (const mjtNum h : {0.0005, 0.002, 0.01, 0.02}) {
    CAPTURE(h);
    Simulation part({"learned_force: 0 1 | 0 | -1 -0.01 0 0.01 1 | -3 -3 0 3 3"});
    part.m->opt.timestep = h;
    part.d->qvel[0] = 0.2;
    for (int k = 0; k < 1000; ++k) {
      const double before = part.d->qvel[0];
      const double after = part.Push(0, kTimestep);
      REQUIRE(after <= before + 1e-12);
      REQUIRE(after >= -1e-12);
    }
    CHECK(part.d->qvel[0] < 1e-9);
  }
}

TEST_CASE("within the play the handle flies free, then both move as one") {
  for (const int integrator : {mjINT_EULER, mjINT_IMPLICITFAST}) {
    CAPTURE(integrator);
    // the handle crosses half of the play in sqrt(play J / F) = 0.1 s
    Simulation part({"backlash play=0.1 inertia=0.4"});
    part.m->opt.integrator = integrator;
    part.Push(4, 0.098);
    CHECK(std::abs(part.q()) < 1e-12);
    const double speed = part.Push(4, 0.902);
    CHECK(speed == doctest::Approx(4 / 1.4).epsilon(0.01));  // all momentum is in both
    CHECK(part.Push(4, 0.5) - speed == doctest::Approx(4 * 0.5 / 1.4).epsilon(1e-4));
    CHECK(part.d->plugin_state[1] == doctest::Approx(0.05));
    const double before = part.Push(-4, 0.05);  // draws back through the play
    CHECK(part.Push(-4, 0.05) == doctest::Approx(before).epsilon(1e-9));
  }
}

TEST_CASE("mj_forward does not move the handle") {
  Simulation part({"backlash play=0.1 inertia=0.4"}), other({"backlash play=0.1 inertia=0.4"});
  part.Push(4, 0.05);
  for (int k = 0; k < 7; ++k) mj_forward(part.m.get(), part.d.get());
  other.Push(4, 0.05);
  CHECK(part.Push(4, 0.2) == other.Push(4, 0.2));
}

TEST_CASE("within the play the part is light, then it shares its momentum with the load") {
  for (const int integrator : {mjINT_EULER, mjINT_IMPLICITFAST}) {
    CAPTURE(integrator);
    // the part of 0.4 crosses half of the play in sqrt(play m / F) = 0.1 s
    Simulation part({"backlash play=0.1 inertia=0.6 side=motor share=0.9"});
    part.m->opt.integrator = integrator;
    CHECK(part.Push(4, 0.096) == doctest::Approx(0.96));
    CHECK(part.Push(4, 0.104) == doctest::Approx(0.8).epsilon(1e-6));
    CHECK(part.d->plugin_state[1] == -0.05);
    CHECK(part.d->plugin_state[2] == 0);
    CHECK(part.Push(-4, 0.05) == doctest::Approx(0.3));  // draws back, and the load goes on
    CHECK(part.d->plugin_state[2] == doctest::Approx(0.5));
  }
}

TEST_CASE("a copy goes on as its original") {
  const Simulation original(kEverything), copy(kEverything);
  Shake(original, original.d.get(), 0, 200);
  mj_copyData(copy.d.get(), original.m.get(), original.d.get());
  CHECK(Shake(copy, copy.d.get(), 200, 400) == Shake(original, original.d.get(), 200, 400));
  CHECK(copy.State() == original.State());
}

TEST_CASE("a saved state restarts exactly in new data") {
  const Simulation original(kEverything), other(kEverything);
  Shake(original, original.d.get(), 0, 200);
  mj_setState(other.m.get(), other.d.get(), original.State().data(), kWhole);
  CHECK(Shake(other, other.d.get(), 200, 400) == Shake(original, original.d.get(), 200, 400));
}

TEST_CASE("two threads that share a model agree") {
  const Simulation shared(kEverything);
  std::vector<mjtNum> q[2];
  std::vector<std::thread> threads;
  for (auto& out : q) {
    threads.emplace_back([&shared, &out] {
      const Data d(mj_makeData(shared.m.get()), mj_deleteData);
      out = Shake(shared, d.get(), 0, 4000);
    });
  }
  for (std::thread& thread : threads) thread.join();
  CHECK(q[0].size() == 4000);
  CHECK(q[0] == q[1]);
}

TEST_CASE("what has a state can be replaced, but neither added nor removed") {
  Simulation with({"backlash play=0.1 inertia=0.4"}), without({});
  for (const char* const side : {" side=motor", ""}) {
    with.Push(1, 0.5);
    CHECK(with.Replace((std::string("backlash play=0.05 inertia=0.2") + side).c_str()) == "");
  }
  CHECK(without.Replace("added_inertia inertia=1e-9") ==
        "joint 'part' has armature 0, less than its effect \"added_inertia\" of 1e-09; write "
        "armature=\"1e-09\" on the joint");
  const std::string sentence =
      "joint 'part' would gain or lose the effect \"backlash\" or \"load_dependent_friction\", or "
      "a memory, whose state needs room in the model; attach the profile and compile anew";
  CHECK(with.Replace("") == sentence);
  CHECK(without.Replace("backlash play=0.05 inertia=0.2") == sentence);
  CHECK(without.Replace("load_dependent_friction coefficient=0.1") == sentence);
  const std::string learned = "learned_force memory=speed: 0 1 | 0 | -1 0 1 | -1 0 1";
  CHECK(without.Replace(learned.c_str()) == sentence);
  CHECK(without.Replace("learned_force: 0 1 | 0 | -1 0 1 | -1 0 1") == "");
  Simulation rubbing({"load_dependent_friction coefficient=0.1"});
  CHECK(rubbing.Replace(learned.c_str()) == sentence);
}

TEST_CASE("effects that the joint cannot have are refused") {
  Simulation slide({}), hinge({"", "0", "0", kHinge});
  CHECK(slide.Replace("gravity_offset sin=1") ==
        "joint 'part' is a slide; its effect \"gravity_offset\" takes force");
  CHECK(hinge.Replace("gravity_offset force=1") ==
        "joint 'part' is a hinge; its effect \"gravity_offset\" takes sin and cos");
  CHECK(
      slide.Replace("backlash play=1 inertia=0.6") ==
      "joint 'part' has inertia 1, and the handle of its effect \"backlash\" 0.6; at most half is "
      "possible");
  CHECK(slide.Replace("backlash play=1 inertia=0.96 side=motor") ==
        "joint 'part' has inertia 1, and the load of its effect \"backlash\" 0.96; at most 0.95 of "
        "it is possible");
  slide.m->dof_frictionloss[0] = 0;
  CHECK(
      slide.Replace("presliding_friction stiffness=1") ==
      "joint 'part' has the effect \"presliding_friction\" but no friction row in the solver; add "
      "frictionloss=\"1e-12\" to the joint");
}

TEST_CASE("a scene with a mistake in its effects is refused with the sentence") {
  const Simulation bad({"backlash play=0 inertia=1"});
  CHECK(!bad.m);
  CHECK(bad.error.find("attribute \"effects\": effect 1 \"backlash\": play must be positive") !=
        std::string::npos);
}

TEST_CASE("a light joint with stiff effects stays bounded at a long timestep") {
  Simulation part({Curve("quadratic_damping direction=both", "1e6") +
                       Curve("direction_dependent_damping direction=negative", "1e6") +
                       Curve("stribeck_friction velocity=1e-4", "5") +
                       "presliding_friction stiffness=1e9 damping=1e6 breakaway=0.5;"
                       "gravity_offset sin=1e5 cos=1e5; backlash play=0.1 inertia=0.1",
                   "1", "0", kHinge, "0 0 -10"});
  part.m->opt.timestep = 0.05;
  for (int k = 0; k < 400; ++k) {
    Shake(part, part.d.get(), k, k + 1);
    CHECK(std::abs(part.d->qvel[0]) < 100);
  }
  CHECK(part.d->time == doctest::Approx(400 * 0.05));  // never reset
}

}  // namespace
