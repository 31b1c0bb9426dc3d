// joda._core in Python: the field, learned tables, and a joint by itself. It does not know MuJoCo.
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "attributes.h"
#include "end_stop.h"
#include "field.h"
#include "joint_simulator.h"
#include "table.h"

namespace py = pybind11;

namespace {

template <typename T>
using Dense = py::array_t<T, py::array::c_style | py::array::forcecast>;

using Texts = std::array<std::string, joda::kTexts>;

std::array<const char*, joda::kTexts> Pointers(const Texts& texts) {
  std::array<const char*, joda::kTexts> out;
  for (size_t i = 0; i < texts.size(); ++i) out[i] = texts[i].c_str();
  return out;
}

// Value and slope at each of the places, arrays of their shape; `at` gives them at the i-th.
template <typename At>
std::pair<py::array_t<double>, py::array_t<double>> Samples(const py::array& places, At at) {
  const std::vector<py::ssize_t> shape(places.shape(), places.shape() + places.ndim());
  py::array_t<double> value(shape), slope(shape);
  for (py::ssize_t i = 0; i < places.size(); ++i) {
    const joda::Sample sample = at(i);
    value.mutable_data()[i] = sample.value;
    slope.mutable_data()[i] = sample.slope;
  }
  return {value, slope};
}

py::array_t<double> List(const std::vector<double>& numbers) {
  return py::array_t<double>(numbers.size(), numbers.data());
}

// Coefficients of cubics, constant first: shape (shape, 4).
py::array_t<double> Cubics(const std::vector<joda::Coefficients>& cubics,
                           std::vector<py::ssize_t> shape) {
  shape.push_back(4);
  py::array_t<double> out(shape);
  double* to = out.mutable_data();
  for (const auto& cubic : cubics) to = std::copy(cubic.begin(), cubic.end(), to);
  return out;
}

using SecondStop = std::tuple<int, std::array<double, 2>, std::array<double, 5>>;

joda::JointSimulator MakeJointSimulator(double lo, double hi, const Texts& texts, double inertia,
                                        double row_inertia, const std::array<double, 2>& weight,
                                        bool hinge, const std::array<double, 2>& solref,
                                        const std::array<double, 5>& solimp,
                                        const std::array<double, 2>& friction_row,
                                        const std::array<double, 6>& servo, bool trapezoidal,
                                        const SecondStop& second) {
  const auto& [end, second_solref, second_solimp] = second;
  const joda::Body body = {{lo, hi},     inertia, row_inertia,
                           weight,       hinge,   {solref, solimp},
                           friction_row, end,     {second_solref, second_solimp}};
  const auto [gain, stiffness, damping, low, high, delay] = servo;
  return joda::JointSimulator(body, {gain, stiffness, damping, {low, high}, delay},
                              Pointers(texts).data(),
                              trapezoidal ? joda::Scheme::kTrapezoidal : joda::Scheme::kEngine);
}

std::vector<joda::JointSimulator::Start> ReadStarts(const Dense<std::int64_t>& at,
                                                    const Dense<double>& start,
                                                    const Dense<bool>& fresh, py::ssize_t n) {
  const py::ssize_t count = at.size();
  if (at.ndim() != 1 || start.ndim() != 2 || fresh.ndim() != 1 || start.shape(0) != count ||
      start.shape(1) != 2 || fresh.size() != count) {
    throw py::value_error("at, start and fresh must have the shapes (m,), (m, 2) and (m,)");
  }
  std::vector<joda::JointSimulator::Start> out;
  out.reserve(count);
  for (py::ssize_t i = 0; i < count; ++i) {
    out.push_back({at.at(i), start.at(i, 0), start.at(i, 1), fresh.at(i)});
  }
  const auto later = [](const auto& a, const auto& b) { return a.step >= b.step; };
  if (out.empty() || out.front().step != 0 || out.back().step >= n ||
      std::adjacent_find(out.begin(), out.end(), later) != out.end()) {
    throw py::value_error("at must begin with 0, increase and stay below the number of forces");
  }
  return out;
}

std::pair<Dense<double>, Dense<double>> Replay(const joda::JointSimulator& simulator,
                                               const Dense<double>& force,
                                               const Dense<std::int64_t>& at,
                                               const Dense<double>& start, const Dense<bool>& fresh,
                                               double h,
                                               const std::optional<Dense<double>>& command) {
  if (force.ndim() != 1) throw py::value_error("force must have the shape (n,)");
  if (command && (command->ndim() != 1 || command->size() != force.size())) {
    throw py::value_error("command must have the shape of force");
  }
  if (!(h > 0)) throw py::value_error("h must be positive");
  const auto starts = ReadStarts(at, start, fresh, force.size());
  Dense<double> before(force.size()), after(force.size());
  const double* applied = force.data();
  const double* wanted = command ? command->data() : nullptr;
  double* first = before.mutable_data();
  double* second = after.mutable_data();
  {
    py::gil_scoped_release release;
    simulator.Replay(h, applied, wanted, force.size(), starts, first, second);
  }
  return {before, after};
}

}  // namespace

