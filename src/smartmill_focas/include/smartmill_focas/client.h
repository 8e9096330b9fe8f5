#pragma once

#include <cstddef>
#include <cstdint>
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

/// The connection is gone (code EW_SOCKET) or never came about; the client must connect anew.
class ConnectionError : public FocasError {
 public:
  explicit ConnectionError(const std::string& what) : FocasError(what, EW_SOCKET) {}
};

/// What the controller says of itself.
struct ControllerInfo {
  std::string cnc_type, mt_type, series, version;
  int axes = 0;  ///< controlled axes: bounds every list by axis
  int spindles = 0;
  bool spindle_meter = false;
};

/// Load of the spindles or axes with their names.
struct LoadMeter {
  std::vector<std::string> names;
  std::vector<double> load;   ///< [percent]
  std::vector<double> speed;  ///< [rpm] spindles only
};

/// Data of one reply of Client::exchange. @throws WireError when it is too short.
Status decodeStatus(Reader& reader);
/// Names of four bytes; empty when the reply is an error. Bounded by at_most: surplus entries of a reply are
/// garbage.
std::vector<std::string> decodeNames(const SubReply& reply, std::size_t at_most);
/// Value8s as numbers (NaN: vacant); empty when the reply is an error.
std::vector<double> decodeValues(const SubReply& reply, std::size_t at_most);

/// FOCAS client: a stream circuit for DNC and a data circuit for everything else. Not thread-safe: one thread
/// at a time. Calls throw FocasError when the controller refuses, ConnectionError when the connection is lost
/// or a reply takes longer than the timeout (the connection is closed then: a late reply must not answer the
/// next question).
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
  /// Says goodbye (0201 on both) without waiting longer than 0.2 s, closes.
  void close();
  /// Closes at once, without a word.
  void drop();

  const ControllerInfo& info() const;

  /// One PDU; replies in the order of the requests, each with its own code.
  std::vector<SubReply> exchange(const std::vector<SubRequest>& requests);

  Status statusInfo();
  /// One value an axis [mm]. @param axis 1-based, -1 all.
  std::vector<double> position(PositionKind kind, int axis = -1);
  double actualFeed();   ///< [mm/min]
  double actualSpeed();  ///< [rpm]
  /// @param spindle 1-based, -1 all. @return [rpm]
  std::vector<double> actualSpeeds(int spindle = -1);
  std::vector<double> spindleLoad(int spindle = -1);  ///< [percent] cnc_rdspload
  LoadMeter spindleMeter();                           ///< cnc_rdspmeter
  LoadMeter servoMeter();                             ///< cnc_rdsvmeter
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
  void reset();       ///< opcode 02
  void cycleStart();  ///< opcode 01

  /// Opens a DNC session. @throws FocasError with EW_MODE, EW_BUSY, EW_REJECT ...
  void dncStart();
  /// Sends text; returns how many bytes were taken (a part of them when the controller is slow, 0: EW_BUFFER,
  /// try again later). What is taken arrives. @throws FocasError with the controller's code when it has ended
  /// the session.
  std::size_t dncSend(const char* data, std::size_t size);
  /// Sends what dncSend has taken but the socket not yet. @return [byte] still to go.
  std::size_t dncFlush();
  /// Ends the session normally: all data are sent. Waits for the answer, at most timeout [s], a default of
  /// the connection's when negative. @throws FocasError.
  void dncEnd(double timeout = -1.0);
  /// dncEnd in two steps for a caller that must not wait: true once the answer is there.
  void dncEndBegin();
  bool dncEndDone();
  /// Gives up (result DNC_CANCEL, DNC_READERR ...); no answer awaited. When the stream is so full that the
  /// word does not fit, the stream circuit is closed and opened anew.
  void dncCancel(DncResult result = DNC_CANCEL);
  bool dncOpen() const;
  /// Looks for an error frame of the controller. @throws FocasError as dncSend.
  void dncCheck();
  /// Nothing comes back on the DNC circuit of an open session any more; the data circuit may be well.
  bool dncDeaf() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace smartmill::focas
