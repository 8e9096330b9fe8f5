#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <map>
#include <thread>
#include <type_traits>
#include <vector>

#include <open62541/plugin/accesscontrol_default.h>
#include <open62541/plugin/log_stdout.h>
#include <open62541/plugin/pki_default.h>
#include <open62541/server.h>
#include <open62541/server_config_default.h>
#include <boost/asio/io_context.hpp>

#include "listen.h"
#include "smartmill_core/error.h"
#include "smartmill_core/io/secret_file.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_exchange/items/catalogue.h"
#include "smartmill_exchange/opcua/server.h"

static_assert(UA_MULTITHREADING >= 100, "values are written from another thread than the server's");

namespace smartmill::exchange {
namespace {

constexpr const char* NAMESPACE = "urn:smartmill:exchange";  // also the application URI
constexpr const char* UNITS = "http://www.opcfoundation.org/UA/units/un/cefact";
constexpr double LEAST_PUBLISHING_INTERVAL = 20.0;  // [ms]
constexpr UA_UInt32 LONGEST_QUEUE = 1000;           // [1] values of an item that wait for a client
constexpr double TO_TICKS = 1e7;                    // OPC UA counts time in units of 100 ns

void require(UA_StatusCode code, const std::string& what) {
  if (code != UA_STATUSCODE_GOOD) throw Error("OPC UA: " + what + ": " + UA_StatusCode_name(code));
}

/// View of a text, valid as long as the text is.
UA_String view(const std::string& text) {
  return {text.size(), reinterpret_cast<UA_Byte*>(const_cast<char*>(text.data()))};
}

UA_LocalizedText english(const UA_String& text) {
  static const std::string LOCALE = "en";
  return {view(LOCALE), text};
}

UA_LocalizedText english(const std::string& text) {
  return english(view(text));
}

UA_DateTime ticks(double time) {
  return UA_DATETIME_UNIX_EPOCH + static_cast<UA_DateTime>(std::llround(time * TO_TICKS));
}

/// Code and symbol of a unit by UNECE recommendation 20; code empty: it has none.
struct Unit {
  std::string code, symbol;
};

Unit unitOf(const std::string& name) {
  static const std::map<std::string, Unit> KNOWN{
      {"PERCENT", {"P1", "%"}},
      {"NEWTON", {"NEW", "N"}},
      {"NEWTON_METER", {"NU", "N m"}},
      {"MILLIMETER", {"MMT", "mm"}},
      {"MILLIMETER/SECOND", {"C16", "mm/s"}},
      {"REVOLUTION/MINUTE", {"RPM", "r/min"}},
      {"HERTZ", {"HTZ", "Hz"}},
      {"CELSIUS", {"CEL", "degC"}},
      {"N", {"NEW", "N"}},
      {"N m", {"NU", "N m"}},
      {"Hz", {"HTZ", "Hz"}},
      {"m", {"MTR", "m"}},
      {"rad", {"C81", "rad"}},
      {"rad/s", {"2A", "rad/s"}},
      {"N/m", {"4P", "N/m"}},
      {"N/m2", {"C55", "N/m2"}},
      {"1", {"C62", "1"}},
  };
  const auto known = KNOWN.find(name);
  return known == KNOWN.end() ? Unit{"", name} : known->second;
}

/// The number of a code (OPC 10000-8, 5.6.3.3): its characters, the first one most significant.
UA_Int32 numberOf(const std::string& code) {
  UA_Int32 number = code.empty() ? -1 : 0;
  for (const char c : code) number = number * 256 + static_cast<unsigned char>(c);
  return number;
}

/// No client changes the address space.
template <class Item>
UA_Boolean never(UA_Server*, UA_AccessControl*, const UA_NodeId*, void*, const Item*) {
  return false;
}

std::string conditionText(const Activation& activation) {
  return (activation.fault ? "fault " : "warning ") + activation.code + ": " + activation.text;
}

}  // namespace

class OpcUaServer::Impl {
 public:
  explicit Impl(const OpcUaOptions& options) {
    UA_ServerConfig config{};
    config.logging = UA_Log_Stdout_new(UA_LOGLEVEL_FATAL);
    try {
      configure(options, &config);
    } catch (...) {
      UA_ServerConfig_clean(&config);
      throw;
    }
    server_ = UA_Server_newWithConfig(&config);
    if (!server_) throw Error("OPC UA: out of memory");
    try {
      space_ = UA_Server_addNamespace(server_, NAMESPACE);
      build(options);
      requireFree(options);
      require(UA_Server_run_startup(server_), "start");
    } catch (...) {
      UA_Server_delete(server_);
      throw;
    }
    thread_ = std::thread([this] {
      while (!stopping_) UA_Server_run_iterate(server_, true);
    });
  }

