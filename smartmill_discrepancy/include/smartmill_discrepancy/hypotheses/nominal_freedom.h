#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

#include "smartmill_core/model/effect_form.h"
#include "smartmill_core/model/machine_model.h"

namespace smartmill::discrepancy {

/// Values of the nominal model, free within their stated uncertainty: each coordinate is the natural
/// logarithm of value over nominal value. Of a tool there is one more, which no nominal model states: how far
/// the surface that its teeth leave lies from the rule of formats.md (0) towards that of
/// their true path (1), an entry `empirical:tooth_path`.
class NominalFreedom {
 public:
  explicit NominalFreedom(const MachineModel& nominal);
  const std::vector<Coordinate>& coordinates() const { return coordinates_; }
  /// The model with these values. values.size() == coordinates().size()
  MachineModel apply(const MachineModel& nominal, const std::vector<double>& values) const;
  /// Which coordinate is the share of the teeth's path; none without a tool.
  std::optional<std::size_t> pathShare() const;
  /// Whether a share is more than three of its deviations.
  static bool tellsPath(double share, double std_dev);
  /// Writes the standard deviations that the file format has a place for (cutting coefficients, share of the
  /// teeth's path), and leaves out a share that is not told.
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
