// Feeds whole configurations to the plugin in MuJoCo, texts to the swap of a profile, and texts and
// numbers to the joint by itself: config_fuzz SEED COUNT. What is refused is refused in a sentence;
// what is accepted makes finite forces in a finite state, whatever pushes the joints.
#include <mujoco/mujoco.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "effects.h"
#include "fuzz.h"
#include "joint_dynamics.h"
#include "joint_simulator.h"

namespace joda::fuzz {
namespace {

using Model = std::unique_ptr<mjModel, decltype(&mj_deleteModel)>;
using Data = std::unique_ptr<mjData, decltype(&mj_deleteData)>;

constexpr const char* kCombinations[] = {"", "sum", "max"};

std::string WriteResistance(Random& random) { return Curve(random, true); }

// The seven texts of a profile, a few of them disturbed.
std::array<std::string, 7> Texts(Random& random) {
  std::array<std::string, 7> out;
  for (int channel = 0; channel < 3; ++channel) {
    if (Below(random, 2))
      out[2 * channel] = List(random, channel ? WriteResistance : WriteComponent);
    out[2 * channel + 1] = Pick(random, kCombinations);
  }
  if (Below(random, 2)) out[6] = WriteEffects(random);
  if (Below(random, 3) == 0) {
    std::string& text = out[Below(random, 7)];
    text = Disturb(random, text);
  }
  return out;
}

std::array<const char*, 7> Pointers(const std::array<std::string, 7>& texts) {
  std::array<const char*, 7> out;
  for (size_t k = 0; k < texts.size(); ++k) out[k] = texts[k].c_str();
  return out;
}

std::string Joined(const std::array<std::string, 7>& texts) {
  std::string out;
  for (const std::string& text : texts) out += text + "\n";
  return out;
}

// As the value of an XML attribute; what XML cannot hold is left out.
std::string Quoted(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '<' || c == '&' || c == '"') {
      out += "&#" + std::to_string(static_cast<int>(c)) + ";";
    } else if (c >= ' ' || c == '\n') {
      out += c;
    }
  }
  return "\"" + out + "\"";
}

std::string Key(const std::string& key, const std::string& value) {
  return "<config key=\"" + key + "\" value=" + Quoted(value) + "/>";
}

// The attributes of the joint at a place, -1: without a place.
std::string Keys(Random& random, int place) {
  static const char* const names[] = {
      "conservative", "conservative_combine", "friction", "friction_combine",
      "damping",      "damping_combine",      "effects"};
  const std::string prefix = place < 0 ? "" : std::to_string(place) + ".";
  const auto texts = Texts(random);
  std::string range = Print(-Uniform(random)) + " " + Print(Uniform(random)), out;
  if (Below(random, 4) == 0) range = Disturb(random, range);
  if (Below(random, 4)) out += Key(prefix + "range", range);
  for (size_t k = 0; k < texts.size(); ++k) {
    if (!texts[k].empty()) out += Key(prefix + names[k], texts[k]);
  }
  return out;
}

std::string Joints(Random& random, int count) {
  static const char* const types[] = {"slide", "slide", "hinge", "hinge",
                                      "hinge", "slide", "slide", "ball"};
  static const char* const axes[] = {"1 0 0", "0 1 0", "0 0 1", "1 2 3"};
  std::string out;
  for (int k = 0; k < count; ++k) {
    const std::string type = Pick(random, types);
    out += "<joint type='" + type + "' axis='" + Pick(random, axes) + "'" +
           (Below(random, 4) ? " frictionloss='1e-12'" : "") +
           (Below(random, 3) && type != "ball" ? " range='-1 1'" : "") +
           (Below(random, 3) ? "" : " armature='1'") +
           (Below(random, 2) ? " name='j" + std::to_string(k) + "'/>" : "/>");
  }
  return out;
}

