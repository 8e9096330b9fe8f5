#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_exchange/opcua/server.h"

namespace smartmill::exchange {
namespace {

using ::testing::HasSubstr;

std::string messageOf(const OpcUaOptions& options) {
  try {
    check(options);
  } catch (const Error& error) {
    return error.what();
  }
  return "accepted";
}

TEST(OpcUaOptions, AnAddressOfOtherComputersRequiresUserAndCertificate) {
  OpcUaOptions options;
  for (const char* address : {"127.0.0.1", "127.1.2.3", "::1"}) {
    options.address = address;
    EXPECT_EQ(messageOf(options), "accepted") << address;
  }
  for (const char* address : {"0.0.0.0", "192.0.2.1", "127.evil.example", "localhost.example", ""}) {
    OpcUaOptions remote;
    remote.address = address;
    EXPECT_THAT(messageOf(remote), HasSubstr("expected opcua_user and opcua_password_file")) << address;
    remote.user = "mill";
    EXPECT_THAT(messageOf(remote), HasSubstr("expected both or neither")) << address;
    remote.password_file = "password";
    EXPECT_THAT(messageOf(remote), HasSubstr("expected opcua_certificate_file and opcua_key_file"))
        << address;
    remote.certificate_file = "certificate.der";
    EXPECT_THAT(messageOf(remote), HasSubstr("expected both or neither")) << address;
    remote.key_file = "key.der";
    EXPECT_EQ(messageOf(remote), "accepted") << address;
  }
}

}  // namespace
}  // namespace smartmill::exchange
