#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_focas/codec.h"

namespace smartmill::focas {

/// System information of the controller, queried once by the constructor of the server.
struct SysInfo {
  std::string cnc_type = "30";
  std::string mt_type = " M";
  std::string series = "G001";
  std::string version = "01.0";
  std::vector<std::string> axes{"X", "Y", "Z"};  ///< names of the controlled axes
  std::vector<std::string> spindles{"S1"};       ///< names
  int position_decimals = 3;                     ///< of positions in mm, 0..6 (4: 0.1 um)
  int load_decimals = 2;                         ///< of the spindle and servo load in percent
  int current_decimals = 3;                      ///< of servo currents in A
  std::array<std::uint32_t, 4> cnc_id{{0, 0, 0, 0}};
};

/// Type of a parameter or a diagnosis number.
enum class NumberedType : std::uint8_t { bits = 0, byte = 1, word = 2, double_word = 3, real = 4 };

/// A parameter or a diagnosis number.
struct NumberedValue {
  int number = 0;
  NumberedType type = NumberedType::double_word;
  std::vector<double> values;  ///< one, or one per axis
  bool of_axis = false;
  int decimals = 0;  ///< of a real
};

struct DateTime {
  int year = 2000, month = 1, day = 1, hour = 0, minute = 0, second = 0;
};

/// A program in the controller's memory.
struct StoredProgram {
  int number = 0;
  std::string name;      ///< of its file, e.g. O0001
  std::string comment;   ///< of its first line
  std::size_t size = 0;  ///< [byte]
  DateTime changed;
};

/// Folder of all programs, with a slash at the end.
constexpr const char* PROGRAM_FOLDER = "//CNC_MEM/USER/PATH1/";

/// Kinds of PMC addresses, numbered as in pmc_rdpmcrng.
enum class PmcArea : std::uint8_t { g = 0, f = 1, y = 2, x = 3, a = 4, r = 5, t = 6, k = 7, c = 8, d = 9 };

/// Raw values of cnc_statinfo.
struct Status {
  std::int16_t aut = AUT_MDI;
  std::int16_t run = RUN_RESET;
  std::int16_t motion = MOTION_NONE;
  std::int16_t mstb = 0;
  std::int16_t emergency = 0;  ///< 1 EMG, 2 reset
  std::int16_t alarm = 0;      ///< 1 alarm, 2 battery
  std::int16_t edit = 0;
  std::int16_t hdck = 0;
  std::int16_t tmmode = 0;  ///< 0 T, 1 M
};

/// One alarm on the screen.
struct AlarmMessage {
  std::int32_t number = 0;
  std::int32_t type = 0;  ///< bit number of the alarm word
  std::int32_t axis = 0;  ///< 1-based, 0: none
  std::string text;
};

// The machine of a Server, one interface per topic. All methods are called in the thread of the server, while
// other threads may run the machine: implementations must lock. Calls must be short, since all connections
// wait. Values have the units of the controller's screen (mm, mm/min, rpm, percent), as on the wire.

/// Axes and spindles.
class AxesInterface {
 public:
  virtual ~AxesInterface() = default;

  virtual std::vector<double> machinePosition() const = 0;   ///< [mm] of each axis
  virtual std::vector<double> absolutePosition() const = 0;  ///< [mm] workpiece coordinates
  virtual std::vector<double> relativePosition() const = 0;  ///< [mm]
  virtual std::vector<double> distanceToGo() const = 0;      ///< [mm] of the running block
  virtual double actualFeed() const = 0;                     ///< [mm/min] along the path
  virtual std::vector<double> spindleSpeed() const = 0;      ///< [rpm] of each spindle
  virtual std::vector<double> spindleLoad() const = 0;       ///< [percent] of the load meter, of each spindle
  virtual std::vector<double> spindleMaxSpeed() const = 0;   ///< [rpm]
  virtual std::vector<double> servoLoad() const = 0;         ///< [percent] of rated load, of each axis
  virtual std::vector<double> servoLoopGain() const { return {}; }  ///< [0.01/s] of each axis; empty: EW_FUNC
  virtual std::vector<double> servoSpeed() const {
    return {};
  }  ///< [rpm] of each axis' motor; empty: EW_FUNC
  virtual std::vector<double> servoCurrent() const { return {}; }  ///< [A] of each axis; empty: EW_FUNC
};

/// Macro variables.
class MacroInterface {
 public:
  virtual ~MacroInterface() = default;

  /// EW_OK and the value (empty: vacant), or EW_NUMBER.
  virtual EwCode readMacro(int number, std::optional<double>* value) const = 0;
  /// EW_OK, EW_NUMBER, EW_PROT ... @param value empty: vacant
  virtual EwCode writeMacro(int number, std::optional<double> value) = 0;
};

/// Identification and state of the controller, its alarms and its running program.
class StateInterface {
 public:
  virtual ~StateInterface() = default;

