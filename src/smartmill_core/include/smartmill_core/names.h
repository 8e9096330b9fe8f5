#pragma once

#include <string>

namespace smartmill::names {

// Topics, services and actions, relative to the namespace /smartmill.
constexpr const char* NAMESPACE = "/smartmill";

constexpr const char* HAMMER = "daq/hammer";
constexpr const char* DYNAMOMETER = "daq/dynamometer";
constexpr const char* SPINDLE_FORCE = "daq/spindle_force";
constexpr const char* MOTOR_CURRENT = "daq/motor_current";
constexpr const char* SERVO_RECORD = "daq/servo";
constexpr const char* DISPLACEMENT = "daq/displacement";
constexpr const char* TACHOMETER = "daq/tachometer";
constexpr const char* SOUND = "daq/sound";
constexpr const char* SPINDLE_ANGLE = "spindle/angle";
constexpr const char* CNC_STATE = "cnc/state";
constexpr const char* CNC_LOAD = "cnc/load";
constexpr const char* CNC_ALARMS = "cnc/alarms";
constexpr const char* MACHINE_TEMPERATURE = "machine/temperature";
constexpr const char* INSPECTION_FEATURE = "inspection/feature";
constexpr const char* CUTTING_CONDITION = "cut/condition";
constexpr const char* TOOL_FRF = "tool/frf";
constexpr const char* TOOL_MODES = "tool/modes";
constexpr const char* TOOL_CONDITION = "tool/condition";
constexpr const char* SPINDLE_HEALTH = "hammer/health";
constexpr const char* COEFFICIENTS = "material/coefficients";
constexpr const char* COEFFICIENT_PRIOR = "material/prior";
constexpr const char* FORCE_CURVE = "material/force_curve";
constexpr const char* FORCE_MEASURED = "force/measured";
constexpr const char* FORCE_COMPENSATED = "force/compensated";
constexpr const char* FORCE_WRENCH = "force/wrench";
constexpr const char* FORCE_SENSOR = "force/sensor";
constexpr const char* FORCE_OF_MOTORS = "force/motor_current";
constexpr const char* FORCE_ESTIMATE = "force/estimate";
constexpr const char* STABILITY_CHART = "stability/chart";
constexpr const char* BISTABLE_CHART = "stability/bistable";
constexpr const char* PROGRAM_PATH = "program/path";
constexpr const char* PROGRAM_PROGRESS = "program/progress";
constexpr const char* CHATTER_STATE = "chatter/state";
constexpr const char* CHATTER_ADVICE = "chatter/advice";
constexpr const char* SOUND_ADVICE = "sound/advice";
constexpr const char* SOUND_FEATURES = "sound/features";
constexpr const char* DISCREPANCY_STATE = "discrepancy/state";
constexpr const char* FLEET_STATE = "loadmeter/fleet";
constexpr const char* CONTROL_COMMAND = "control/command";
constexpr const char* CONTROL_MACHINE = "control/machine";
constexpr const char* SESSION_STATE = "session/state";
constexpr const char* TWIN_FORCE = "discrepancy/force";
constexpr const char* FORCE_STRIP = "panel/strip";
constexpr const char* FORCE_REVOLUTION = "panel/revolution";
constexpr const char* FORCE_SPECTRUM = "panel/spectrum";
constexpr const char* PANEL_LOG = "panel/log";
constexpr const char* REPLAY_STATE = "replay/state";
constexpr const char* NODE_HEALTH = "health";

constexpr const char* TRUE_FRF = "sim/truth/frf";
constexpr const char* TRUE_MODES = "sim/truth/modes";
constexpr const char* TRUE_COEFFICIENTS = "sim/truth/coefficients";
constexpr const char* TRUE_FORCE = "sim/truth/force";
constexpr const char* TRUE_VIBRATION = "sim/truth/vibration";

// Actions.
constexpr const char* MEASURE_TOOL_FRF = "hammer/measure_frf";
constexpr const char* MEASURE_SENSOR_FRF = "kalman/measure_frf";
constexpr const char* CALIBRATE_SENSOR = "kalman/calibrate";
constexpr const char* IDENTIFY_COEFFICIENTS = "loadmeter/identify_coefficients";
constexpr const char* IDENTIFY_AXIS_DRIVE = "loadmeter/identify_axis_drive";
constexpr const char* DISCOVER = "discover";
constexpr const char* RUN_PROGRAM = "cnc/run_program";
constexpr const char* JOG = "cnc/jog";
constexpr const char* ORIENT_SPINDLE = "cnc/orient_spindle";

// Services.
constexpr const char* STRIKE = "daq/strike";
constexpr const char* TRY_INSTRUMENT = "daq/try_instrument";
constexpr const char* CALIBRATE_CHANNEL = "daq/calibrate_channel";
constexpr const char* OPERATOR_ACTION = "operator/act";
constexpr const char* OPERATOR_DONE = "session/done";
constexpr const char* ARM_MOTION = "cnc/arm_motion";
constexpr const char* INSTALL_MODEL = "discrepancy/install_model";
constexpr const char* FEED_HOLD = "cnc/feed_hold";
constexpr const char* SET_MACRO = "cnc/set_macro";
constexpr const char* SET_OVERRIDES = "cnc/set_overrides";
constexpr const char* RECOMMEND_CUT = "loadmeter/recommend_cut";
constexpr const char* FIND_COEFFICIENTS = "loadmeter/find_coefficients";
constexpr const char* PREDICT_STABILITY = "stability/predict";
constexpr const char* WHAT_IF = "stability/what_if";
constexpr const char* CHOOSE_PROBING_CUT = "stability/choose_probing_cut";
constexpr const char* SET_SOUND_CUT = "sound/set_cut";
constexpr const char* REPLAY_CONTROL = "replay/control";
constexpr const char* NEW_TOOL = "tool/new_tool";
constexpr const char* SET_FAULT = "sim/set_fault";

/// Ends the source of coefficients that were combined with those of the database.
constexpr const char* WITH_STORED = " and database";

/// Topic of a signal of the data acquisition, e.g. daq/vibration.
inline std::string daq(const std::string& signal) {
  return "daq/" + signal;
}

/// Topic of a sensor's stream before the fault_node of a simulation, e.g. sim/healthy/daq/dynamometer.
inline std::string healthy(const std::string& topic) {
  return "sim/healthy/" + topic;
}

/// The topic of an action's goals in a recording.
inline std::string goals(const std::string& action) {
  return action + "/goal";
}

/// With the namespace, for programs that run outside it.
inline std::string absolute(const std::string& name) {
  return !name.empty() && name.front() == '/' ? name : std::string(NAMESPACE) + "/" + name;
}

}  // namespace smartmill::names
