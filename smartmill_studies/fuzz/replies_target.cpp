#include "fuzz/frames.h"
#include "fuzz/targets.h"
#include "smartmill_focas/client.h"
#include "smartmill_focas/describe.h"

namespace smartmill::fuzz {

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
      // The error is reported.
    }
  });
}

}  // namespace smartmill::fuzz
