#include "smartmill_loadmeter/identification/identification.h"

#include "smartmill_core/error.h"
#include "smartmill_loadmeter/identification/idle_torque.h"

namespace smartmill::loadmeter {

namespace {

// Fewer readings of the load meter in a window than this do not show their scatter.
constexpr int FEWEST_IN_WINDOW = 5;
constexpr double STAMP_ROUNDING = 1e-6;  // [s]

}  // namespace

void IdentificationParameters::validate() const {
  checkBounds(*this);
  motor.validate();
  checkBounds(force);
  checkBounds(temperature);
  checkBounds(inspection);
}

double IdentificationParameters::timeWithoutReadings(const Spindle& spindle) const {
  return settle_time_constants * timeConstant(spindle.load_meter_bandwidth) + guard_time;
}

LoadMeterIdentification::LoadMeterIdentification(const MachineModel& model,
                                                 const IdentificationParameters& parameters)
    : spindle_(model.needSpindle("read the load meter")),
      spindle_uncertainty_(model.uncertainty.spindle),
      parameters_(parameters),
      steady_(spindle_, parameters),
      forces_(parameters.motor, parameters.force, model.axes),
      temperature_(parameters.temperature),
      production_(parameters.production_memory) {
  parameters.validate();
  if (!spindle_.load_meter_full_scale) {
    throw Error(model.file + ": spindle.load_meter_full_scale_v is missing (required for the load meter)");
  }
}

void LoadMeterIdentification::reset() {
  steady_.reset();
  forces_.clear();
  temperature_.clear();
  production_.clear();
  session_.clear();
  made_.clear();
  next_window_ = 0.0;
}

void LoadMeterIdentification::handle(const CncState& state) {
  forces_.handle(state);
  steady_.handle(state);
}

void LoadMeterIdentification::handle(const SampleBlock& block) {
  if (!forces_.usesMotors()) return;
  forces_.handle(block);
  steady_.handle(block);
}

void LoadMeterIdentification::handle(const LoadSample& sample) {
  temperature_.handle(sample);
  const SteadyRecord::Reading reading = steady_.handle(sample);
  if (reading == SteadyRecord::Reading::unknown) ++session_.unknown_loads;
  if (reading == SteadyRecord::Reading::steady && outputs_.force_window && parameters_.force.period > 0.0 &&
      steady_.isCut())
    estimateWindow(sample.stamp);
}

void LoadMeterIdentification::handle(const CuttingCondition& condition) {
  if (steady_.isPresent(condition)) return;
  closeTest();
  steady_.begin(condition);
  made_.handle(condition, temperature_, production_);
}

void LoadMeterIdentification::handle(const InspectionFeature& feature) {
  if (outputs_.inspected) outputs_.inspected(inspect(feature, made_, parameters_.inspection));
}

void LoadMeterIdentification::handle(const IdentifyGoal& goal) {
  IdentifyResult result;
  if (goal.reset) {
    // The present condition remains: its test starts again.
    steady_.clear();
    forces_.clearCalibration();
    session_.clear();
    result.reset = true;
    result.id = goal.id;
    result.message = "earlier tests discarded";
    result.coefficients.stamp = goal.stamp;
    result.coefficients.value = result.coefficients.std_dev = NOT_IDENTIFIED;
  } else {
    closeTest();
    steady_.begin(std::nullopt);
    result = identifySession(session_, goal, spindle_, spindle_uncertainty_, parameters_.largest_runout);
    result.record.edge_age = production_.edgeAge(result.record.set.tool);
    if (result.code == IdentifyResult::Code::ok) result.message += forces_.calibrationText();
  }
  if (outputs_.result) outputs_.result(result);
}

void LoadMeterIdentification::closeTest() {
  if (!steady_.isTest()) return;
  steady_.end();
  if (steady_.readings() >= static_cast<std::size_t>(parameters_.minimum_readings))
    return storeTest(steady_.test());
  const std::string unknown =
      steady_.unknown() > 0 ? " (" + countOf(steady_.unknown(), "load sample") + " not known)" : "";
  session_.reject("'" + steady_.condition()->name + "': " + countOf(steady_.readings(), "steady reading") +
                  unknown + ", expected " + std::to_string(parameters_.minimum_readings) + " or more");
}

void LoadMeterIdentification::storeTest(LoadTest test) {
  const double began = test.stamp - test.duration;
  test.temperature = temperature_.spindle(began, test.stamp);
  forces_.addMotors(steady_.motor(), steady_.velocity(), false, session_.air_cuts, &test);
  for (std::size_t a = 0; test.motor && a < 3; ++a)
    test.motor->temperature[a] = temperature_.axis(a, began, test.stamp).value;
  const bool cut = test.isCut();
  session_.add(test);
  std::optional<Estimate> torque;
  if (cut) {
    torque = torqueOf(test);
    const double own_std = test.torqueStdAsVoltage() / (spindle_.load_meter_gain * test.speed);
    const auto record = production_.add(test, torque, own_std, forces_.meanForce(test, session_.air_cuts));
    if (record && outputs_.cut) outputs_.cut(*record);
  }
  forces_.calibrate(test, torque, session_.air_cuts);
  if (outputs_.test) outputs_.test(test);
  if (outputs_.motor_force && test.force) outputs_.motor_force(*test.force);
  if (!cut || !outputs_.force) return;
  if (const auto found = forces_.estimate(test, torque, session_.air_cuts)) outputs_.force(*found);
}

// Force over the last window of a steady cut.
void LoadMeterIdentification::estimateWindow(double now) {
  const double window = parameters_.force.window, since = now - window;
  if (now < next_window_ || steady_.firstStamp() > since) return;
  next_window_ = now + parameters_.force.period - STAMP_ROUNDING;
  LoadTest part = steady_.test(since);
  if (part.readings < FEWEST_IN_WINDOW) return;
  forces_.addMotors(steady_.motor().last(window), steady_.velocity(), true, session_.air_cuts, &part);
  if (const auto found = forces_.estimate(part, torqueOf(part), session_.air_cuts))
    outputs_.force_window(*found);
}

std::optional<Estimate> LoadMeterIdentification::torqueOf(const LoadTest& cut) const {
  return cuttingTorque(cut, session_.air_cuts, spindle_, spindle_uncertainty_);
}

}  // namespace smartmill::loadmeter
