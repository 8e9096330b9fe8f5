#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <utility>

#include "smartmill_focas/codec.h"

namespace smartmill::focas {

/// Calls of data PDUs by their opcode.
class CallTable {
 public:
  /// Answers a request by writing the data of its reply. @return EwCode @throws WireError on malformed
  /// arguments
  using Call = std::function<int(const SubRequest& request, Writer& out)>;

  void add(Opcode opcode, Call call);
  /// A call that writes its data and always succeeds.
  void addReply(Opcode opcode, std::function<void(const SubRequest& request, Writer& out)> call);

  /// Does not throw: unknown calls return EW_FUNC, malformed arguments EW_LENGTH, EW_NUMBER or EW_ATTRIB.
  SubReply answer(const SubRequest& request) const;

 private:
  std::map<std::uint16_t, Call> calls_;
};

}  // namespace smartmill::focas
