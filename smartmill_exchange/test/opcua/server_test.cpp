// The server read by the library's own client; by a client of another hand: test/clients/opcua.js.
#include "smartmill_exchange/opcua/server.h"

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <list>
#include <map>
#include <memory>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <open62541/client.h>
#include <open62541/client_config_default.h>
#include <open62541/client_highlevel.h>
#include <open62541/client_subscriptions.h>
#include <open62541/plugin/log_stdout.h>
#include <nlohmann/json.hpp>

#include "smartmill_core/error.h"
#include "smartmill_core/testing/free_port.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_exchange/items/catalogue.h"

namespace smartmill::exchange {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr double NOW = 1.7e9 + 0.25;  // [s]

OpcUaOptions onLoopback() {
  OpcUaOptions options;
  options.port = freePort();
  options.device = "mill";
  options.uuid = "mill-7";
  options.manufacturer = "Example";
  return options;
}

std::string textOf(const UA_String& string) {
  return std::string(reinterpret_cast<const char*>(string.data), string.length);
}

class Client {
 public:
  explicit Client(const OpcUaOptions& options) : client_(newClient()) {
    url_ = "opc.tcp://127.0.0.1:" + std::to_string(options.port);
  }
  ~Client() { UA_Client_delete(client_); }
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  UA_StatusCode connect() { return UA_Client_connect(client_, url_.c_str()); }
  UA_StatusCode connect(const std::string& user, const std::string& password) {
    return UA_Client_connectUsername(client_, url_.c_str(), user.c_str(), password.c_str());
  }

  UA_NodeId node(const std::string& id) {
    const UA_String uri = UA_STRING(const_cast<char*>("urn:smartmill:exchange"));
    UA_UInt16 index = 0;
    EXPECT_EQ(UA_Client_NamespaceGetIndex(client_, const_cast<UA_String*>(&uri), &index), UA_STATUSCODE_GOOD);
    return UA_NODEID_STRING(index, const_cast<char*>((ids_.push_back(id), ids_.back()).c_str()));
  }

  UA_DataValue read(const std::string& id) {
    UA_ReadValueId item{};
    item.nodeId = node(id);
    item.attributeId = UA_ATTRIBUTEID_VALUE;
    UA_ReadRequest request{};
    request.nodesToRead = &item;
    request.nodesToReadSize = 1;
    request.timestampsToReturn = UA_TIMESTAMPSTORETURN_BOTH;
    UA_ReadResponse response = UA_Client_Service_read(client_, request);
    UA_DataValue value{};
    if (response.resultsSize == 1) std::swap(value, response.results[0]);
    UA_ReadResponse_clear(&response);
    return value;
  }
  /// The number of a good value, otherwise NaN.
  double number(const std::string& id) {
    UA_DataValue value = read(id);
    const bool good = UA_Variant_hasScalarType(&value.value, &UA_TYPES[UA_TYPES_DOUBLE]) &&
                      (!value.hasStatus || value.status == UA_STATUSCODE_GOOD);
    const double found = good ? *static_cast<double*>(value.value.data) : std::nan("");
    UA_DataValue_clear(&value);
    return found;
  }
  std::vector<std::string> texts(const std::string& id) {
    UA_DataValue value = read(id);
    std::vector<std::string> found;
    const auto* strings = static_cast<const UA_String*>(value.value.data);
    if (UA_Variant_hasScalarType(&value.value, &UA_TYPES[UA_TYPES_STRING])) found = {textOf(*strings)};
    if (UA_Variant_hasArrayType(&value.value, &UA_TYPES[UA_TYPES_STRING]))
      for (std::size_t i = 0; i < value.value.arrayLength; ++i) found.push_back(textOf(strings[i]));
    UA_DataValue_clear(&value);
    return found;
  }
  UA_StatusCode status(const std::string& id) {
    UA_DataValue value = read(id);
    const UA_StatusCode found = value.hasStatus ? value.status : UA_STATUSCODE_GOOD;
    UA_DataValue_clear(&value);
    return found;
  }
  UA_Client* raw() { return client_; }

 private:
  static UA_Client* newClient() {
    UA_ClientConfig config{};
    config.logging = UA_Log_Stdout_new(UA_LOGLEVEL_FATAL);
    UA_ClientConfig_setDefault(&config);
    return UA_Client_newWithConfig(&config);
  }

