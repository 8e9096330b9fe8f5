#pragma once

#include <memory>
#include <mutex>

#include "controller/machine.h"
#include "smartmill_focas/controller_interface.h"

namespace smartmill::sim {

/// A machine that several threads use.
class LockedMachine {
 public:
  explicit LockedMachine(const ControllerOptions& options) : machine_(options) {}

  /// Exclusive access to the machine.
  class Access {
   public:
    explicit Access(LockedMachine& machine) : lock_(machine.mutex_), machine_(machine.machine_) {}
    ControlledMachine* operator->() const { return &machine_; }
    const ControlledMachine& operator*() const { return machine_; }

   private:
    std::lock_guard<std::mutex> lock_;
    ControlledMachine& machine_;
  };
  Access lock() { return Access(*this); }
  const ControllerOptions& options() const { return machine_.options; }

 private:
  std::mutex mutex_;
  ControlledMachine machine_;
};

/// Base of the classes that answer the FOCAS calls of a topic from a machine.
template <class Interface>
class CallsOf : public Interface {
 public:
  explicit CallsOf(LockedMachine& machine) : machine_(machine) {}

 protected:
  LockedMachine& machine_;
};

// What the machine answers to the calls of each topic.

std::unique_ptr<focas::StateInterface> stateCalls(LockedMachine& machine);
std::unique_ptr<focas::AxesInterface> axesCalls(LockedMachine& machine);
std::unique_ptr<focas::MacroInterface> macroCalls(LockedMachine& machine);
std::unique_ptr<focas::DataInterface> dataCalls(LockedMachine& machine);
std::unique_ptr<focas::ProgramsInterface> programCalls(LockedMachine& machine);
std::unique_ptr<focas::DncInterface> dncCalls(LockedMachine& machine);

}  // namespace smartmill::sim
