#include "controller/machine_numbers.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/nc/orientation.h"
#include "smartmill_core/units.h"

namespace smartmill::sim {
namespace {

using focas::NumberedType;
using focas::NumberedValue;

NumberedValue ofAxes(int number, NumberedType type, std::vector<double> values, int decimals = 0) {
  return {number, type, std::move(values), true, decimals};
}

NumberedValue single(int number, NumberedType type, double value, int decimals = 0) {
  return {number, type, {value}, false, decimals};
}

std::vector<double> all(double value) {
  return {value, value, value};
}

}  // namespace

std::vector<NumberedValue> machineParameters(const ControllerOptions& o) {
  const auto travel = [&](std::size_t end) {
    std::vector<double> values;
    for (const std::array<double, 2>& axis : o.axes.travel) values.push_back(axis[end] / units::MM);
    return values;
  };
  const double rapid = o.axes.rapid / MM_PER_MIN;
  const double rapid_ramp = 1e3 * o.axes.rapid / o.axes.acceleration;  // [ms]
  const double max_speed = units::rpmFromRadPerSec(o.spindle_max_speed);
  std::vector<double> home;
  for (const double at : o.axes.home) home.push_back(at / units::MM);
  return {
      single(0, NumberedType::bits, 0x02),                 // ISO code
      single(20, NumberedType::byte, 9),                   // I/O channel: embedded Ethernet
      single(1001, NumberedType::bits, 0),                 // millimetre machine
      ofAxes(1020, NumberedType::byte, {88, 89, 90}),      // axis names X Y Z
      ofAxes(1022, NumberedType::byte, {1, 2, 3}),         // axes of the basic coordinate system
      ofAxes(1023, NumberedType::double_word, {1, 2, 3}),  // servo axis numbers
      ofAxes(1240, NumberedType::real, home, o.info.position_decimals),       // first reference position [mm]
      ofAxes(1320, NumberedType::real, travel(1), o.info.position_decimals),  // stroke limits [mm]
      ofAxes(1321, NumberedType::real, travel(0), o.info.position_decimals),
      single(1410, NumberedType::real, rapid, 1),                // dry run [mm/min]
      ofAxes(1420, NumberedType::real, all(rapid), 1),           // rapid traverse [mm/min]
      ofAxes(1430, NumberedType::real, all(rapid), 1),           // highest cutting feed [mm/min]
      ofAxes(1620, NumberedType::double_word, all(rapid_ramp)),  // ramp of rapid traverse [ms]
      ofAxes(1825, NumberedType::word, all(o.loop_gain)),
      single(3741, NumberedType::double_word, max_speed),  // spindle at gear 1 [rpm]
      single(3772, NumberedType::double_word, max_speed),  // highest spindle speed [rpm]
      single(4020, NumberedType::double_word, max_speed),  // highest motor speed [rpm]
  };
}

std::vector<NumberedValue> machineDiagnoses(const DiagnosisState& state) {
  std::vector<double> axis_temperature;
  for (const double temperature : state.axis_temperature) axis_temperature.push_back(std::round(temperature));
  const double steps = state.spindle_angle / units::TWO_PI * nc::ORIENT_STEPS;
  return {
      single(0, NumberedType::byte, state.waits_for_m ? 1 : 0),   // waits for FIN
      single(1, NumberedType::byte, state.moves ? 1 : 0),         // motion
      single(2, NumberedType::byte, state.dwells ? 1 : 0),        // dwell
      single(5, NumberedType::byte, state.at_zero_feed ? 1 : 0),  // feed override 0 %
      ofAxes(300, NumberedType::double_word, all(0.0)),           // servo error: ideal axes
      ofAxes(308, NumberedType::byte, axis_temperature),          // servo motor temperature [deg C]
      ofAxes(309, NumberedType::byte, axis_temperature),          // encoder temperature [deg C]
      single(403, NumberedType::byte, std::round(state.spindle_temperature)),  // spindle motor [deg C]
      single(410, NumberedType::real, state.spindle_load, 2),                  // spindle load meter [percent]
      single(445, NumberedType::double_word,
             static_cast<int>(steps)),  // spindle position in steps
  };
}

std::vector<NumberedValue> within(std::vector<NumberedValue> numbers, int first, int last) {
  numbers.erase(std::remove_if(numbers.begin(), numbers.end(),
                               [&](const NumberedValue& n) { return n.number < first || n.number > last; }),
                numbers.end());
  return numbers;
}

}  // namespace smartmill::sim
