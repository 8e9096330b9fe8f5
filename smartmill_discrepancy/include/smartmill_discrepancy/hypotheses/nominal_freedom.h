#pragma once

#include <functional>
#include <vector>

#include "smartmill_core/model/effect_form.h"
#include "smartmill_core/model/machine_model.h"

namespace smartmill::discrepancy {

/// Values of the nominal model, free within their stated uncertainty: each coordinate is the natural
/// logarithm of value over nominal value. Of a tool there is one more, which no nominal model states: how far
/// the surface that its teeth leave where it vibrates lies from the rule of formats.md (0) towards that of
/// their true path (1), an entry `empirical:tooth_path`.
class NominalFreedom {
 public:
  explicit NominalFreedom(const MachineModel& nominal);
  const std::vector<Coordinate>& coordinates() const { return coordinates_; }
  /// The model with these values. values.size() == coordinates().size()
  MachineModel apply(const MachineModel& nominal, const std::vector<double>& values) const;
  /// Writes the standard deviations that the file format has a place for (cutting coefficients, share of the
  /// teeth's path), and leaves out a share that is no more than three of them.
  void writeStdDevs(MachineModel& model, const std::vector<double>& std_devs) const;

 private:
  using Scale = std::function<void(MachineModel&, double factor)>;
  void add(std::string name, double value, double percent, Scale scale);
  void addCutting(const MachineModel& nominal);
  void addModes(const MachineModel& nominal);
  void addToothPath();
  void addSpindle(const MachineModel& nominal);

  std::vector<Coordinate> coordinates_;
  std::vector<Scale> scale_;
};

/// The entry `empirical:tooth_path` of a model; nullptr: it has none.
const EffectEntry* toothPathOf(const MachineModel& model);

}  // namespace smartmill::discrepancy
