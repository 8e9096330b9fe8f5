#pragma once

#include <string>
#include <utility>
#include <vector>

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/campaign/record.h"
#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/model/machine_model.h"

namespace smartmill::python {

namespace py = pybind11;

/// A contiguous array of float64; smartmill/_arguments.py has checked it.
using Array = py::array_t<double, py::array::c_style>;

/// A copy that lives without the interpreter.
std::vector<double> vectorOf(const Array& array);
/// Takes the vector over, without a copy.
py::array arrayOf(std::vector<double> values);
/// Rows of equal length as a 2-D array.
py::array arrayOf(const std::vector<std::vector<double>>& rows);

/// A tuple of what `convert` makes of each item.
template <typename Items, typename Convert>
py::tuple tupleOf(const Items& items, const Convert& convert) {
  py::list list;
  for (const auto& item : items) list.append(convert(item));
  return py::tuple(list);
}

/// A dataclass of smartmill/results.py.
template <typename... Arguments>
py::object make(const char* name, Arguments&&... arguments) {
  return py::module_::import("smartmill.results").attr(name)(std::forward<Arguments>(arguments)...);
}

/// Estimate(value, std); NaN: not known.
py::object estimate(double value, double std_dev);

py::object toPython(const Mode& mode);
py::object toPython(const std::vector<Mode>& modes);
py::object toPython(const ToolGeometry& tool);
/// @param std_dev nullptr: not known
py::object toPython(const CuttingCoefficients& value, const CuttingCoefficients* std_dev);
py::object toPython(const Engagement& engagement, double spindle_speed, double feed_direction = 0.0);
py::object toPython(const CampaignTest& test, Record record);

/// The reverse, of the dataclasses.
ModalModel receptanceOf(const py::object& modes);
/// Static gain 1: direct = 1 - sum of gains. None: ideal.
ModalModel sensorOf(const py::object& modes);
ToolGeometry toolOf(const py::object& tool);
CuttingCoefficients coefficientsOf(const py::object& coefficients, bool std_dev);
Engagement engagementOf(const py::object& cut);

/// The campaign's own model where no file or Model is given.
MachineModel modelOf(const Campaign& campaign, const std::optional<MachineModel>& model);

}  // namespace smartmill::python