  virtual SysInfo sysInfo() const = 0;
  virtual Status status() const = 0;
  virtual std::uint32_t alarmBits() const = 0;
  virtual std::vector<AlarmMessage> alarmMessages() const = 0;
  virtual int runningProgram() const = 0;  ///< O number
  virtual int mainProgram() const = 0;     ///< O number
  virtual int sequenceNumber() const = 0;  ///< N word of the running block
  virtual int blockCount() const = 0;
  virtual std::string programPath() const = 0;     ///< of the main program, e.g. //CNC_MEM/O0001
  virtual std::string executingBlock() const = 0;  ///< text of the running block
  /// Text of the program from the running block on, as far as known.
  virtual std::string programText() const { return executingBlock(); }
};

/// Parameters, diagnosis numbers, clock and PMC.
class DataInterface {
 public:
  virtual ~DataInterface() = default;

  /// Parameters with their numbers from first to last, in order.
  virtual std::vector<NumberedValue> parameters(int /*first*/, int /*last*/) const { return {}; }
  /// Diagnosis numbers from first to last, in order.
  virtual std::vector<NumberedValue> diagnoses(int /*first*/, int /*last*/) const { return {}; }
  /// Empty: EW_FUNC.
  virtual std::optional<DateTime> dateTime() const { return std::nullopt; }
  virtual EwCode setDateTime(const DateTime& /*date_time*/) { return EW_FUNC; }
  /// Bytes first..last of an area: EW_OK, EW_NUMBER (no such address), EW_FUNC (no PMC).
  virtual EwCode readPmc(PmcArea /*area*/, int /*first*/, int /*last*/, Bytes* /*bytes*/) const {
    return EW_FUNC;
  }
  virtual EwCode writePmc(PmcArea /*area*/, int /*first*/, const Bytes& /*bytes*/) { return EW_FUNC; }
};

/// Programs in memory, their start and the reset.
class ProgramsInterface {
 public:
  virtual ~ProgramsInterface() = default;

  /// Programs in memory, sorted by number.
  virtual std::vector<StoredProgram> programs() const { return {}; }
  /// Makes it the main program: EW_OK, EW_DATA (no such program), EW_BUSY, EW_MODE.
  virtual EwCode selectProgram(int /*number*/) { return EW_FUNC; }
  virtual EwCode deleteProgram(int /*number*/) { return EW_FUNC; }
  virtual EwCode rewindProgram() { return EW_FUNC; }
  /// Stores downloaded text with one or several programs. EW_OK, EW_DATA (no program number), EW_OVRFLOW
  /// (memory full), EW_BUSY (program running).
  virtual EwCode storePrograms(const std::string& /*text*/) { return EW_FUNC; }
  /// Text of programs first..last for an upload. EW_OK, EW_DATA (no such program).
  virtual EwCode fetchPrograms(int /*first*/, int /*last*/, std::string* /*text*/) const { return EW_FUNC; }
  virtual EwCode cycleStart() { return EW_FUNC; }  ///< opcode 01
  /// Opcode 02, as the RESET key of the operator: stops motion, ends a DNC session (dncAbort() then returns
  /// EW_RESET).
  virtual EwCode reset() { return EW_FUNC; }
};

/// Programs that a client sends while they run.
class DncInterface {
 public:
  virtual ~DncInterface() = default;

  /// Opens a DNC session: EW_OK, EW_MODE (not in DNC mode), EW_BUSY (a session is open), EW_REJECT, EW_ALARM.
  virtual EwCode dncStart() = 0;
  /// Program text. @return [byte] that the buffer accepts now (0..size). The rest is offered again every few
  /// milliseconds; meanwhile the client is not read, so that TCP stops it.
  virtual std::size_t dncData(const char* data, std::size_t size) = 0;
  /// End of the data; the machine runs the buffered text to its end. EW_OK, or EW_FUNC without a session.
  virtual EwCode dncEnd() = 0;
  /// The client cancels the session (DncResult): stop, discard the buffer.
  virtual void dncCancel(int result) = 0;
  /// The connection of the client is lost during a session.
  virtual void dncDisconnected() { dncCancel(DNC_READERR); }
  /// Polled while a session is open: EW_OK in normal operation; EW_RESET, EW_ALARM ... after the machine has
  /// ended the session. The server then sends the client an unsolicited error frame and discards its further
  /// data.
  virtual EwCode dncAbort() = 0;
};

/// The machine of a Server, which must outlive it.
struct ControllerInterface {
  StateInterface& state;
  AxesInterface& axes;
  MacroInterface& macros;
  DataInterface& data;
  ProgramsInterface& programs;
  DncInterface& dnc;
};

}  // namespace smartmill::focas
