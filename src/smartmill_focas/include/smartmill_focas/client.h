#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "smartmill_focas/codec.h"
#include "smartmill_focas/server.h"

namespace smartmill::focas {

/// A call that failed; what() is one line, e.g. "cnc_rdmacro 500: EW_NUMBER (3), detail 0".
class FocasError : public std::runtime_error {
 public:
  FocasError(const std::string& what, int code, int detail = 0)
      : std::runtime_error(what), code_(code), detail_(detail) {}
  int code() const { return code_; }  ///< EwCode
  int detail() const { return detail_; }

 private:
  int code_;
  int detail_;
};

/// The connection is lost or was not established (code EW_SOCKET); the client must connect again.
class ConnectionError : public FocasError {
 public:
  explicit ConnectionError(const std::string& what) : FocasError(what, EW_SOCKET) {}
};

/// System information of the controller.
struct ControllerInfo {
  std::string cnc_type, mt_type, series, version;
  int axes = 0;  ///< controlled axes; limits the length of every list by axis
  int spindles = 0;
  bool spindle_meter = false;
};

/// Load of the spindles or axes with their names.
struct LoadMeter {
  std::vector<std::string> names;
  std::vector<double> load;   ///< [percent]
  std::vector<double> speed;  ///< [rpm] spindles only
};

/// Data of one reply of Client::exchange(). @throws WireError if it is too short.
Status decodeStatus(Reader& reader);
/// Names of four bytes; empty if the reply is an error. @param at_most entries, since surplus entries of a
/// reply are invalid
std::vector<std::string> decodeNames(const SubReply& reply, std::size_t at_most);
/// Value8s as numbers (NaN: vacant); empty if the reply is an error.
std::vector<double> decodeValues(const SubReply& reply, std::size_t at_most);

/// FOCAS client: a stream circuit for DNC and a data circuit for all other calls. Not thread-safe. Calls
/// throw FocasError if the controller refuses, and ConnectionError if the connection is lost or a reply
/// exceeds the timeout (which closes the connection, so that a late reply is not taken for that of the next
/// request).
class Client {
 public:
  Client();
  ~Client();
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  /// Opens both circuits and reads the system information. @param timeout [s] for connecting and for every
  /// reply.
  void connect(const std::string& host, std::uint16_t port, double timeout);
  bool connected() const;
  /// Sends the close request (0201) on both circuits, waits at most 0.2 s and closes.
  void close();
  /// Closes at once, without a close request.
  void drop();

  const ControllerInfo& info() const;

  /// One PDU; replies in the order of the requests, each with its own code.
  std::vector<SubReply> exchange(const std::vector<SubRequest>& requests);

  Status statusInfo();
  /// One value per axis [mm]. @param axis 1-based, -1 all.
  std::vector<double> position(PositionKind kind, int axis = -1);
  double actualFeed();   ///< [mm/min]
  double actualSpeed();  ///< [rpm]
  /// @param spindle 1-based, -1 all. @return [rpm]
  std::vector<double> actualSpeeds(int spindle = -1);
  std::vector<double> spindleLoad(int spindle = -1);  ///< [percent] cnc_rdspload
  LoadMeter spindleMeter();                           ///< cnc_rdspmeter
  LoadMeter servoMeter();                             ///< cnc_rdsvmeter
  /// Diagnosis number. @param axis 1-based, of an axis or a spindle; -1 all axes; 0 without axis. @return one
  /// value per axis; NaN: vacant.
  std::vector<double> diagnosis(int number, int axis);  ///< cnc_diagnoss
  std::vector<std::string> axisNames();
  std::optional<double> readMacro(int number);  ///< nothing: vacant
  void writeMacro(int number, std::optional<double> value);
  std::vector<double> readMacros(int first, int count);            ///< rdmacror2; NaN: vacant
  void writeMacros(int first, const std::vector<double>& values);  ///< wrmacror2
  std::uint32_t alarmBits();
  std::vector<AlarmMessage> alarmMessages();
  void programNumber(int* running, int* main_program);
  int sequenceNumber();
  std::string executingBlock();
  /// Text of a program in the memory (upload). @param number O @param progress receives the bytes read so
  /// far; where it returns false the upload ends and the result is empty
  std::string upload(int number, const std::function<bool(std::size_t)>& progress = {});
  void reset();       ///< opcode 02
  void cycleStart();  ///< opcode 01

  /// Opens a DNC session. @throws FocasError with EW_MODE, EW_BUSY, EW_REJECT ...
  void dncStart();
  /// Sends text. @return [byte] accepted for delivery; fewer than size if the controller is slow, 0:
  /// EW_BUFFER, try again later. @throws FocasError with the code of the controller if it has ended the
  /// session.
  std::size_t dncSend(const char* data, std::size_t size);
  /// Sends accepted text that the socket has not taken yet. @return [byte] still unsent.
  std::size_t dncFlush();
  /// Ends the session after all data are sent and waits for the reply. @param timeout [s]; negative: that of
  /// connect(). @throws FocasError.
  void dncEnd(double timeout = -1.0);
  /// Cancels the session (result DNC_CANCEL, DNC_READERR ...) without waiting for a reply. If the stream is
  /// full, the stream circuit is closed and opened again.
  void dncCancel(DncResult result = DNC_CANCEL);
  bool dncOpen() const;
  /// Checks for an error frame of the controller. @throws FocasError as dncSend().
  void dncCheck();
  /// Whether the controller no longer answers on the stream circuit of an open session; the data circuit may
  /// still work.
  bool dncDeaf() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace smartmill::focas
