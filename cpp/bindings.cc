// joda._core: the C++ field in Python, and the swap of a profile in an existing mjData.
#include <mujoco/mujoco.h>
#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "attributes.h"
#include "field.h"
#include "joint_dynamics.h"

namespace py = pybind11;

PYBIND11_MODULE(_core, module) {
  module.doc() = "C++ core of JODA: channels of a profile, and profiles inside mjData.";

  py::class_<joda::PiecewiseCubic>(module, "Channel", R"(A channel of a profile, merged at load.

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
          [](const joda::PiecewiseCubic& channel, py::array_t<double, py::array::forcecast> s) {
            py::array_t<double> value(std::vector<py::ssize_t>(s.shape(), s.shape() + s.ndim()));
            py::array_t<double> slope(std::vector<py::ssize_t>(s.shape(), s.shape() + s.ndim()));
            const auto dense = py::array_t<double, py::array::c_style>::ensure(s);
            for (py::ssize_t i = 0; i < dense.size(); ++i) {
              const joda::Sample sample = channel(dense.data()[i]);
              value.mutable_data()[i] = sample.value;
              slope.mutable_data()[i] = sample.slope;
            }
            return std::make_pair(value, slope);
          },
          py::arg("s"), "Value and slope d/ds at normalised positions s, arrays of the shape of s.")
      .def("max_descent", py::overload_cast<>(&joda::PiecewiseCubic::MaxDescent, py::const_),
           "Largest stiffness max(-dF/ds, 0) anywhere on the channel.")
      .def_property_readonly("knots", &joda::PiecewiseCubic::knots,
                             "Breakpoints in s, shape (n + 1,).")
      .def_property_readonly("coefficients", &joda::PiecewiseCubic::coefficients,
                             "c0..c3 of each piece about its left knot, shape (4, n).");

  module.def(
      "set_profile",
      [](std::uintptr_t model, std::uintptr_t data, int joint, double lo, double hi,
         const std::array<std::string, 7>& texts) {
        const char* pointers[7];
        for (int i = 0; i < 7; ++i) pointers[i] = texts[i].c_str();
        char error[1024];
        if (joda_set_profile(reinterpret_cast<const mjModel*>(model),
                             reinterpret_cast<mjData*>(data), joint, lo, hi, pointers, error,
                             sizeof error)) {
          throw py::value_error(error);
        }
      },
      py::arg("model_address"), py::arg("data_address"), py::arg("joint"), py::arg("lo"),
      py::arg("hi"), py::arg("texts"),
      "Replaces the profile of a joint in one mjData; texts: channel and combine, three times, "
      "then "
      "the effects.");
}