// A body with some joints and an instance that may serve them.
std::string Scene(Random& random) {
  static const char* const integrators[] = {"Euler", "implicit", "implicitfast", "RK4", "discrete"};
  static const char* const solvers[] = {"Newton", "CG", "PGS"};
  const int count = Below(random, 8) ? 1 + Below(random, 2) : Below(random, 4);
  const bool alone = count == 1;
  std::string keys;
  for (int k = 0; k < (alone ? 1 : count); ++k) {
    if (Below(random, 4)) keys += Keys(random, alone && Below(random, 2) ? -1 : k);
  }
  if (Below(random, 20) == 0) keys += Keys(random, Below(random, 8) - 1);
  const std::string reference = Below(random, 20) ? "<plugin instance='p'/>" : "";
  return std::string("<mujoco><compiler angle='radian'/><option integrator='") +
         Pick(random, integrators) + "' solver='" + Pick(random, solvers) + "' timestep='" +
         Print(std::pow(10, -4 + 3 * Uniform(random))) + "' noslip_iterations='" +
         (Below(random, 5) ? "0" : "3") +
         "'/><extension><plugin plugin='joda.joint_dynamics'><instance name='p'>" + keys +
         "</instance></plugin></extension><worldbody><body name='b'>" + Joints(random, count) +
         "<geom type='box' size='.1 .2 .3' pos='.2 0 0' mass='" +
         Print(std::pow(10, 4 * Uniform(random) - 3)) + "'/>" + reference +
         "</body></worldbody></mujoco>";
}

// Whether the plugin's forces stay finite while the joints are pushed about.
bool StaysFinite(Random& random, const mjModel* m, mjData* d) {
  for (int k = 0; k < 12; ++k) {
    for (int i = 0; i < m->nv; ++i) d->qfrc_applied[i] = 100 * Uniform(random) - 50;
    if (Below(random, 6) == 0 && m->nv) d->qvel[Below(random, m->nv)] = 1e3 * Uniform(random);
    mj_step1(m, d);
    for (int i = 0; i < m->nv; ++i) {
      if (!std::isfinite(d->qfrc_passive[i])) return false;
    }
    mj_step2(m, d);
  }
  return true;
}

// The plugin's sentence, or another complaint of MuJoCo's about such a model.
bool IsSentence(const std::string& error) {
  const auto own = error.find("joda.joint_dynamics: instance '");
  return own == std::string::npos ? !error.empty() : error.size() > own + 40;
}

// The model of the MJCF, or null with the reason.
Model Compile(const std::string& text, std::string* reason) {
  char error[2000] = "";
  Model out(nullptr, mj_deleteModel);
  if (mjSpec* spec = mj_parseXMLString(text.c_str(), nullptr, error, sizeof error)) {
    out.reset(mj_compile(spec, nullptr));
    *reason = mjs_getError(spec);
    mj_deleteSpec(spec);
  } else {
    *reason = error;
  }
  return out;
}

Trial TryScene(Random& random) {
  Trial out = {Scene(random)};
  std::string reason;
  const Model m = Compile(out.text, &reason);
  if (!m) {
    out.good = IsSentence(reason);
    return out;
  }
  const Data d(mj_makeData(m.get()), mj_deleteData), copy(mj_makeData(m.get()), mj_deleteData);
  out.accepted = true;
  out.good = StaysFinite(random, m.get(), d.get());
  mj_copyData(copy.get(), m.get(), d.get());
  out.good = out.good && StaysFinite(random, m.get(), copy.get());
  mj_resetData(m.get(), d.get());
  return out;
}

// A slide and a hinge, each with a profile that can be swapped.
const mjModel* Swappable() {
  static const Model model = [] {
    std::string reason;
    return Compile(
        "<mujoco><extension><plugin plugin='joda.joint_dynamics'><instance name='p'>"
        "<config key='0.effects' value='backlash play=0.1 inertia=0.1'/>"
        "<config key='1.range' value='-1 1'/></instance></plugin></extension><worldbody><body>"
        "<joint type='slide' range='-1 1' frictionloss='1e-12' armature='9'/>"
        "<joint range='-1 1' frictionloss='1e-12' armature='9'/>"
        "<geom size='.1' pos='.3 0 0' mass='1'/><plugin instance='p'/></body></worldbody></mujoco>",
        &reason);
  }();
  return model.get();
}

