#pragma once

#include <cstdint>
#include <functional>
#include <iosfwd>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "smartmill_focas/client.h"
#include "smartmill_focas/codec.h"

namespace smartmill::focas {

/// A frame between a client and a controller.
struct RecordedFrame {
  double time = 0.0;   ///< [s] since the start of the recording
  int connection = 1;  ///< TCP connection, numbered from 1 in the order of connecting
  bool from_client = true;
  Frame frame;
};

/// One line: time, connection, > (request) or <, and the described frame.
std::string describe(const RecordedFrame& frame);

/// Writes a recording: the line "# smartmill-focas-session/1", then for each frame its description after a #
/// and a line "TIME CONNECTION > HEX" (or <).
void beginRecording(std::ostream& out);
void append(std::ostream& out, const RecordedFrame& frame);
/// @throws WireError naming file and line.
std::vector<RecordedFrame> readRecording(const std::string& file);
/// As readRecording(), from the text of a file. @param file name for error messages
std::vector<RecordedFrame> parseRecording(std::string_view text, const std::string& file);

/// Proxy between clients and a controller that forwards all bytes unchanged and reports every frame. Bytes
/// that are no frames are forwarded but not reported. Runs its own thread.
class Tap {
 public:
  /// Called in the thread of the tap.
  using Listener = std::function<void(const RecordedFrame&)>;

  /// Listens on loopback. @param port 0: any free port @param timeout [s] for connecting to the controller
  /// @throws std::runtime_error if it cannot listen.
  Tap(std::uint16_t port, const std::string& host, std::uint16_t host_port, double timeout,
      Listener listener);
  ~Tap();
  Tap(const Tap&) = delete;
  Tap& operator=(const Tap&) = delete;

  std::uint16_t port() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

/// Makes all read requests of a bridge and of service tools to a controller, for a recording; writes nothing.
/// Refused requests are ignored. @throws ConnectionError.
void askEverything(Client& client);

}  // namespace smartmill::focas
