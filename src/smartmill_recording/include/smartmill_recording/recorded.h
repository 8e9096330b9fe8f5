#pragma once

#include <cstddef>
#include <cstdint>

#include "smartmill_recording/conversions.h"
#include "smartmill_recording/message_codec.h"

namespace smartmill {

/// How recorded bytes become a Data: its message type, and decode(), whose result is valid until the next
/// call. @throws Error on bytes that end too early and on data that contradict themselves.
template <class Data, bool MESSAGE = IsMessage<Data>::value>
class Recorded;

/// Messages themselves.
template <class Message>
class Recorded<Message, true> {
 public:
  static const char* type() { return Message::TYPE; }
  static const char* md5() { return Message::MD5; }
  static const char* definition() { return Message::DEFINITION; }
  const Message& decode(const std::uint8_t* data, std::size_t size) {
    readMessage(data, size, message_);
    return message_;
  }

 private:
  Message message_;
};

/// Core types, by the message that carries them.
template <class Data>
class Recorded<Data, false> {
 public:
  static const char* type() { return PlainOf<Data>::Type::TYPE; }
  static const char* md5() { return PlainOf<Data>::Type::MD5; }
  static const char* definition() { return PlainOf<Data>::Type::DEFINITION; }
  const Data& decode(const std::uint8_t* data, std::size_t size) {
    return data_ = fromMsg(message_.decode(data, size));
  }

 private:
  Recorded<typename PlainOf<Data>::Type> message_;
  Data data_;
};

}  // namespace smartmill
