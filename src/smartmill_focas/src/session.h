#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <list>

#include "calls/call_table.h"
#include "program_transfer.h"
#include "smartmill_focas/server.h"
#include "socket.h"

namespace smartmill::focas {

/// One connection of a client to a server: reads its frames, answers them and sends the answers.
class Session {
 public:
  /// What all sessions share.
  struct Shared {
    const ServerOptions& options;
    const ControllerInterface controller;
    const SysInfo& info;
    const CallTable& calls;
    const std::list<Session>& all;
  };
  Session(Descriptor socket, const Shared& shared) : shared_(shared), socket_(std::move(socket)) {}
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  /// For poll().
  int descriptor() const { return peer_closed_ ? -1 : socket_.get(); }
  short events() const;
  int pollPeriod(int longest) const;  ///< [ms]

  /// @param events of poll()
  void serve(short events);
  void drop();
  bool dead() const { return dead_; }
  int circuit() const { return circuit_; }  ///< 0: not opened

 private:
  enum class Dnc { none, open, aborted };

  void read(bool leaving);
  void checkDnc();
  void serveFrames();
  bool serveFrame(const Frame& frame);
  void open(const Frame& frame);
  void answerData(const Frame& frame);
  bool serveDnc(const Frame& frame);
  int startDnc();
  int endDnc();
  void reply(std::uint8_t type, int code);
  void send(std::uint8_t type, std::uint8_t direction, const Bytes& body);
  ProgramTransfer::Send sender();

  Shared shared_;
  Descriptor socket_;
  FrameReader reader_;
  std::deque<Frame> frames_;    // read, not yet served
  std::size_t text_taken_ = 0;  // [byte] of the DNC text of the first frame that the machine has accepted
  Bytes unsent_;
  int circuit_ = 0;
  Dnc dnc_ = Dnc::none;
  ProgramTransfer transfer_;
  int abort_code_ = EW_OK;
  bool blocked_ = false;  // the machine's buffer is full
  bool peer_closed_ = false;
  bool close_when_sent_ = false;
  bool dead_ = false;
};

}  // namespace smartmill::focas