  ~Impl() {
    stopping_ = true;
    thread_.join();
    UA_Server_run_shutdown(server_);
    UA_Server_delete(server_);
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  void observe(const Observation& observation) {
    const DataItem& item = catalogue()[observation.item];
    UA_DataValue value{};
    value.hasSourceTimestamp = true;
    value.sourceTimestamp = ticks(observation.time);
    if (std::holds_alternative<Unavailable>(observation.value)) {
      value.hasStatus = true;
      value.status = UA_STATUSCODE_BADNOCOMMUNICATION;
      write(item.id, value);
      return;
    }
    value.hasValue = true;
    if (const auto* number = std::get_if<double>(&observation.value)) {
      UA_Variant_setScalar(&value.value, const_cast<double*>(number), &UA_TYPES[UA_TYPES_DOUBLE]);
      write(item.id, value);
    } else if (const auto* text = std::get_if<Text>(&observation.value)) {
      UA_String string = view(text->text);
      UA_Variant_setScalar(&value.value, &string, &UA_TYPES[UA_TYPES_STRING]);
      write(item.id, value);
    } else if (const auto* set = std::get_if<DataSet>(&observation.value)) {
      std::vector<std::string> keys;
      std::vector<double> numbers;
      for (const auto& [key, value_of_key] : *set) {
        keys.push_back(key);
        numbers.push_back(value_of_key);
      }
      writeTexts(item.id + "/Keys", keys, value);
      UA_Variant_setArray(&value.value, numbers.data(), numbers.size(), &UA_TYPES[UA_TYPES_DOUBLE]);
      write(item.id, value);
    } else {
      std::vector<std::string> active;
      for (const Activation& activation : std::get<Activations>(observation.value))
        active.push_back(conditionText(activation));
      writeTexts(item.id, active, value);
    }
  }

  /// An asset that is stored again replaces its nodes.
  void store(const Asset& asset) {
    const std::string id = "assets/" + asset.id;
    UA_Server_deleteNode(server_, node(id), true);
    addObject("assets", id, asset.id, asset.type);
    addText(id, "AssetType", asset.type);
    addText(id, "Time", timeText(asset.time));
    for (const auto& [label, text] : asset.labels) addText(id, label, text);
    addQuantities(id, asset.quantities);
    for (const QuantityGroup& group : asset.groups) {
      addObject(id, id + "/" + group.name, group.name, "");
      addQuantities(id + "/" + group.name, group.quantities);
    }
  }

  OpcUaStatistics statistics() const {
    const UA_SessionStatistics s = UA_Server_getStatistics(server_).ss;
    return {s.currentSessionCount, s.rejectedSessionCount + s.securityRejectedSessionCount, written_};
  }

 private:
  static void configure(const OpcUaOptions& options, UA_ServerConfig* config) {
    const auto port = static_cast<UA_UInt16>(options.port);
    const bool secure = !options.certificate_file.empty();
    if (secure) {
      const std::string certificate = readText(options.certificate_file), key = readText(options.key_file);
      const UA_ByteString certificate_bytes = view(certificate), key_bytes = view(key);
      require(
          UA_ServerConfig_setDefaultWithSecureSecurityPolicies(config, port, &certificate_bytes, &key_bytes,
                                                               nullptr, 0, nullptr, 0, nullptr, 0),
          "opcua_certificate_file " + options.certificate_file + " and opcua_key_file " + options.key_file);
      // Without encryption a client can only request the list of connections.
      require(UA_ServerConfig_addSecurityPolicyNone(config, &certificate_bytes), "configuration");
      config->securityPolicyNoneDiscoveryOnly = true;
      keepEncrypted(config);
      // User and password identify a client; any certificate encrypts.
      acceptAnyCertificate(&config->secureChannelPKI);
      acceptAnyCertificate(&config->sessionPKI);
    } else {
      require(UA_ServerConfig_setMinimal(config, port, nullptr), "configuration");
    }
    const std::string url = "opc.tcp://" + (options.address == "0.0.0.0" ? "" : options.address) + ":" +
                            std::to_string(options.port);
    const UA_String urls[] = {view(url)};
    UA_Array_delete(config->serverUrls, config->serverUrlsSize, &UA_TYPES[UA_TYPES_STRING]);
    config->serverUrls = nullptr;
    config->serverUrlsSize = 0;
    require(UA_Array_copy(urls, 1, reinterpret_cast<void**>(&config->serverUrls), &UA_TYPES[UA_TYPES_STRING]),
            "configuration");
    config->serverUrlsSize = 1;
    describe(options, config);
    limit(options, config);
    login(options, config);
  }

  /// Removes connections that are signed only.
  static void keepEncrypted(UA_ServerConfig* config) {
    UA_EndpointDescription* const end = config->endpoints + config->endpointsSize;
    UA_EndpointDescription* const rest =
        std::partition(config->endpoints, end, [](const UA_EndpointDescription& endpoint) {
          return endpoint.securityMode == UA_MESSAGESECURITYMODE_SIGNANDENCRYPT;
        });
    for (UA_EndpointDescription* endpoint = rest; endpoint != end; ++endpoint)
      UA_EndpointDescription_clear(endpoint);
    config->endpointsSize = static_cast<std::size_t>(rest - config->endpoints);
  }

  static void acceptAnyCertificate(UA_CertificateVerification* verification) {
    if (verification->clear) verification->clear(verification);
    UA_CertificateVerification_AcceptAll(verification);
  }

  static void describe(const OpcUaOptions& options, UA_ServerConfig* config) {
    const std::string uri = NAMESPACE, name = options.device + ", SmartMill";
    const UA_LocalizedText text = english(name);
    UA_String_clear(&config->applicationDescription.applicationUri);
    const UA_String uri_view = view(uri);
    require(UA_String_copy(&uri_view, &config->applicationDescription.applicationUri), "configuration");
    UA_LocalizedText_clear(&config->applicationDescription.applicationName);
    require(UA_LocalizedText_copy(&text, &config->applicationDescription.applicationName), "configuration");
    for (std::size_t i = 0; i < config->endpointsSize; ++i) {
      UA_ApplicationDescription_clear(&config->endpoints[i].server);
      require(UA_ApplicationDescription_copy(&config->applicationDescription, &config->endpoints[i].server),
              "configuration");
    }
  }

  static void limit(const OpcUaOptions& options, UA_ServerConfig* config) {
    config->maxSessions = static_cast<UA_UInt16>(options.most_clients);
    config->maxSecureChannels = static_cast<UA_UInt16>(2 * options.most_clients);
    config->maxSubscriptionsPerSession = 4;
    config->maxMonitoredItemsPerSubscription = static_cast<UA_UInt32>(2 * catalogue().size());
    config->queueSizeLimits.max = LONGEST_QUEUE;
    config->maxNodesPerRead = config->maxNodesPerBrowse = config->maxMonitoredItemsPerCall = 10000;
    config->tcpReuseAddr = true;  // also shares the port with another server: see requireFree()
    config->publishingIntervalLimits.min = LEAST_PUBLISHING_INTERVAL;
    config->samplingIntervalLimits.min = 0.0;  // 0: every value, not a sample at times
  }

  static void login(const OpcUaOptions& options, UA_ServerConfig* config) {
    const bool named = !options.user.empty();
    const std::string password =
        named ? readSecret("opcua_password_file", options.password_file) : std::string();
    const UA_UsernamePasswordLogin user{view(options.user), view(password)};
    // On this computer a password may be sent without encryption.
    config->allowNonePolicyPassword = options.certificate_file.empty();
    require(UA_AccessControl_default(config, !named, nullptr, named ? 1 : 0, named ? &user : nullptr),
            "users");
    config->accessControl.allowAddNode = never;
    config->accessControl.allowAddReference = never;
    config->accessControl.allowDeleteNode = never;
    config->accessControl.allowDeleteReference = never;
  }

  /// The library would share a port with another program's server instead of refusing it.
  static void requireFree(const OpcUaOptions& options) {
    boost::asio::io_context context;
    boost::asio::ip::tcp::acceptor probe(context);
    listenAt(probe, options.address, options.port, "opcua_address");
  }

  /// Identifier that refers to `id`, without ownership.
  UA_NodeId node(const std::string& id) const {
    UA_NodeId found{};
    found.namespaceIndex = space_;
    found.identifierType = UA_NODEIDTYPE_STRING;
    found.identifier.string = view(id);
    return found;
  }

  static UA_NodeId standard(UA_UInt32 number) { return UA_NODEID_NUMERIC(0, number); }

  UA_QualifiedName browseName(const std::string& name) const { return {space_, view(name)}; }

  void addObject(const std::string& parent, const std::string& id, const std::string& name,
                 const std::string& description) {
    UA_ObjectAttributes attributes = UA_ObjectAttributes_default;
    attributes.displayName = english(name);
    attributes.description = english(description);
    const bool top = parent.empty();
    require(
        UA_Server_addObjectNode(server_, node(id), top ? standard(UA_NS0ID_OBJECTSFOLDER) : node(parent),
                                standard(top ? UA_NS0ID_ORGANIZES : UA_NS0ID_HASCOMPONENT), browseName(name),
                                standard(UA_NS0ID_BASEOBJECTTYPE), attributes, nullptr, nullptr),
        "node " + id);
  }

  /// @param rank UA_VALUERANK_SCALAR or UA_VALUERANK_ONE_DIMENSION
  void addVariable(const std::string& parent, const std::string& id, const UA_QualifiedName& name,
                   const std::string& description, int type, UA_Int32 rank, bool property,
                   const UA_Variant& value) {
    UA_VariableAttributes attributes = UA_VariableAttributes_default;
    attributes.displayName = english(name.name);
    attributes.description = english(description);
    attributes.dataType = UA_TYPES[type].typeId;
    attributes.valueRank = rank;
    const UA_UInt32 any_length = 0;
    if (rank == UA_VALUERANK_ONE_DIMENSION) {
      attributes.arrayDimensionsSize = 1;
      attributes.arrayDimensions = const_cast<UA_UInt32*>(&any_length);
    }
    attributes.accessLevel = UA_ACCESSLEVELMASK_READ;
    attributes.value = value;
    require(
        UA_Server_addVariableNode(server_, node(id), node(parent),
                                  standard(property ? UA_NS0ID_HASPROPERTY : UA_NS0ID_HASCOMPONENT), name,
                                  standard(property ? UA_NS0ID_PROPERTYTYPE : UA_NS0ID_BASEDATAVARIABLETYPE),
                                  attributes, nullptr, nullptr),
        "node " + id);
  }

  void addText(const std::string& parent, const std::string& name, const std::string& text) {
    UA_String string = view(text);
    UA_Variant value{};
    UA_Variant_setScalar(&value, &string, &UA_TYPES[UA_TYPES_STRING]);
    addVariable(parent, parent + "/" + name, browseName(name), "", UA_TYPES_STRING, UA_VALUERANK_SCALAR, true,
                value);
  }

  void addUnits(const std::string& parent, const std::string& units) {
    if (units.empty()) return;
    const Unit unit = unitOf(units);
    const std::string uri = UNITS;
    UA_EUInformation information{};
    information.namespaceUri = view(uri);
    information.unitId = numberOf(unit.code);
    information.displayName = information.description = english(unit.symbol);
    UA_Variant value{};
    UA_Variant_setScalar(&value, &information, &UA_TYPES[UA_TYPES_EUINFORMATION]);
    const std::string name = "EngineeringUnits";  // of the standard: clients look for it
    addVariable(parent, parent + "/" + name, {0, view(name)}, "", UA_TYPES_EUINFORMATION, UA_VALUERANK_SCALAR,
                true, value);
  }

  void addQuantities(const std::string& parent, const std::vector<Quantity>& quantities) {
    for (const Quantity& quantity : quantities) {
      if (!std::isfinite(quantity.value)) continue;
      const std::string id = parent + "/" + quantity.name;
      UA_Variant value{};
      UA_Variant_setScalar(&value, const_cast<double*>(&quantity.value), &UA_TYPES[UA_TYPES_DOUBLE]);
      addVariable(parent, id, browseName(quantity.name), "", UA_TYPES_DOUBLE, UA_VALUERANK_SCALAR, false,
                  value);
      addUnits(id, quantity.unit);
      if (!std::isfinite(quantity.std_dev)) continue;
      UA_Variant_setScalar(&value, const_cast<double*>(&quantity.std_dev), &UA_TYPES[UA_TYPES_DOUBLE]);
      addVariable(id, id + "/StandardDeviation", browseName("StandardDeviation"), "", UA_TYPES_DOUBLE,
                  UA_VALUERANK_SCALAR, true, value);
    }
  }

  void addItem(std::size_t index) {
    const DataItem& item = catalogue()[index];
    const bool number = item.category == Category::sample,
               list = item.category == Category::condition || item.set;
    const int type = number ? UA_TYPES_DOUBLE : UA_TYPES_STRING;
    addVariable(item.component.empty() ? "monitoring" : item.component, item.id, browseName(item.id),
                item.meaning + "; uncertainty: " + item.uncertainty + "; bandwidth: " + item.bandwidth, type,
                list ? UA_VALUERANK_ONE_DIMENSION : UA_VALUERANK_SCALAR, false, {});
    addUnits(item.id, item.units);
    if (item.set)
      addVariable(item.id, item.id + "/Keys", browseName("Keys"), "of the values", UA_TYPES_STRING,
                  UA_VALUERANK_ONE_DIMENSION, true, {});
    observe({index, 0.0, Unavailable{}});
  }

  void build(const OpcUaOptions& options) {
    addObject("", "machines", "Machines", "");
    addObject("machines", "machine", options.device, "Milling machine that measures itself");
    addObject("machine", "identification", "Identification", "");
    if (!options.manufacturer.empty()) addText("identification", "Manufacturer", options.manufacturer);
    if (!options.model.empty()) addText("identification", "Model", options.model);
    addText("identification", "ProductInstanceUri", options.uuid);
    addObject("machine", "monitoring", "Monitoring", "");
    addObject("machine", "assets", "Assets", "coefficients, modes and charts");
    for (const Component& c : components())
      addObject(c.parent.empty() ? "monitoring" : c.parent, c.id, c.name, "");
    for (std::size_t i = 0; i < catalogue().size(); ++i) addItem(i);
  }

  void write(const std::string& id, const UA_DataValue& value) {
    require(UA_Server_writeDataValue(server_, node(id), value), "value of " + id);
    ++written_;
  }

  void writeTexts(const std::string& id, const std::vector<std::string>& texts, UA_DataValue value) {
    std::vector<UA_String> strings;
    for (const std::string& text : texts) strings.push_back(view(text));
    value.hasValue = true;
    // An array without elements, which is not the same as none.
    void* const data = strings.empty() ? UA_EMPTY_ARRAY_SENTINEL : strings.data();
    UA_Variant_setArray(&value.value, data, strings.size(), &UA_TYPES[UA_TYPES_STRING]);
    write(id, value);
  }

  UA_Server* server_ = nullptr;
  UA_UInt16 space_ = 0;
  std::atomic<bool> stopping_{false};
  std::atomic<std::uint64_t> written_{0};
  std::thread thread_;
};

OpcUaServer::OpcUaServer(const OpcUaOptions& options) {
  check(options);
  impl_ = std::make_unique<Impl>(options);
}

OpcUaServer::~OpcUaServer() = default;

void OpcUaServer::observe(const Observation& observation) {
  impl_->observe(observation);
}

void OpcUaServer::store(const Asset& asset) {
  impl_->store(asset);
}

OpcUaStatistics OpcUaServer::statistics() const {
  return impl_->statistics();
}

}  // namespace smartmill::exchange
