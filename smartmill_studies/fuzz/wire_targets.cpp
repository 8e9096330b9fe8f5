#include <cstdlib>

#include "data_calls.h"
#include "fuzz/scratch_file.h"
#include "fuzz/targets.h"
#include "program_transfer.h"
#include "smartmill_focas/client.h"
#include "smartmill_focas/describe.h"
#include "smartmill_focas/recording.h"
#include "smartmill_sim/controller/controller.h"

namespace smartmill::fuzz {
namespace {

/// All whole frames of the bytes, which come in pieces.
template <class Take>
void eachFrame(const std::uint8_t* data, std::size_t size, const Take& take) {
  focas::FrameReader reader;
  try {
    for (std::size_t at = 0; at < size;) {
      const std::size_t piece = std::min<std::size_t>(size - at, 1 + data[at] % 32);
      reader.append(data + at, piece);
      at += piece;
      while (const std::optional<focas::Frame> frame = reader.next()) {
        take(*frame);
      }
    }
  } catch (const focas::WireError&) {
    // Not FOCAS.
  }
}

sim::Controller& controller() {
  static sim::Controller machine(sim::ControllerOptions::ofModel(MachineModel{}));
  return machine;
}

}  // namespace

void replies(const std::uint8_t* data, std::size_t size) {
  eachFrame(data, size, [](const focas::Frame& frame) {
    focas::describe(frame);
    focas::decodeErrorBody(frame.body);
    focas::decodeOpenReply(frame.body);
    try {
      for (const focas::SubReply& reply : focas::decodeReplies(frame.body)) {
        focas::decodeNames(reply, 32);
        focas::decodeValues(reply, 32);
        focas::Reader reader(reply.data);
        focas::decodeStatus(reader);
      }
    } catch (const focas::WireError&) {
      // Told.
    }
  });
}

void requests(const std::uint8_t* data, std::size_t size) {
  focas::DataCalls calls(controller());
  focas::ProgramTransfer transfer;
  eachFrame(data, size, [&](const focas::Frame& frame) {
    focas::describe(frame);
    transfer.handle(frame, controller(),
                    [](std::uint8_t type, focas::Direction direction, const focas::Bytes& body) {
                      focas::encodeFrame(type, direction, body, focas::REPLY_VERSION);
                    });
    try {
      std::vector<focas::SubReply> answers;
      for (const focas::SubRequest& request : focas::decodeRequests(frame.body)) {
        answers.push_back(calls.answer(request));
        const focas::SubReply& answer = answers.back();
        if (answer.c3 != request.c3 || (answer.code != focas::EW_OK && !answer.data.empty())) {
          std::abort();
        }
      }
      focas::encodeReplies(answers);
    } catch (const focas::WireError&) {
      // A whole-PDU failure.
    }
  });
}

void recording(const std::uint8_t* data, std::size_t size) {
  try {
    for (const focas::RecordedFrame& frame : focas::readRecording(scratchFile(data, size))) {
      focas::describe(frame);
    }
  } catch (const focas::WireError&) {
    // Told with file and line.
  }
}

}  // namespace smartmill::fuzz
