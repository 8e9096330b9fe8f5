#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

#include "smartmill_core/model/effect_form.h"
#include "smartmill_core/model/machine_model.h"

namespace smartmill::discrepancy {

struct NominalFreedomOptions {
  /// [1] standard deviations to the bounds: too narrow to hide an effect that the value could replace.
  double reach = 4.5;
  double step = 2e-3;  ///< [1] standard deviations: of numerical derivatives
  /// [1] Path share: bounds beyond both surfaces (0 and 1), step, prior.
  double path_low = -0.5, path_high = 1.5, path_step = 0.02, path_std = 0.5;
  double min_path_deviations = 3.0;  ///< standard deviations from which a path share is written
};

/// Values of the nominal model that are free within their stated uncertainty. Each coordinate is the natural
/// logarithm of value over nominal value. A tool has one more coordinate, which no nominal model states: the
/// share between the surface of the rule in formats.md (0) and that of the true tooth path (1), written as
/// the entry `empirical:tooth_path`.
class NominalFreedom {
 public:
  explicit NominalFreedom(const MachineModel& nominal, const NominalFreedomOptions& options = {});
  const std::vector<Coordinate>& coordinates() const { return coordinates_; }
  /// [unit of the key in the model file] Stated value of a coordinate; none of the path share, which no model
  /// states.
  std::optional<double> stated(std::size_t coordinate) const;
  /// The model with these values. values.size() == coordinates().size()
  MachineModel apply(const MachineModel& nominal, const std::vector<double>& values) const;
  /// Index of the path share; none without a tool.
  std::optional<std::size_t> pathShare() const;
  /// Whether a share exceeds its standard deviation enough.
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

  NominalFreedomOptions options_;
  std::vector<Coordinate> coordinates_;
  std::vector<std::optional<double>> stated_;
  std::vector<Scale> scale_;
};

/// The entry `empirical:tooth_path` of a model, or nullptr.
const EffectEntry* toothPathOf(const MachineModel& model);

}  // namespace smartmill::discrepancy
