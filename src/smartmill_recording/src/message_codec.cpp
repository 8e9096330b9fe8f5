#include "smartmill_recording/message_codec.h"

#include "smartmill_core/error.h"

namespace smartmill {

static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "numbers are copied as they are in memory");

void MessageReader::fail(std::size_t count, std::size_t size) const {
  throw Error("the message ends too early or is damaged: " + std::to_string(count) + " x " +
              std::to_string(size) + " bytes expected, " + std::to_string(left_) + " left");
}

}  // namespace smartmill
