#include "controller/calls/calls.h"

namespace smartmill::sim {
namespace {

using focas::EwCode;

class DncCalls : public CallsOf<focas::DncInterface> {
 public:
  using CallsOf::CallsOf;

  EwCode dncStart() override { return machine_.lock()->openSession(); }
  std::size_t dncData(const char* data, std::size_t size) override {
    return machine_.lock()->session.receive(data, size);
  }
  EwCode dncEnd() override { return machine_.lock()->session.close(); }
  void dncCancel(int /*result*/) override { machine_.lock()->cancelSession(); }
  EwCode dncAbort() override { return machine_.lock()->session.takeAbortCode(); }
};

}  // namespace

std::unique_ptr<focas::DncInterface> dncCalls(LockedMachine& machine) {
  return std::make_unique<DncCalls>(machine);
}

}  // namespace smartmill::sim
