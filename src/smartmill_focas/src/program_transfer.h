#pragma once

#include <functional>
#include <string>

#include "smartmill_focas/server.h"

namespace smartmill::focas {

/// Programs to and from the controller's memory on one stream circuit (cnc_download4, cnc_upload4 and their
/// forerunners).
class ProgramTransfer {
 public:
  using Send = std::function<void(std::uint8_t type, Direction direction, const Bytes& body)>;

  /// @return whether the frame belongs to a transfer; its answers went to send.
  bool handle(const Frame& frame, ControllerInterface& controller, const Send& send);

 private:
  void endDownload(ControllerInterface& controller, const Send& send);
  static void upload(const Frame& frame, const ControllerInterface& controller, const Send& send);

  bool receiving_ = false, too_long_ = false;
  std::string text_;
};

}  // namespace smartmill::focas