Trial TrySwap(Random& random) {
  const mjModel* m = Swappable();
  static const Data d(mj_makeData(m), mj_deleteData);
  const auto texts = Texts(random);
  const int size = Below(random, 4) ? 1024 : 1 + Below(random, 60);  // of the error's buffer
  std::vector<char> error(size, 'x');
  const int joint = Below(random, 10) ? Below(random, 2) : Below(random, 9) - 4;
  const double lo = -Uniform(random), hi = Uniform(random);
  Trial out = {Joined(texts)};
  if (joda_set_profile(m, d.get(), joint, lo, hi, Pointers(texts).data(), error.data(), size)) {
    const bool ends = std::find(error.begin(), error.end(), '\0') != error.end();
    out.good = ends && (size < 2 || error[0] != '\0');
    return out;
  }
  out.accepted = true;
  out.good = StaysFinite(random, m, d.get());
  mj_resetData(m, d.get());
  return out;
}

double Odd(Random& random, double usual) {
  static constexpr double odd[] = {0, -1, 1e-300, 1e300, NAN, INFINITY, -INFINITY, 1e15, 5e-324};
  return Below(random, 12) ? usual : Pick(random, odd);
}

// Positions are finite from each start on, or NaN from some place until the next one.
bool IsReplay(const std::vector<double>& q, const std::vector<JointSimulator::Start>& starts) {
  for (size_t i = 0; i < starts.size(); ++i) {
    const size_t end = i + 1 < starts.size() ? starts[i + 1].step : q.size();
    bool lost = false;
    for (size_t k = starts[i].step; k < end; ++k) {
      if (lost ? !std::isnan(q[k]) : !std::isfinite(q[k]) && !std::isnan(q[k])) return false;
      lost = std::isnan(q[k]);
    }
  }
  return true;
}

Stop OddStop(Random& random) {
  return {
      {Odd(random, 0.02), Odd(random, 1)},
      {Odd(random, 0.9), Odd(random, 0.95), Odd(random, 0.001), Odd(random, 0.5), Odd(random, 2)}};
}

Trial TryJointSimulator(Random& random) {
  const auto texts = Texts(random);
  const auto positive = [&random] { return Odd(random, std::pow(10, 4 * Uniform(random) - 3)); };
  const Body body = {{Odd(random, -Uniform(random)), Odd(random, Uniform(random))},
                     positive(),
                     positive(),
                     {Odd(random, 1), Odd(random, -1)},
                     Below(random, 2) == 0,
                     OddStop(random),
                     {Odd(random, 100), Odd(random, Below(random, 2) ? 9 : 0)},
                     static_cast<int>(Below(random, 3)) - 1,
                     OddStop(random)};
  Trial out = {Joined(texts)};
  try {
    const Servo servo = {Odd(random, 1),
                         Odd(random, 50),
                         Odd(random, 2),
                         {Odd(random, -3), Odd(random, 3)},
                         Odd(random, 0.01 * Below(random, 2))};
    const JointSimulator simulator(body, servo, Pointers(texts).data());
    out.accepted = true;
    std::vector<double> force(60), command(60), before(60), after(60);
    for (double& one : force) one = Odd(random, 10 * Uniform(random) - 5);
    for (double& one : command) one = Odd(random, 10 * Uniform(random) - 5);
    const std::vector<JointSimulator::Start> starts = {{0, Odd(random, 0.1), 0, true},
                                                       {20, 0, Odd(random, 1), false},
                                                       {40, 0.2, 0, Below(random, 2) == 0}};
    simulator.Replay(std::pow(10, -4 + 3 * Uniform(random)), force.data(), command.data(), 60,
                     starts, before.data(), after.data());
    out.good = IsReplay(after, starts);
  } catch (const std::invalid_argument&) {
  }
  return out;
}

}  // namespace
}  // namespace joda::fuzz

int main(int argc, char** argv) {
  using namespace joda::fuzz;
  mju_user_warning = [](const char*) {};  // what MuJoCo counts and resets is not told
  constexpr Target kTargets[] = {{"scenes", TryScene, 40},
                                 {"swapped profiles", TrySwap, 20},
                                 {"joints alone", TryJointSimulator, 10}};
  return Run(argc, argv, kTargets);
}
