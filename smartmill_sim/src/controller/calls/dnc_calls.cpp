#include "controller/calls/calls.h"

namespace smartmill::sim {
namespace {

using focas::EwCode;

class DncCalls : public focas::DncInterface {
 public:
  explicit DncCalls(LockedMachine& machine) : machine_(machine) {}

  EwCode dncStart() override { return machine_.lock()->openSession(); }
  std::size_t dncData(const char* data, std::size_t size) override {
    return machine_.lock()->session.receive(data, size);
  }
  EwCode dncEnd() override { return machine_.lock()->session.close(); }
  void dncCancel(int /*result*/) override { machine_.lock()->cancelSession(); }
  EwCode dncAbort() override { return machine_.lock()->session.takeAbortCode(); }

 private:
  LockedMachine& machine_;
};

}  // namespace

std::unique_ptr<focas::DncInterface> dncCalls(LockedMachine& machine) {
  return std::make_unique<DncCalls>(machine);
}

}  // namespace smartmill::sim
