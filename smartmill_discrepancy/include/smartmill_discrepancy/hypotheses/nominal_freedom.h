#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

#include "smartmill_core/model/effect_form.h"
#include "smartmill_core/model/machine_model.h"

namespace smartmill::discrepancy {

/// Values of the nominal model that are free within their stated uncertainty. Each coordinate is the natural
/// logarithm of value over nominal value. A tool has one more coordinate, which no nominal model states: the
/// share between the surface of the rule in formats.md (0) and that of the true tooth path (1), written as
/// the entry `empirical:tooth_path`.
class NominalFreedom {
 public:
  explicit NominalFreedom(const MachineModel& nominal);
  const std::vector<Coordinate>& coordinates() const { return coordinates_; }
  /// [unit of the key in the model file] Stated value of a coordinate; none of the path share, which no model
  /// states.
  std::optional<double> stated(std::size_t coordinate) const;
  /// The model with these values. values.size() == coordinates().size()
  MachineModel apply(const MachineModel& nominal, const std::vector<double>& values) const;
  /// Index of the path share; none without a tool.
  std::optional<std::size_t> pathShare() const;
  /// Whether a share exceeds its standard deviation enough, towards the true path.
  bool isPathShareSignificant(double share, double std_dev) const;
  /// Writes the standard deviations that the file format supports (cutting coefficients, path share) and
  /// removes an insignificant path share.
  void writeStdDevs(MachineModel& model, const std::vector<double>& std_devs) const;

 private:
  using Scale = std::function<void(MachineModel&, double factor)>;
  /// @param value [unit of the key]
  void add(std::string name, double value, double percent, Scale scale);
  void addCutting(const MachineModel& nominal);
  void addModes(const MachineModel& nominal);
  void addToothPath();
  void addSpindle(const MachineModel& nominal);

  std::vector<Coordinate> coordinates_;
  std::vector<std::optional<double>> stated_;
  std::vector<Scale> scale_;
};

/// The entry `empirical:tooth_path` of a model, or nullptr.
const EffectEntry* toothPathOf(const MachineModel& model);

}  // namespace smartmill::discrepancy
