#include "smartmill_loadmeter/motor/motor_calibration.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <map>
#include <utility>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/csv.h"
#include "smartmill_core/model/strict_yaml.h"
#include "smartmill_core/units.h"

namespace smartmill::loadmeter {

namespace {

constexpr const char* FORMAT = "smartmill-motor-calibration/1";

/// Table with a text column `cut` and otherwise numbers or empty cells.
class Table {
 public:
  Table(const std::string& file, const std::vector<std::string>& known) {
    CsvReader reader(file);
    std::vector<std::string_view> cells;
    if (!reader.next(&cells)) throw Error(file + ": is empty");
    const std::vector<std::string> names(cells.begin(), cells.end());
    for (std::size_t c = 0; c < names.size(); ++c) {
      if (std::count(names.begin(), names.end(), names[c]) > 1)
        reader.fail("column '" + names[c] + "' is repeated");
      if (names[c] != "cut" && std::find(known.begin(), known.end(), names[c]) == known.end())
        reader.fail("column '" + names[c] + "' is unknown");
    }
    if (std::find(names.begin(), names.end(), "cut") == names.end()) reader.fail("column 'cut' is missing");
    while (reader.next(&cells)) {
      const auto blank = [](std::string_view cell) { return cell.empty(); };
      if (std::all_of(cells.begin(), cells.end(), blank)) continue;
      if (cells.size() != names.size())
        reader.fail(std::to_string(cells.size()) + " cells, expected " + std::to_string(names.size()));
      rows_.push_back(rowOf(reader, names, cells));
    }
    if (rows_.empty()) throw Error(file + ": no cut in the table");
  }

  struct Row {
    int line = 0;
    std::string cut;
    std::map<std::string, double> values;

    std::optional<double> at(const std::string& name) const {
      const auto found = values.find(name);
      if (found == values.end()) return std::nullopt;
      return found->second;
    }
  };
  const std::vector<Row>& rows() const { return rows_; }

 private:
  Row rowOf(const CsvReader& reader, const std::vector<std::string>& names,
            const std::vector<std::string_view>& cells) const {
    Row row;
    row.line = reader.line();
    for (std::size_t c = 0; c < cells.size(); ++c) {
      if (names[c] == "cut") {
        row.cut = cells[c];
      } else if (!cells[c].empty()) {
        row.values[names[c]] = reader.number(cells[c], names[c]);
      }
    }
    if (row.cut.empty()) reader.fail("cut: expected a name");
    for (const Row& other : rows_) {
      if (other.cut == row.cut) reader.fail("cut '" + row.cut + "' is repeated");
    }
    return row;
  }

  std::vector<Row> rows_;
};

std::vector<double> column(const CalibrationSamples& samples, std::size_t i) {
  std::vector<double> values;
  for (const std::vector<double>& input : samples.inputs) values.push_back(input[i]);
  return values;
}

/// Samples of a stored calibration; none in a file of an earlier version.
CalibrationSamples readSamples(const StrictYaml& map, const std::vector<std::string>& inputs,
                               const std::string& output) {
  CalibrationSamples samples;
  if (!map.has(output)) return samples;
  const std::vector<double> outputs = map.numbers(output, 0);
  std::vector<std::vector<double>> columns;
  for (const std::string& key : inputs) columns.push_back(map.numbers(key, outputs.size()));
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    std::vector<double> input;
    for (const std::vector<double>& one : columns) input.push_back(one[i]);
    samples.add(std::move(input), outputs[i]);
  }
  return samples;
}

std::string numbersOf(const std::vector<double>& values) {
  std::string text = "[";
  for (std::size_t i = 0; i < values.size(); ++i) text += (i ? ", " : "") + yamlNumber(values[i], 17);
  return text + "]";
}

}  // namespace

void CalibrationSamples::add(std::vector<double> input, double output) {
  inputs.push_back(std::move(input));
  outputs.push_back(output);
}

std::size_t CalibrationSamples::required() const {
  const std::size_t width = inputs.empty() ? 1 : inputs.front().size();
  const auto rules = std::size_t{1} << width;  // two memberships per input
  return 2 * rules * (width + 1);
}

std::optional<Anfis> CalibrationSamples::learn() const {
  if (inputs.empty() || inputs.size() < required()) return std::nullopt;
  return Anfis(inputs, outputs, {});
}