  UA_Client* client_;
  std::string url_;
  std::list<std::string> ids_;
};

/// Numbers of units as published by the OPC Foundation (UNECE recommendation 20 to OPC UA).
TEST(OpcUaServer, EveryItemHasItsTypeAndUnits) {
  const std::map<std::string, UA_Int32> published{{"PERCENT", 20529},
                                                  {"NEWTON", 5129559},
                                                  {"NEWTON_METER", 20053},
                                                  {"MILLIMETER", 5066068},
                                                  {"HERTZ", 4740186},
                                                  {"CELSIUS", 4408652},
                                                  {"REVOLUTION/MINUTE", 5394509},
                                                  {"MILLIMETER/SECOND", 4403510}};
  const OpcUaOptions options = onLoopback();
  const OpcUaServer server(options);
  Client client(options);
  ASSERT_EQ(client.connect(), UA_STATUSCODE_GOOD);
  for (const DataItem& item : catalogue()) {
    EXPECT_EQ(client.status(item.id), UA_STATUSCODE_BADNOCOMMUNICATION) << item.id;
    UA_NodeId type{};
    ASSERT_EQ(UA_Client_readDataTypeAttribute(client.raw(), client.node(item.id), &type), UA_STATUSCODE_GOOD);
    EXPECT_EQ(type.identifier.numeric,
              static_cast<UA_UInt32>(item.category == Category::sample ? UA_NS0ID_DOUBLE : UA_NS0ID_STRING));
    if (item.units.empty()) continue;
    UA_DataValue units = client.read(item.id + "/EngineeringUnits");
    ASSERT_TRUE(UA_Variant_hasScalarType(&units.value, &UA_TYPES[UA_TYPES_EUINFORMATION])) << item.id;
    const auto* information = static_cast<const UA_EUInformation*>(units.value.data);
    EXPECT_EQ(information->unitId, published.at(item.units)) << item.id;
    EXPECT_EQ(textOf(information->namespaceUri), "http://www.opcfoundation.org/UA/units/un/cefact");
    UA_DataValue_clear(&units);
  }
  EXPECT_THAT(client.texts("identification/ProductInstanceUri"), ElementsAre("mill-7"));
  EXPECT_THAT(client.texts("identification/Manufacturer"), ElementsAre("Example"));
}

TEST(OpcUaServer, ValuesHaveTheirTimeAndStatus) {
  const OpcUaOptions options = onLoopback();
  OpcUaServer server(options);
  Client client(options);
  ASSERT_EQ(client.connect(), UA_STATUSCODE_GOOD);
  server.observe({indexOf("feed"), NOW, 1.0 / 3});
  server.observe({indexOf("program"), NOW, Text{"4711"}});
  server.observe({indexOf("force_peak_tooth"), NOW, DataSet{{"t1", 211.5}, {"t2", 198.25}}});
  server.observe({indexOf("alarms"), NOW, Activations{{true, "417", "servo"}, {false, "9", "oil"}}});
  EXPECT_EQ(client.number("feed"), 1.0 / 3);
  EXPECT_THAT(client.texts("program"), ElementsAre("4711"));
  EXPECT_THAT(client.texts("force_peak_tooth/Keys"), ElementsAre("t1", "t2"));
  EXPECT_THAT(client.texts("alarms"), ElementsAre("fault 417: servo", "warning 9: oil"));
  UA_DataValue set = client.read("force_peak_tooth");
  ASSERT_TRUE(UA_Variant_hasArrayType(&set.value, &UA_TYPES[UA_TYPES_DOUBLE]));
  ASSERT_EQ(set.value.arrayLength, 2u);
  EXPECT_EQ(static_cast<double*>(set.value.data)[1], 198.25);
  // 100 ns since 1601: 11,644,473,600 s lie between 1601 and 1970.
  EXPECT_EQ(set.sourceTimestamp, static_cast<UA_DateTime>((11644473600.0 + NOW) * 1e7));
  UA_DataValue_clear(&set);
  server.observe({indexOf("alarms"), NOW, Activations{}});
  UA_DataValue none = client.read("alarms");
  EXPECT_TRUE(UA_Variant_hasArrayType(&none.value, &UA_TYPES[UA_TYPES_STRING]) &&
              none.value.arrayLength == 0);
  EXPECT_FALSE(none.hasStatus);
  UA_DataValue_clear(&none);
  server.observe({indexOf("feed"), NOW + 1, Unavailable{}});
  EXPECT_EQ(client.status("feed"), UA_STATUSCODE_BADNOCOMMUNICATION);
}

TEST(OpcUaServer, AnAssetReplacesTheOneBefore) {
  const OpcUaOptions options = onLoopback();
  OpcUaServer server(options);
  Client client(options);
  ASSERT_EQ(client.connect(), UA_STATUSCODE_GOOD);
  server.store({"coefficients.a.b",
                "CuttingCoefficients",
                NOW,
                {{"tool", "a"}},
                {{"ktc", "N/m2", 796e6, 4e6}, {"kte", "N/m", 27.7e3}, {"krc", "N/m2", std::nan("")}},
                {{"mode_1", {{"frequency", "Hz", 930.0, 0.5}}}}});
  const std::string id = "assets/coefficients.a.b";
  EXPECT_THAT(client.texts(id + "/tool"), ElementsAre("a"));
  EXPECT_EQ(client.number(id + "/ktc"), 796e6);
  EXPECT_EQ(client.number(id + "/ktc/StandardDeviation"), 4e6);
  EXPECT_EQ(client.status(id + "/kte/StandardDeviation"), UA_STATUSCODE_BADNODEIDUNKNOWN);
  EXPECT_EQ(client.status(id + "/krc"), UA_STATUSCODE_BADNODEIDUNKNOWN);
  EXPECT_EQ(client.number(id + "/mode_1/frequency/StandardDeviation"), 0.5);
  server.store({"coefficients.a.b", "CuttingCoefficients", NOW, {}, {{"ktc", "N/m2", 800e6}}, {}});
  EXPECT_EQ(client.number(id + "/ktc"), 800e6);
  EXPECT_EQ(client.status(id + "/ktc/StandardDeviation"), UA_STATUSCODE_BADNODEIDUNKNOWN);
  EXPECT_EQ(client.status(id + "/mode_1/frequency"), UA_STATUSCODE_BADNODEIDUNKNOWN);
}

TEST(OpcUaServer, NothingCanBeWrittenAddedOrDeleted) {
  const OpcUaOptions options = onLoopback();
  OpcUaServer server(options);
  Client client(options);
  ASSERT_EQ(client.connect(), UA_STATUSCODE_GOOD);
  server.observe({indexOf("feed"), NOW, 5.0});
  double other = 6.0;
  UA_Variant value;
  UA_Variant_setScalar(&value, &other, &UA_TYPES[UA_TYPES_DOUBLE]);
  EXPECT_NE(UA_Client_writeValueAttribute(client.raw(), client.node("feed"), &value), UA_STATUSCODE_GOOD);
  EXPECT_EQ(client.number("feed"), 5.0);
  EXPECT_NE(UA_Client_deleteNode(client.raw(), client.node("feed"), true), UA_STATUSCODE_GOOD);
  UA_LocalizedText name = UA_LOCALIZEDTEXT(const_cast<char*>("en"), const_cast<char*>("other"));
  EXPECT_NE(UA_Client_writeDisplayNameAttribute(client.raw(), client.node("feed"), &name),
            UA_STATUSCODE_GOOD);
  const UA_ObjectAttributes attributes = UA_ObjectAttributes_default;
  EXPECT_NE(UA_Client_addObjectNode(client.raw(), UA_NODEID_NULL, client.node("machine"),
                                    UA_NODEID_NUMERIC(0, UA_NS0ID_HASCOMPONENT),
                                    UA_QUALIFIEDNAME(1, const_cast<char*>("x")),
                                    UA_NODEID_NUMERIC(0, UA_NS0ID_BASEOBJECTTYPE), attributes, nullptr),
            UA_STATUSCODE_GOOD);
  EXPECT_NE(UA_Client_deleteReference(client.raw(), client.node("monitoring"),
                                      UA_NODEID_NUMERIC(0, UA_NS0ID_HASCOMPONENT), true,
                                      UA_EXPANDEDNODEID_STRING(1, const_cast<char*>("c_axes")), true),
            UA_STATUSCODE_GOOD);
  EXPECT_EQ(client.number("feed"), 5.0);
}

TEST(OpcUaServer, ASubscriptionGetsEveryValueInOrder) {
  constexpr int PARTS = 4, VALUES = 500;  // a client's queue has space for 1000
  const OpcUaOptions options = onLoopback();
  OpcUaServer server(options);
  Client client(options);
  ASSERT_EQ(client.connect(), UA_STATUSCODE_GOOD);
  UA_CreateSubscriptionRequest request = UA_CreateSubscriptionRequest_default();
  request.requestedPublishingInterval = 20.0;
  const UA_CreateSubscriptionResponse subscription =
      UA_Client_Subscriptions_create(client.raw(), request, nullptr, nullptr, nullptr);
  ASSERT_EQ(subscription.responseHeader.serviceResult, UA_STATUSCODE_GOOD);
  UA_MonitoredItemCreateRequest item = UA_MonitoredItemCreateRequest_default(client.node("feed"));
  item.requestedParameters.samplingInterval = 0.0;
  item.requestedParameters.queueSize = 2 * VALUES;
  std::vector<double> found;
  const auto take = [](UA_Client*, UA_UInt32, void*, UA_UInt32, void* list, UA_DataValue* value) {
    if (UA_Variant_hasScalarType(&value->value, &UA_TYPES[UA_TYPES_DOUBLE]) && !value->hasStatus)
      static_cast<std::vector<double>*>(list)->push_back(*static_cast<double*>(value->value.data));
  };
  const UA_MonitoredItemCreateResult created = UA_Client_MonitoredItems_createDataChange(
      client.raw(), subscription.subscriptionId, UA_TIMESTAMPSTORETURN_BOTH, item, &found, take, nullptr);
  ASSERT_EQ(created.statusCode, UA_STATUSCODE_GOOD);
  std::vector<double> sent;
  for (int part = 0; part < PARTS; ++part) {
    for (int i = 0; i < VALUES; ++i) {
      sent.push_back(1e-3 * static_cast<double>(sent.size()));
      server.observe({indexOf("feed"), NOW + sent.back(), sent.back()});
    }
    while (found.size() < sent.size()) UA_Client_run_iterate(client.raw(), 50);
  }
  EXPECT_EQ(found, sent);
}

TEST(OpcUaServer, AUserNeedsThePassword) {
  const TemporaryFolder folder;
  OpcUaOptions options = onLoopback();
  options.user = "shop";
  options.password_file = folder.write("password", "s3cret\n");
  std::filesystem::permissions(options.password_file, std::filesystem::perms::owner_read);
  const OpcUaServer server(options);
  EXPECT_NE(Client(options).connect(), UA_STATUSCODE_GOOD);
  EXPECT_NE(Client(options).connect("shop", "wrong"), UA_STATUSCODE_GOOD);
  EXPECT_NE(Client(options).connect("other", "s3cret"), UA_STATUSCODE_GOOD);
  EXPECT_EQ(Client(options).connect("shop", "s3cret"), UA_STATUSCODE_GOOD);
}

TEST(OpcUaServer, APortInUseIsNamed) {
  const OpcUaOptions options = onLoopback();
  const OpcUaServer server(options);
  try {
    const OpcUaServer second(options);
    FAIL() << "a second server listens at the same port";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("127.0.0.1:" + std::to_string(options.port) + ": cannot listen"));
  }
}

