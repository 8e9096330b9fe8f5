#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_focas/codec.h"

namespace smartmill::focas {

/// What the server tells of the controller; asked once, when the server is made.
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

/// How a parameter or a diagnosis number is kept.
enum class NumberedType : std::uint8_t { bits = 0, byte = 1, word = 2, double_word = 3, real = 4 };

/// A parameter or a diagnosis number.
struct NumberedValue {
  int number = 0;
  NumberedType type = NumberedType::double_word;
  std::vector<double> values;  ///< one, or one an axis
  bool of_axis = false;
  int decimals = 0;  ///< of a real
};

struct DateTime {
  int year = 2000, month = 1, day = 1, hour = 0, minute = 0, second = 0;
};

/// A program in the controller's memory.
struct StoredProgram {
  int number = 0;
  std::string name;      ///< of its file, for example O0001
  std::string comment;   ///< of its first line
  std::size_t size = 0;  ///< [byte]
  DateTime changed;
};

/// Kinds of PMC addresses, as pmc_rdpmcrng numbers them.
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

/// The machine behind a Server. Every method is called from the server's one thread while others may run the
/// machine: the implementer locks. Calls must be short: all connections wait meanwhile. Values are those of
/// the controller's screen (mm, mm/min, rpm, percent), as the wire carries them.
class ControllerInterface {
 public:
  virtual ~ControllerInterface() = default;

  virtual SysInfo sysInfo() const = 0;
  virtual Status status() const = 0;

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

  /// EW_OK and the value (nothing: vacant), or EW_NUMBER.
  virtual EwCode readMacro(int number, std::optional<double>* value) const = 0;
  /// EW_OK, EW_NUMBER, EW_PROT ...; nothing: becomes vacant.
  virtual EwCode writeMacro(int number, std::optional<double> value) = 0;

  virtual std::uint32_t alarmBits() const = 0;
  virtual std::vector<AlarmMessage> alarmMessages() const = 0;
  virtual int runningProgram() const = 0;  ///< O number
  virtual int mainProgram() const = 0;     ///< O number
  virtual int sequenceNumber() const = 0;  ///< N word of the running block
  virtual int blockCount() const = 0;
  virtual std::string programPath() const = 0;     ///< of the main program, e.g. //CNC_MEM/O0001
  virtual std::string executingBlock() const = 0;  ///< text of the running block
  /// From the running block on, what is known of the program.
  virtual std::string programText() const { return executingBlock(); }

  /// Parameters with their numbers from first to last, in order.
  virtual std::vector<NumberedValue> parameters(int /*first*/, int /*last*/) const { return {}; }
  /// The same of diagnosis numbers.
  virtual std::vector<NumberedValue> diagnoses(int /*first*/, int /*last*/) const { return {}; }
  virtual std::vector<double> servoCurrent() const { return {}; }  ///< [A] of each axis; empty: EW_FUNC
  /// Nothing: EW_FUNC.
  virtual std::optional<DateTime> dateTime() const { return std::nullopt; }
  virtual EwCode setDateTime(const DateTime& /*date_time*/) { return EW_FUNC; }
  /// Bytes first..last of an area: EW_OK, EW_NUMBER (no such address), EW_FUNC (no PMC).
  virtual EwCode readPmc(PmcArea /*area*/, int /*first*/, int /*last*/, Bytes* /*bytes*/) const {
    return EW_FUNC;
  }
  virtual EwCode writePmc(PmcArea /*area*/, int /*first*/, const Bytes& /*bytes*/) { return EW_FUNC; }

  /// Programs in memory, by number.
  virtual std::vector<StoredProgram> programs() const { return {}; }
  /// The folder that holds them, ends with a slash.
  virtual std::string programFolder() const { return "//CNC_MEM/USER/PATH1/"; }
  /// Makes it the main program: EW_OK, EW_DATA (there is none), EW_BUSY, EW_MODE.
  virtual EwCode selectProgram(int /*number*/) { return EW_FUNC; }
  virtual EwCode deleteProgram(int /*number*/) { return EW_FUNC; }
  virtual EwCode rewindProgram() { return EW_FUNC; }
  /// Text as it was downloaded, one or several programs. EW_OK, EW_DATA (no program number), EW_OVRFLOW (no
  /// room), EW_BUSY (it runs).
  virtual EwCode storePrograms(const std::string& /*text*/) { return EW_FUNC; }
  /// Text of programs first..last as it is uploaded. EW_OK, EW_DATA (there is none).
  virtual EwCode fetchPrograms(int /*first*/, int /*last*/, std::string* /*text*/) const { return EW_FUNC; }

  virtual EwCode cycleStart() { return EW_FUNC; }  ///< opcode 01
  /// Opcode 02, also what an operator's RESET does: stops motion, ends a DNC session (dncAbort then says
  /// EW_RESET).
  virtual EwCode reset() { return EW_FUNC; }

  /// A client opens a DNC session: EW_OK, EW_MODE (not in DNC mode), EW_BUSY (one is open), EW_REJECT,
  /// EW_ALARM.
  virtual EwCode dncStart() = 0;
  /// Program text; returns how much of it the buffer took now (0..size). The rest is offered again every few
  /// milliseconds; meanwhile nothing more is read from the client, so that TCP stops it.
  virtual std::size_t dncData(const char* data, std::size_t size) = 0;
  /// All data are in; the machine runs what it has. EW_OK, or EW_FUNC without a session.
  virtual EwCode dncEnd() = 0;
  /// The client gave up (DncResult): stop, drop what is buffered.
  virtual void dncCancel(int result) = 0;
  /// The client's connection broke in mid-session.
  virtual void dncDisconnected() { dncCancel(DNC_READERR); }
  /// Polled while a session is open: EW_OK while all is well; EW_RESET, EW_ALARM ... once the machine has
  /// ended the session itself. The server then tells the client (unsolicited error frame) and throws the rest
  /// of its data away.
  virtual EwCode dncAbort() = 0;
};

struct ServerOptions {
  std::string bind_address = "127.0.0.1";
  std::uint16_t port = DEFAULT_PORT;  ///< 0: any free one
  int max_sessions = 5;               ///< per kind of circuit; one more is refused with 0103
  int max_connections = 30;           ///< TCP; one more gets ECONNREFUSED, as seen on a live 31i
  int receive_buffer = 4096;  ///< [byte] SO_RCVBUF: how much the wire may hold beyond the machine's buffer
};

/// FOCAS server: accepts connections, each independent, all on one machine. Runs one thread of its own.
class Server {
 public:
  /// Listens when it returns. @throws std::runtime_error "FOCAS server: cannot listen on HOST:PORT: why".
  Server(const ServerOptions& options, ControllerInterface& controller);
  ~Server();  ///< stop()
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  std::uint16_t port() const;
  /// Closes all connections and ends the thread; at once, any number of times.
  void stop();
  /// Open circuits now (stream and data), for tests and messages.
  int connections() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace smartmill::focas