PYBIND11_MODULE(_core, module) {
  module.doc() = "C++ core of JODA: channels, tables of learned forces, and a joint by itself.";

  py::class_<joda::PiecewiseCubic>(module, "PiecewiseCubic",
                                   R"(A channel of a profile, merged at load.

Args:
  text: components as in the plugin's attributes, "label: a b | x ... | y ... ; ...".
  combine: "sum" or "max".
  nonnegative: refuse negative values, as friction and damping do.

Raises:
  ValueError: the text cannot be read; one sentence says where and why.)")
      .def(py::init(&joda::ParsePiecewiseCubic), py::arg("text"), py::arg("combine") = "sum",
           py::arg("nonnegative") = false)
      .def(
          "__call__",
          [](const joda::PiecewiseCubic& channel, const Dense<double>& s) {
            return Samples(s, [&](py::ssize_t i) { return channel(s.data()[i]); });
          },
          py::arg("s"), "Value and slope d/ds at normalised positions s, arrays of the shape of s.")
      .def("max_stiffness", py::overload_cast<>(&joda::PiecewiseCubic::MaxStiffness, py::const_),
           "Largest stiffness max(-dF/ds, 0) anywhere on the channel.")
      .def_property_readonly(
          "knots", [](const joda::PiecewiseCubic& channel) { return List(channel.Knots()); },
          "Breakpoints in s, shape (n + 1,).")
      .def_property_readonly(
          "cubics",
          [](const joda::PiecewiseCubic& channel) {
            const auto cubics = channel.Cubics();
            return Cubics(cubics, {static_cast<py::ssize_t>(cubics.size())});
          },
          "c0..c3 of each piece about its left knot, shape (n, 4).")
      .def_property_readonly(
          "descents", [](const joda::PiecewiseCubic& channel) { return List(channel.Descents()); },
          "Largest stiffness max(-dF/ds, 0) on each piece, shape (n,).");

  py::class_<joda::Table>(module, "Table",
                          R"(The table of a learned force: resistance over position and velocity.

Args:
  interval: a and b in normalised position.
  positions: increasing, shape (n,).
  velocities: increasing, rad/s or m/s, shape (m,).
  y: resistance there, N m or N, shape (n, m).

Raises:
  ValueError: a number is impossible; one sentence says why.)")
      .def(py::init([](std::pair<double, double> interval, std::vector<double> positions,
                       std::vector<double> velocities, const std::vector<std::vector<double>>& y) {
             return joda::Table(interval, std::move(positions), std::move(velocities), y, true);
           }),
           py::arg("interval"), py::arg("positions"), py::arg("velocities"), py::arg("y"))
      .def(
          "__call__",
          [](const joda::Table& table, const Dense<double>& s, const Dense<double>& v) {
            if (!std::equal(s.shape(), s.shape() + s.ndim(), v.shape(), v.shape() + v.ndim())) {
              throw py::value_error("s and v must have one shape");
            }
            return Samples(s, [&](py::ssize_t i) { return table(s.data()[i], v.data()[i]); });
          },
          py::arg("s"), py::arg("v"),
          "Resistance and its slope d/dv at normalised positions s and velocities v of one shape.")
      .def_property_readonly(
          "cubics",
          [](const joda::Table& table) {
            const auto rows = static_cast<py::ssize_t>(table.Rows());
            const auto& cubics = table.Cubics();
            return Cubics(cubics, {rows, static_cast<py::ssize_t>(cubics.size()) / rows});
          },
          "c0..c3 of each row's cubics about their left velocities, shape (n, m - 1, 4).");

  module.def("stop_rebound", &joda::Rebound, py::arg("damping"),
             "Restitution of an end stop with this damping, times the timestep; 0 <= it <= 1.");
  module.def("stop_damping", &joda::StopDamping, py::arg("restitution"),
             "Damping, times the timestep, of an end stop with this restitution, 0 <= it < 1.");

  py::class_<joda::JointSimulator>(
      module, "JointSimulator",
      R"(A joint by itself, stepped as MuJoCo does with the plugin, or more accurately.

Units are those of a hinge; for a slide read N, m and kg.

Args:
  lo, hi: ends of the range.
  texts: channel and combine, three times, then the effects.
  inertia: without the added inertia among the effects, kg m^2.
  row_inertia: what MuJoCo's rows take for it, the mass of a body that only slides; 0: all of it.
  weight: hinge: factors of cos q and sin q of gravity's torque; slide: its force, and 0.
  hinge: whether it is a hinge.
  solref, solimp: of the range's ends.
  friction_row: of MuJoCo's own friction row: damping, 1/s, and stiffness over inertia; in MuJoCo's
    steps the joint's damping then acts as MuJoCo's own too. Zeros: the plugin's row.
  servo: of an actuator that exerts gain (command - stiffness q) - damping v: gain, stiffness,
    damping, the least and the largest force, and the delay of commands, s.
  trapezoidal: whether damping acts by the mean velocity of a step, and friction turns when the
    joint does, not with the step, which is of second order; else all as MuJoCo steps.
  second: of what stops the joint besides at one end, as a tendon's limit does: -1 at the low end, 1
    at the high one, 0 nowhere; its solref and solimp.

Raises:
  ValueError: a text cannot be read, or a number is impossible; one sentence says why.)")
      .def(py::init(&MakeJointSimulator), py::arg("lo"), py::arg("hi"), py::arg("texts"),
           py::arg("inertia"), py::arg("row_inertia"), py::arg("weight"), py::arg("hinge"),
           py::arg("solref"), py::arg("solimp"),
           py::arg("friction_row") = std::array<double, 2>{0, 0},
           py::arg("servo") = std::array<double, 6>{1, 0, 0, -HUGE_VAL, HUGE_VAL, 0},
           py::arg("trapezoidal") = false,
           py::arg("second") = SecondStop{0, joda::Stop().solref, joda::Stop().solimp})
      .def("replay", &Replay, py::arg("force"), py::arg("at"), py::arg("start"), py::arg("fresh"),
           py::arg("h"), py::arg("command") = py::none(),
           R"(Steps through forces, set to a start here and there.

Args:
  force: applied at each step, shape (n,).
  at: steps before which the joint is set to a start, increasing from 0, shape (m,).
  start: position and velocity there, shape (m, 2).
  fresh: whether the joint forgets its friction's force there and centres its handle or load;
    otherwise both stay, what is loose in its motion beside the part. Shape (m,).
  h: timestep, s.
  command: of the servo at each step, N m: its force at q = 0 and v = 0; shape (n,). None: zeros.

Returns:
  positions before and after each step, each of shape (n,); NaN from where a number is not finite
  until the next start, which then is fresh.

Raises:
  ValueError: a shape or the order is wrong.)");
}