TEST(OpcUaServer, ListensAgainAtOnceAfterAClientsConnection) {
  const OpcUaOptions options = onLoopback();
  auto server = std::make_unique<OpcUaServer>(options);
  Client first(options), second(options);
  ASSERT_EQ(first.connect(), UA_STATUSCODE_GOOD);
  server.reset();
  server = std::make_unique<OpcUaServer>(options);
  EXPECT_EQ(second.connect(), UA_STATUSCODE_GOOD);
}

TEST(OpcUaServer, WithACertificateOnlyEncryptedConnectionsAreAccepted) {
  const TemporaryFolder folder;
  OpcUaOptions options = onLoopback();
  const std::string key = folder.file("key.pem"), certificate = folder.file("certificate.pem");
  if (std::system(("openssl req -x509 -newkey rsa:2048 -nodes -days 2 -subj /CN=mill -addext "
                   "subjectAltName=URI:urn:smartmill:exchange,IP:127.0.0.1 -keyout " +
                   key + " -out " + certificate + " 2>/dev/null")
                      .c_str()) != 0)
    GTEST_SKIP() << "openssl is not installed";
  options.certificate_file = certificate;
  options.key_file = key;
  options.user = "shop";
  options.password_file = folder.write("password", "s3cret\n");
  std::filesystem::permissions(options.password_file, std::filesystem::perms::owner_read);
  OpcUaServer server(options);
  EXPECT_NE(Client(options).connect("shop", "s3cret"), UA_STATUSCODE_GOOD);
  // The client of another hand encrypts.
  const std::string client = SOURCE_FOLDER "/test/clients/opcua.js";
  if (std::system("node -e \"require('node-opcua-client')\" 2>/dev/null") != 0)
    GTEST_SKIP() << "node-opcua-client is not installed";
  server.observe({indexOf("feed"), NOW, 12.5});
  const std::string out = folder.file("out.json");
  ASSERT_EQ(std::system(("node " + client + " " + std::to_string(options.port) +
                         " --user shop --password s3cret >" + out)
                            .c_str()),
            0);
  std::ifstream in(out);
  const nlohmann::json found = nlohmann::json::parse(in);
  EXPECT_EQ(found["feed"]["value"], 12.5);
  EXPECT_EQ(found["feed"]["units"], "mm/s");
}

}  // namespace
}  // namespace smartmill::exchange
