#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "smartmill_cnc/controller/controller.h"
#include "smartmill_cnc/controller/focas_controller.h"
#include "smartmill_focas/client.h"

namespace smartmill::cnc {

/// Reads the state of a FOCAS controller in one PDU, or in several if it does not accept one.
class FocasReader {
 public:
  FocasReader(focas::Client& client, const FocasParameters& parameters);
  ~FocasReader();

  /// To be called after each connection.
  void connected();

  /// @throws FocasError, ConnectionError, WireError: the connection is unusable.
  Reading read();
  /// Temperatures of the axes of the last reading and of the spindle. @param refused one line, of the
  /// diagnosis numbers that the controller does not offer; empty: none. @throws FocasError when it offers
  /// none; ConnectionError, WireError as read().
  MachineTemperature readTemperature(std::string& refused);
  /// Value of the marker variable in the last reading; NaN: vacant.
  double marker() const { return marker_; }
  /// Decimals of lengths in mm.
  int decimals() const { return decimals_; }

 private:
  class PollRequests;
  std::vector<focas::SubReply> exchange();
  void setAllAtOnce(bool all_at_once);
  void readState(const std::vector<focas::SubReply>& replies, std::size_t axes, Reading& reading);
  void readPositions(const std::vector<focas::SubReply>& replies, std::size_t axes, Reading& reading);
  void readAlarms(std::uint32_t bits, CncState& state);
  void readLoad(const std::vector<focas::SubReply>& replies, std::size_t axes, Reading& reading) const;

  focas::Client& client_;
  FocasParameters parameters_;
  std::unique_ptr<PollRequests> poll_requests_;
  bool all_at_once_ = true;
  bool requested_ = false, answered_ = false;
  std::uint32_t alarm_bits_ = 0;
  std::string alarm_text_;
  std::vector<std::string> axes_;
  std::vector<ControllerAlarm> alarms_;
  double marker_;
  int decimals_;
};

}  // namespace smartmill::cnc