namespace {

/// @param predict output of the regression of all samples but one, at that one
template <class Predict>
std::optional<MethodErrors> leaveOneOut(const CalibrationSamples& samples, Predict predict) {
  if (samples.inputs.size() <= samples.required()) return std::nullopt;
  MethodErrors errors;
  for (std::size_t i = 0; i < samples.inputs.size(); ++i) {
    CalibrationSamples others = samples;
    others.inputs.erase(others.inputs.begin() + static_cast<std::ptrdiff_t>(i));
    others.outputs.erase(others.outputs.begin() + static_cast<std::ptrdiff_t>(i));
    const std::vector<double>& input = samples.inputs[i];
    bool inside = true;
    for (std::size_t k = 0; k < input.size(); ++k) {
      const std::vector<double> values = column(others, k);
      const auto [low, high] = std::minmax_element(values.begin(), values.end());
      inside = inside && input[k] >= *low && input[k] <= *high;
    }
    if (!inside) continue;
    errors.regression += std::pow(predict(others, input) - samples.outputs[i], 2);
    errors.anfis += std::pow((*others.learn())(input)-samples.outputs[i], 2);
    ++errors.cuts;
  }
  if (errors.cuts == 0) return std::nullopt;
  const auto count = static_cast<double>(errors.cuts);
  errors.regression = std::sqrt(errors.regression / count);
  errors.anfis = std::sqrt(errors.anfis / count);
  return errors;
}

}  // namespace

std::optional<MethodErrors> driveErrors(const CalibrationSamples& samples) {
  return leaveOneOut(samples, [](const CalibrationSamples& others, const std::vector<double>& input) {
    double rr = 0.0, rf = 0.0;
    for (std::size_t i = 0; i < others.outputs.size(); ++i) {
      rr += std::pow(others.inputs[i][0], 2);
      rf += others.inputs[i][0] * others.outputs[i];
    }
    return rf / rr * input[0];
  });
}

std::optional<MethodErrors> spindleErrors(const CalibrationSamples& samples) {
  return leaveOneOut(samples, [](const CalibrationSamples& others, const std::vector<double>& input) {
    std::vector<SpindleCut> cuts;
    double fastest = 0.0;
    for (std::size_t i = 0; i < others.outputs.size(); ++i) {
      cuts.push_back({others.inputs[i][1], others.inputs[i][0], others.outputs[i]});
      fastest = std::max(fastest, others.inputs[i][1]);
    }
    return TorquePowerLaw(cuts, fastest).torque(input[1], input[0]);
  });
}

std::string textOf(const MethodErrors& errors, const char* unit) {
  return formatted(
      "error of a cut predicted from the others %.3g %s by regression, %.3g %s by ANFIS (%zu cuts)",
      errors.regression, unit, errors.anfis, unit, errors.cuts);
}

bool MotorCalibration::hasAnfis() const {
  return spindle_anfis ||
         std::any_of(drive.begin(), drive.end(), [](const auto& d) { return d && d->anfis; });
}

Estimate DriveCalibration::opposing(double current, double air) const {
  const double rise = current - air;
  return {newton_per_ampere.value * rise, std::hypot(newton_per_ampere.std_dev * rise, scatter)};
}

std::vector<StandardCut> readStandardCuts(const std::string& file) {
  const Table table(file, {"force_x[N]", "force_y[N]", "force_z[N]", "torque[N m]"});
  std::vector<StandardCut> cuts;
  for (const Table::Row& row : table.rows()) {
    StandardCut cut;
    cut.name = row.cut;
    for (std::size_t a = 0; a < 3; ++a) cut.force[a] = row.at(std::string("force_") + AXIS_NAMES[a] + "[N]");
    cut.torque = row.at("torque[N m]");
    cuts.push_back(cut);
  }
  return cuts;
}

std::vector<MachineCurrents> readMachineCurrents(const std::string& file) {
  std::vector<std::string> known{"spindle_speed[rpm]"};
  for (const char* axis : {"x", "y", "z", "spindle"}) {
    known.push_back(std::string("current_") + axis + "[A]");
    known.push_back(std::string("air_") + axis + "[A]");
  }
  const Table table(file, known);
  std::vector<MachineCurrents> all;
  for (const Table::Row& row : table.rows()) {
    const std::string where = file + ": line " + std::to_string(row.line) + ": ";
    const auto pair = [&](const std::string& axis, std::optional<double>* current,
                          std::optional<double>* air) {
      *current = row.at("current_" + axis + "[A]");
      *air = row.at("air_" + axis + "[A]");
      if (current->has_value() != air->has_value()) {
        throw Error(where + (*current ? "air_" : "current_") + axis +
                    "[A]: empty; expected currents in cut and in air");
      }
    };
    MachineCurrents c;
    c.name = row.cut;
    c.spindle_speed = units::radPerSecFromRpm(row.at("spindle_speed[rpm]").value_or(0.0));
    for (std::size_t a = 0; a < 3; ++a) pair(AXIS_NAMES[a], &c.current[a], &c.air[a]);
    pair("spindle", &c.spindle_current, &c.spindle_air);
    if (c.spindle_current && !(c.spindle_speed > 0.0)) {
      throw Error(where + "spindle_speed[rpm]: expected > 0 with a current of the spindle");
    }
    all.push_back(c);
  }
  return all;
}

