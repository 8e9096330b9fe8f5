#pragma once

#include <string>
#include <vector>

#include "connection.h"
#include "dnc_stream.h"
#include "smartmill_focas/client.h"

namespace smartmill::focas {

/// Connection and exchange of requests and replies; the single calls are in client_calls.cpp.
class Client::Impl {
 public:
  Connection connection;
  DncStream dnc{connection};
  ControllerInfo info;

  void connect(const std::string& host, std::uint16_t port, double timeout);
  std::vector<SubReply> exchange(const std::vector<SubRequest>& requests);

  /// Data of one reply. @throws FocasError naming the call if the reply is an error.
  static const Bytes& dataOf(const std::string& call, const SubReply& reply);
  /// Sends one request. @return data of the reply. @throws FocasError as dataOf()
  Bytes request(const std::string& call, const SubRequest& request);

  /// Decodes data and turns a WireError into a FocasError that names the call.
  template <class Decode>
  static auto decode(const std::string& call, const Bytes& data, Decode&& decoder) {
    try {
      Reader reader(data);
      return decoder(reader);
    } catch (const WireError& e) {
      throw FocasError(call + ": " + e.what(), EW_LENGTH);
    }
  }
  /// @throws FocasError if there is no value.
  static std::vector<double> values(const std::string& call, const Bytes& data, std::size_t at_most);

  std::size_t axes() const { return static_cast<std::size_t>(info.axes); }
  std::size_t spindles() const { return static_cast<std::size_t>(info.spindles); }

 private:
  std::vector<SubReply> receiveReplies(const std::vector<SubRequest>& requests, Clock::time_point deadline);
  void readSystemInfo(const OpenReply& open_reply);
};

}  // namespace smartmill::focas
