#pragma once

#include <functional>
#include <vector>

#include "smartmill_core/model/effect_form.h"
#include "smartmill_core/model/machine_model.h"

namespace smartmill::discrepancy {

/// Values of the nominal model, free within their stated uncertainty: each coordinate is the natural
/// logarithm of value over nominal value.
class NominalFreedom {
 public:
  explicit NominalFreedom(const MachineModel& nominal);
  const std::vector<Coordinate>& coordinates() const { return coordinates_; }
  /// The model with these values. values.size() == coordinates().size()
  MachineModel apply(const MachineModel& nominal, const std::vector<double>& values) const;
  /// Writes the standard deviations that the file format has a place for (cutting coefficients).
  void writeStdDevs(MachineModel& model, const std::vector<double>& std_devs) const;

 private:
  using Scale = std::function<void(MachineModel&, double factor)>;
  void add(std::string name, double value, double percent, Scale scale);
  void addCutting(const MachineModel& nominal);
  void addModes(const MachineModel& nominal);
  void addSpindle(const MachineModel& nominal);

  std::vector<Coordinate> coordinates_;
  std::vector<Scale> scale_;
};

}  // namespace smartmill::discrepancy