namespace {

// Currents of the machine and forces that the dynamometer recorded in the same cuts.
struct MatchedCuts {
  std::array<std::vector<double>, 3> rises, forces;  // [A], [N]
  std::vector<SpindleCut> spindle;
};

MatchedCuts match(const std::vector<StandardCut>& cuts, const std::vector<MachineCurrents>& currents,
                  std::vector<std::string>* notes) {
  std::map<std::string, const StandardCut*> standard;
  for (const StandardCut& cut : cuts) {
    if (!standard.emplace(cut.name, &cut).second) throw Error("standard cut '" + cut.name + "' is repeated");
  }
  MatchedCuts matched;
  for (const MachineCurrents& c : currents) {
    const auto found = standard.find(c.name);
    if (found == standard.end()) {
      notes->push_back("cut '" + c.name + "' is not a standard cut, ignored");
      continue;
    }
    const StandardCut& cut = *found->second;
    for (std::size_t a = 0; a < 3; ++a) {
      if (!c.current[a] || !cut.force[a]) continue;
      matched.rises[a].push_back(*c.current[a] - *c.air[a]);
      matched.forces[a].push_back(*cut.force[a]);
    }
    if (c.spindle_current && cut.torque) {
      matched.spindle.push_back(
          {units::rpmFromRadPerSec(c.spindle_speed), *c.spindle_current - *c.spindle_air, *cut.torque});
    }
  }
  return matched;
}

// F = m (I - Ia) of one axis; empty with fewer than three cuts.
std::optional<DriveCalibration> calibrateDrive(const char* axis, const std::vector<double>& rises,
                                               const std::vector<double>& forces,
                                               std::vector<std::string>* notes) {
  const std::size_t n = rises.size();
  if (n == 0) return std::nullopt;
  if (n < 3) {
    notes->push_back(std::string("axis ") + axis + ": " + std::to_string(n) +
                     " standard cuts in which it moves, expected three or more; not calibrated");
    return std::nullopt;
  }
  double rr = 0.0, rf = 0.0, left = 0.0;
  for (std::size_t i = 0; i < n; ++i) rr += rises[i] * rises[i], rf += rises[i] * forces[i];
  if (!(rr > 0.0)) throw Error(std::string("axis ") + axis + ": its currents in cut equal those in air");
  DriveCalibration drive;
  drive.cuts = static_cast<int>(n);
  drive.newton_per_ampere.value = rf / rr;
  for (std::size_t i = 0; i < n; ++i)
    left += std::pow(forces[i] - drive.newton_per_ampere.value * rises[i], 2);
  drive.scatter = std::sqrt(left / static_cast<double>(n - 1));
  drive.newton_per_ampere.std_dev = drive.scatter / std::sqrt(rr);
  for (std::size_t i = 0; i < n; ++i) drive.samples.add({rises[i]}, forces[i]);
  drive.anfis = drive.samples.learn();
  // Without a rise of the current there is no force: an intercept indicates other air cuts.
  const Line line = fitLine(rises, forces);
  if (std::abs(line.level.value) > 4.0 * line.level.std_dev + 1e-9 * std::sqrt(rf)) {
    notes->push_back(
        formatted("axis %s: force %.1f +- %.1f N without a rise of the current, expected 0: check that the "
                  "air currents "
                  "are of the same motion",
                  axis, line.level.value, line.level.std_dev));
  }
  return drive;
}

}  // namespace

MotorCalibration calibrateMotors(const std::vector<StandardCut>& cuts,
                                 const std::vector<MachineCurrents>& currents, double base_speed) {
  MotorCalibration result;
  const MatchedCuts matched = match(cuts, currents, &result.notes);
  for (std::size_t a = 0; a < 3; ++a) {
    result.drive[a] = calibrateDrive(AXIS_NAMES[a], matched.rises[a], matched.forces[a], &result.notes);
  }
  if (!matched.spindle.empty()) {
    result.spindle = TorquePowerLaw(matched.spindle, units::rpmFromRadPerSec(base_speed));
    for (const SpindleCut& cut : matched.spindle)
      result.spindle_samples.add({cut.rise, cut.speed_rpm}, cut.torque);
    result.spindle_anfis = result.spindle_samples.learn();
  }
  if (!result.drive[0] && !result.drive[1] && !result.drive[2] && !result.spindle) {
    throw Error(
        "motor calibration: expected an axis or the spindle with three or more standard cuts and currents");
  }
  return result;
}

