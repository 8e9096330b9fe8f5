#pragma once

#include <pybind11/pybind11.h>

namespace smartmill::python {

// Each adds the functions of one library to the module.
void addModel(pybind11::module_& m);
void addSimulate(pybind11::module_& m);
void addDiscrepancy(pybind11::module_& m);
void addStability(pybind11::module_& m);
void addModal(pybind11::module_& m);
void addLoadmeter(pybind11::module_& m);
void addKalman(pybind11::module_& m);

}  // namespace smartmill::python
