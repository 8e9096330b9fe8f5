#pragma once

#include <chrono>
#include <deque>
#include <functional>
#include <string>

#include "smartmill_focas/controller_interface.h"

namespace smartmill::focas {

/// Transfer of programs to and from the memory of the controller on one stream circuit (cnc_download4,
/// cnc_upload4 and their predecessors).
class ProgramTransfer {
 public:
  using Send = std::function<void(std::uint8_t type, Direction direction, const Bytes& body)>;

  /// @param send receives the replies @return whether the frame belongs to a transfer
  bool handle(const Frame& frame, ProgramsInterface& controller, const Send& send);

  /// An upload is sent one frame at a time, as a control does, so that clients that expect one frame per
  /// recv() work.
  bool uploading() const { return !queue_.empty(); }
  void push(const Send& send);

 private:
  struct QueuedFrame {
    std::uint8_t type;
    Direction direction;
    Bytes body;
  };
  void endDownload(ProgramsInterface& controller, const Send& send);
  void upload(const Frame& frame, const ProgramsInterface& controller, const Send& send);

  bool receiving_ = false, too_long_ = false;
  std::string text_;
  std::deque<QueuedFrame> queue_;
  std::chrono::steady_clock::time_point pushed_{};
};

}  // namespace smartmill::focas