void writeMotorCalibration(const MotorCalibration& calibration, const std::string& file) {
  std::ofstream out(file);
  out << "format: " << FORMAT << "\ndrives:\n";
  bool any = false;
  for (std::size_t a = 0; a < 3; ++a) {
    if (!calibration.drive[a]) continue;
    const DriveCalibration& d = *calibration.drive[a];
    any = true;
    out << "  " << AXIS_NAMES[a] << ": {newton_per_ampere: " << yamlNumber(d.newton_per_ampere.value, 17)
        << ", newton_per_ampere_std: " << yamlNumber(d.newton_per_ampere.std_dev, 17)
        << ", scatter_n: " << yamlNumber(d.scatter, 17) << ", cuts: " << d.cuts;
    if (!d.samples.inputs.empty()) {
      out << ", rise_a: " << numbersOf(column(d.samples, 0)) << ", force_n: " << numbersOf(d.samples.outputs);
    }
    out << "}\n";
  }
  if (!any) out << "  {}\n";
  if (calibration.spindle) {
    const TorquePowerLaw& law = *calibration.spindle;
    out << "spindle:\n  base_speed_rpm: " << yamlNumber(law.baseSpeed(), 17)
        << "\n  scatter_nm: " << yamlNumber(law.scatter(), 17) << "\n";
    if (!calibration.spindle_samples.inputs.empty()) {
      out << "  rise_a: " << numbersOf(column(calibration.spindle_samples, 0))
          << "\n  speed_rpm: " << numbersOf(column(calibration.spindle_samples, 1))
          << "\n  torque_nm: " << numbersOf(calibration.spindle_samples.outputs) << "\n";
    }
    for (const bool above : {false, true}) {
      const auto& side = law.side(above);
      if (!side) continue;
      out << "  " << (above ? "above" : "below") << ": {middle_rpm: " << yamlNumber(side->middle, 17)
          << ", span_rpm: " << yamlNumber(side->span, 17) << ", a: " << numbersOf(side->a)
          << ", b: " << numbersOf(side->b) << "}\n";
    }
  }
  out.close();
  if (!out) throw Error(file + ": cannot be written");
}

MotorCalibration readMotorCalibration(const std::string& file) {
  const StrictYaml yaml = StrictYaml::fromFile(file);
  yaml.oneOf("format", {FORMAT});
  MotorCalibration calibration;
  const StrictYaml drives = yaml.map("drives");
  for (std::size_t a = 0; a < 3; ++a) {
    const auto map = drives.optionalMap(AXIS_NAMES[a]);
    if (!map) continue;
    DriveCalibration d;
    d.newton_per_ampere.value = map->number("newton_per_ampere");
    d.newton_per_ampere.std_dev = map->number("newton_per_ampere_std", Range::notNegative());
    d.scatter = map->number("scatter_n", Range::notNegative());
    d.cuts = map->integer("cuts", 3, std::numeric_limits<int>::max());
    d.samples = readSamples(*map, {"rise_a"}, "force_n");
    d.anfis = d.samples.learn();
    map->finish();
    calibration.drive[a] = d;
  }
  drives.finish();
  if (const auto map = yaml.optionalMap("spindle")) {
    std::array<std::optional<TorquePowerLaw::Side>, 2> sides;
    for (const bool above : {false, true}) {
      const auto one = map->optionalMap(above ? "above" : "below");
      if (!one) continue;
      TorquePowerLaw::Side side;
      side.middle = one->number("middle_rpm", Range::positive());
      side.span = one->number("span_rpm", Range::positive());
      side.a = one->numbers("a", 0);
      side.b = one->numbers("b", 0);
      one->finish();
      sides[above ? 1 : 0] = side;
    }
    calibration.spindle = TorquePowerLaw(sides[0], sides[1], map->number("base_speed_rpm", Range::positive()),
                                         map->number("scatter_nm", Range::notNegative()));
    calibration.spindle_samples = readSamples(*map, {"rise_a", "speed_rpm"}, "torque_nm");
    calibration.spindle_anfis = calibration.spindle_samples.learn();
    map->finish();
  }
  yaml.finish();
  return calibration;
}

}  // namespace smartmill::loadmeter
