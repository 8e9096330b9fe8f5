#include "program_transfer.h"

#include <algorithm>
#include <optional>

#include "calls/calls.h"

namespace smartmill::focas {
namespace {

constexpr std::size_t MAX_TEXT = 1 << 20;    // [byte] of one download
constexpr std::size_t UPLOAD_CHUNK = 0x500;  // [byte] as of a 16i
constexpr std::chrono::milliseconds PUSH_PERIOD{4};

void refuse(const ProgramTransfer::Send& send, std::uint8_t type, int code) {
  ErrorBody error;
  error.code = static_cast<std::int16_t>(code);
  send(type, DIR_ERROR, encodeErrorBody(error));
}

/// "N:PATH" or "O1234-O5678" after the first four bytes of the body of a start frame.
std::string nameIn(const Bytes& body) {
  if (body.size() <= 4) {
    return {};
  }
  Reader reader(body);
  return reader.skip(4).text(body.size() - 4);
}

}  // namespace

bool ProgramTransfer::handle(const Frame& frame, ProgramsInterface& controller, const Send& send) {
  if (frame.is(FRAME_DOWNLOAD_START, DIR_REQUEST)) {
    if (receiving_) {
      refuse(send, FRAME_DOWNLOAD_START, EW_BUSY);
      return true;
    }
    receiving_ = true;
    too_long_ = false;
    text_.clear();
    send(FRAME_DOWNLOAD_START, DIR_REPLY, {});
  } else if (frame.is(FRAME_DOWNLOAD_DATA, DIR_STREAM)) {
    too_long_ = too_long_ || text_.size() + frame.body.size() > MAX_TEXT;
    if (receiving_ && !too_long_) {
      text_.append(frame.body.begin(), frame.body.end());
    }
  } else if (frame.is(FRAME_DOWNLOAD_END, DIR_REQUEST)) {
    endDownload(controller, send);
  } else if (frame.is(FRAME_UPLOAD_START, DIR_REQUEST)) {
    upload(frame, controller, send);
  } else if (frame.is(FRAME_UPLOAD_END, DIR_REQUEST)) {
    queue_.clear();
    send(FRAME_UPLOAD_END, DIR_REPLY, {});  // the client ends the upload early
  } else {
    return frame.is(FRAME_UPLOAD_END, DIR_REPLY);
  }
  return true;
}

void ProgramTransfer::endDownload(ProgramsInterface& controller, const Send& send) {
  int code = EW_FUNC;
  if (receiving_) {
    code = too_long_ ? int{EW_OVRFLOW} : int{controller.storePrograms(text_)};
  }
  receiving_ = false;
  text_.clear();
  if (code == EW_OK) {
    send(FRAME_DOWNLOAD_END, DIR_REPLY, {});
  } else {
    refuse(send, FRAME_DOWNLOAD_END, code);
  }
}

void ProgramTransfer::upload(const Frame& frame, const ProgramsInterface& controller, const Send& send) {
  const std::string name = nameIn(frame.body);
  const std::size_t slash = name.find_last_of('/');
  const std::size_t dash = name.find('-', slash == std::string::npos ? 0 : slash);
  const std::optional<int> first = programNumber(name.substr(0, dash));
  const std::optional<int> last = dash == std::string::npos ? first : programNumber(name.substr(dash + 1));
  std::string text;
  const int code = first && last ? int{controller.fetchPrograms(*first, *last, &text)} : int{EW_DATA};
  if (code != EW_OK) {
    refuse(send, FRAME_UPLOAD_START, code);
    return;
  }
  send(FRAME_UPLOAD_START, DIR_REPLY, {});
  pushed_ = std::chrono::steady_clock::now();
  queue_.clear();
  for (std::size_t at = 0; at < text.size(); at += UPLOAD_CHUNK) {
    const std::size_t size = std::min(UPLOAD_CHUNK, text.size() - at);
    queue_.push_back({FRAME_UPLOAD_DATA, DIR_STREAM, Bytes(text.data() + at, text.data() + at + size)});
  }
  queue_.push_back({FRAME_UPLOAD_END, DIR_REQUEST, {}});
}

void ProgramTransfer::push(const Send& send) {
  const auto now = std::chrono::steady_clock::now();
  if (queue_.empty() || now - pushed_ < PUSH_PERIOD) {
    return;
  }
  pushed_ = now;
  send(queue_.front().type, queue_.front().direction, queue_.front().body);
  queue_.pop_front();
}

}  // namespace smartmill::focas
