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

/// A frame as it passed between a client and a controller.
struct RecordedFrame {
  double time = 0.0;   ///< [s] since the recording began
  int connection = 1;  ///< TCP connections in the order in which they were made, from 1
  bool from_client = true;
  Frame frame;
};

/// One line: time, connection, > or <, and what the frame says.
std::string describe(const RecordedFrame& frame);

/// A recording as a file: "# smartmill-focas-session/1", then for each frame its line behind a # and a line
/// "TIME CONNECTION > HEX" (or <).
void beginRecording(std::ostream& out);
void append(std::ostream& out, const RecordedFrame& frame);
/// @throws WireError naming file and line.
std::vector<RecordedFrame> readRecording(const std::string& file);
/// The same of a file's text. @param file for the messages
std::vector<RecordedFrame> parseRecording(std::string_view text, const std::string& file);

/// Stands between clients and a controller, hands on every byte as it comes and tells of every frame. Bytes
/// that are no frames pass too, but are not told of. Runs one thread of its own.
class Tap {
 public:
  /// Called from the tap's thread.
  using Listener = std::function<void(const RecordedFrame&)>;

  /// Listens on loopback when it returns. @param port 0: any free one @param timeout [s] for connecting to
  /// the controller. @throws std::runtime_error when it cannot listen.
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

/// Asks a controller for all that can be read, as a bridge and as a service engineer would; writes nothing.
/// What it refuses is left out. @throws ConnectionError.
void askEverything(Client& client);

}  // namespace smartmill::focas
