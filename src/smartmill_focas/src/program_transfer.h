#pragma once

#include <chrono>
#include <deque>
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

  /// An upload goes out a frame at a time, as a control sends it, so that a client which takes what one
  /// recv() brings for one frame is served too.
  bool uploading() const { return !waiting_.empty(); }
  void push(const Send& send);

 private:
  struct Waiting {
    std::uint8_t type;
    Direction direction;
    Bytes body;
  };
  void endDownload(ControllerInterface& controller, const Send& send);
  void upload(const Frame& frame, const ControllerInterface& controller, const Send& send);

  bool receiving_ = false, too_long_ = false;
  std::string text_;
  std::deque<Waiting> waiting_;
  std::chrono::steady_clock::time_point pushed_{};
};

}  // namespace smartmill::focas
