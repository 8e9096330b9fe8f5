#include <cstdlib>

#include "calls/calls.h"
#include "fuzz/frames.h"
#include "fuzz/targets.h"
#include "program_transfer.h"
#include "smartmill_focas/describe.h"
#include "smartmill_sim/controller/controller.h"

namespace smartmill::fuzz {
namespace {

const sim::ControllerOptions& options() {
  static const sim::ControllerOptions OPTIONS = sim::ControllerOptions::ofModel(MachineModel{});
  return OPTIONS;
}

}  // namespace

void requests(const std::uint8_t* data, std::size_t size) {
  const sim::Controller machine(options());
  const focas::ControllerInterface controller = machine.calls();
  const focas::SysInfo info = controller.state.sysInfo();
  const focas::CallTable calls = focas::callsOf(controller, info);
  focas::ProgramTransfer transfer;
  eachFrame(data, size, [&](const focas::Frame& frame) {
    focas::describe(frame);
    transfer.handle(frame, controller.programs,
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
      // Failure of a complete PDU.
    }
  });
}

}  // namespace smartmill::fuzz
