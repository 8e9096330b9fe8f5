// Data items of the cut: forces, chatter, what is cut.
#include <cmath>

#include "items/declarations.h"
#include "smartmill_core/names.h"

namespace smartmill::exchange {
namespace {

constexpr double PERCENT = 100.0;
constexpr const char* COMPENSATED = "up to `bandwidth` of `kalman.yaml`, 5 kHz as shipped";
constexpr const char* SENSOR_ERROR = "force_error, relative";
constexpr const char* AT_CHANGE = "at each change";
constexpr char AXES[] = {'x', 'y', 'z'};

double componentOf(const plain::Vector3& v, std::size_t axis) {
  return axis == 0 ? v.x : axis == 1 ? v.y : v.z;
}

DataItem forceItem(const std::string& id, const std::string& statistic, const std::string& meaning,
                   const std::string& uncertainty, const std::string& bandwidth) {
  return {id,       "c_force", Category::sample, "LINEAR_FORCE", "",       statistic,
          "NEWTON", false,     meaning,          uncertainty,    bandwidth};
}

using Chatter = plain::ChatterState;
template <class Get>
std::function<Value(const Chatter&, const Picture&)> steady(Get get) {
  return [get](const Chatter& m, const Picture&) { return m.valid ? Value(get(m)) : Value(Unavailable{}); };
}

}  // namespace

ItemsOf<plain::CuttingCondition> conditionItems() {
  using Condition = plain::CuttingCondition;
  return {names::CUTTING_CONDITION,
          false,
          {{{"cut", "c_path", Category::event, "s:CUT", "", "", "", false, "name of the running cut or test",
             "none", AT_CHANGE},
            [](const Condition& m, const Picture&) {
              return m.kind == Condition::NONE ? Value(Unavailable{}) : textOrNone(m.name);
            }},
           {{"tool", "c_path", Category::event, "s:TOOL", "", "", "", false, "name of its tool", "none",
             AT_CHANGE},
            [](const Condition& m, const Picture&) {
              return m.kind == Condition::NONE ? Value(Unavailable{}) : textOrNone(m.tool);
            }},
           {{"material", "c_path", Category::event, "MATERIAL", "", "", "", false,
             "name of its workpiece material", "none", AT_CHANGE},
            [](const Condition& m, const Picture&) {
              return m.kind == Condition::CUT ? textOrNone(m.material) : Value(Unavailable{});
            }}}};
}

ItemsOf<ForceFeatures> featureItems() {
  using F = ForceFeatures;
  ItemsOf<F> list{names::FORCE_COMPENSATED, true, {}};
  list.items.push_back({forceItem("force_peak", "MAXIMUM",
                                  "largest force on the tool in the plane of x and y over whole revolutions",
                                  SENSOR_ERROR, COMPENSATED),
                        [](const F& f, const Picture&) { return numberOrNone(f.peak); }});
  for (std::size_t a = 0; a < 3; ++a)
    list.items.push_back(
        {forceItem(std::string("force_peak_") + AXES[a], "MAXIMUM",
                   std::string("largest magnitude of the force along ") + AXES[a] + " over whole revolutions",
                   SENSOR_ERROR, COMPENSATED),
         [a](const F& f, const Picture&) { return numberOrNone(f.largest[a]); }});
  for (std::size_t a = 0; a < 3; ++a)
    list.items.push_back(
        {forceItem(std::string("force_rms_") + AXES[a], "ROOT_MEAN_SQUARE",
                   std::string("root mean square of the force along ") + AXES[a] + " over whole revolutions",
                   SENSOR_ERROR, COMPENSATED),
         [a](const F& f, const Picture&) { return numberOrNone(f.rms[a]); }});
  DataItem by_tooth = forceItem("force_peak_tooth", "MAXIMUM",
                                "largest force in the plane of x and y of each tooth, keys t1, t2, ...",
                                SENSOR_ERROR, COMPENSATED);
  by_tooth.set = true;
  list.items.push_back({by_tooth, [](const F& f, const Picture&) {
                          DataSet teeth;
                          for (std::size_t k = 0; k < f.peak_of_tooth.size(); ++k)
                            teeth.emplace_back("t" + std::to_string(k + 1), f.peak_of_tooth[k]);
                          return teeth.empty() ? Value(Unavailable{}) : Value(teeth);
                        }});
  return list;
}

ItemsOf<plain::ForceEstimate> estimateItems() {
  using E = plain::ForceEstimate;
  ItemsOf<E> list{names::FORCE_ESTIMATE, false, {}};
  constexpr const char* OF_A_CUT = "one value for a cut or for each `force_window` of `loadmeter.yaml`";
  for (std::size_t a = 0; a < 3; ++a) {
    const std::string axis(1, AXES[a]), id = "force_mean_" + axis;
    list.items.push_back(
        {forceItem(id, "AVERAGE", "mean force along " + axis + ", from all sensors of the machine",
                   id + "_std", OF_A_CUT),
         [a](const E& m, const Picture&) { return numberOrNone(componentOf(m.mean, a)); }});
    list.items.push_back(
        {forceItem(id + "_std", "STANDARD_DEVIATION", "standard deviation of " + id, "none", OF_A_CUT),
         [a](const E& m, const Picture&) { return numberOrNone(componentOf(m.mean_std, a)); }});
  }
  const DataItem torque{"cutting_torque",
                        "c_spindle",
                        Category::sample,
                        "TORQUE",
                        "",
                        "AVERAGE",
                        "NEWTON_METER",
                        false,
                        "mean torque of the cut, from all sensors of the machine",
                        "cutting_torque_std",
                        OF_A_CUT};
  DataItem deviation = torque;
  deviation.id += "_std";
  deviation.statistic = "STANDARD_DEVIATION";
  deviation.meaning = "standard deviation of cutting_torque";
  deviation.uncertainty = "none";
  list.items.push_back({torque, [](const E& m, const Picture&) { return numberOrNone(m.torque); }});
  list.items.push_back({deviation, [](const E& m, const Picture&) { return numberOrNone(m.torque_std); }});
  return list;
}

ItemsOf<plain::ForceSensorState> sensorItems() {
  using S = plain::ForceSensorState;
  return {names::FORCE_SENSOR,
          false,
          {{{"force_sensor", "c_force", Category::condition, "HARDWARE", "", "", "", false,
             "warning while the force sensor is not calibrated and publishes no force", "none", AT_CHANGE},
            [](const S& m, const Picture&) {
              return m.calibrated ? Activations{}
                                  : Activations{{false, "NOT_CALIBRATED", m.sensor + ": " + m.message}};
            }},
           {{"force_error", "c_force", Category::sample, "s:FORCE_ERROR", "", "", "PERCENT", true,
             "expected error of the compensated force along each axis, relative to the force, keys x, y, z",
             "none", AT_CHANGE},
            [](const S& m, const Picture&) {
              DataSet errors;
              for (std::size_t a = 0; a < 3; ++a) {
                const double error = PERCENT * componentOf(m.error, a);
                if (std::isfinite(error)) errors.emplace_back(std::string(1, AXES[a]), error);
              }
              return errors.empty() ? Value(Unavailable{}) : Value(errors);
            }}}};
}

ItemsOf<Chatter> chatterItems() {
  constexpr const char* WINDOW = "one value for each window of the detection (`stability.yaml`)";
  return {
      names::CHATTER_STATE,
      true,
      {{{"chatter", "c_path", Category::condition, "SYSTEM", "", "", "", false,
         "fault while the running cut chatters", "a threshold: `chatter_energy`", WINDOW},
        [](const Chatter& m, const Picture&) {
          if (!m.valid) return Value(Unavailable{});
          return Value(m.chatter ? Activations{{true, "CHATTER",
                                                m.condition + " chatters at " +
                                                    numberText(std::round(m.frequency)) + " Hz"}}
                                 : Activations{});
        }},
       {{"chatter_frequency", "c_path", Category::sample, "FREQUENCY", "", "", "HERTZ", false,
         "strongest line of the force outside the spindle's harmonics", "line spacing of the window", WINDOW},
        steady([](const Chatter& m) { return numberOrNone(m.frequency); })},
       {{"chatter_energy", "c_path", Category::sample, "s:CHATTER_ENERGY", "", "", "PERCENT", false,
         "energy of the force outside the spindle's harmonics, relative to all energy", "none", WINDOW},
        steady([](const Chatter& m) { return numberOrNone(PERCENT * m.energy_ratio); })},
       {{"chatter_force", "c_path", Category::sample, "LINEAR_FORCE", "", "ROOT_MEAN_SQUARE", "NEWTON", false,
         "root mean square of the force outside the spindle's harmonics", SENSOR_ERROR, WINDOW},
        steady([](const Chatter& m) { return numberOrNone(m.severity); })}}};
}

}  // namespace smartmill::exchange
