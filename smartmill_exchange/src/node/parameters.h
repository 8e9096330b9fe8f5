#pragma once

#include <string>

#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_exchange/items/translator.h"
#include "smartmill_exchange/mqtt/publisher.h"
#include "smartmill_exchange/opcua/server.h"

namespace smartmill::exchange {

struct ExchangeParameters {
  std::string device = "SmartMill", uuid = "smartmill-1", manufacturer, machine;
  TranslatorParameters translator;
  bool agent = true;
  std::string agent_address = "127.0.0.1";
  int agent_port = 5000;
  int buffer = 131072;
  bool adapter = true;
  std::string adapter_address = "127.0.0.1";
  int adapter_port = 7878;
  double heartbeat = 10.0;
  double queue = 4.0;
  int most_clients = 32;
  MqttOptions mqtt;
  std::string opcua_address = "127.0.0.1";
  int opcua_port = 0;
  std::string opcua_user, opcua_password_file, opcua_certificate_file, opcua_key_file;

  void declare(ParameterTable& table) {
    table.title(
        "Parameters of exchange_node (package smartmill_exchange): data items by MTConnect, MQTT and OPC "
        "UA.");
    table.text("device", device, "name of the machine: letters, digits, points, hyphens and underscores");
    table.text("uuid", uuid, "identifier of the machine, unique in the shop");
    table.text("manufacturer", manufacturer, "of the machine, for the description; may be empty");
    table.text("machine", machine, "type of the machine, for the description; may be empty");
    table.section("Data items.");
    translator.declare(table);
    table.section("MTConnect agent: HTTP.");
    table.flag("agent", agent, "true: it is started");
    table.text("agent_address", agent_address,
               "address to listen at; 127.0.0.1: this computer only, 0.0.0.0: all networks");
    table.number("agent_port", agent_port, "1", Range::closed(0, 65535),
                 "port to listen at; 0: any free one");
    table.number("buffer", buffer, "1", Range::closed(128, 16777216),
                 "observations that a client can read later");
    table.section("SHDR adapter for another MTConnect agent: TCP.");
    table.flag("adapter", adapter, "true: it is started");
    table.text("adapter_address", adapter_address, "as agent_address");
    table.number("adapter_port", adapter_port, "1", Range::closed(0, 65535), "as agent_port");
    table.number("heartbeat", heartbeat, "s", Range::closed(0.1, 600.0),
                 "stated in PONG: an agent sends a PING this often");
    table.section("Limits.");
    table.number("queue", queue, "MB", Range::closed(0.1, 1000.0),
                 "queued for a client of the adapter before it is disconnected");
    table.number("most_clients", most_clients, "1", Range::closed(1, 1000),
                 "most clients of agent, adapter and OPC UA each at a time");
    table.section("MQTT. A broker on another computer requires mqtts, user and password.");
    table.text("mqtt_broker", mqtt.broker, "mqtt://HOST:PORT or mqtts://HOST:PORT; empty: no MQTT");
    table.text("mqtt_prefix", mqtt.prefix, "first levels of the topics, unique for each machine of a broker");
    table.text("mqtt_client", mqtt.client, "client identifier, unique at the broker");
    table.text("mqtt_user", mqtt.user, "user; empty: none");
    table.text("mqtt_password_file", mqtt.password_file,
               "file with the password, readable by its owner only; empty: none");
    table.text("mqtt_ca_file", mqtt.ca_file,
               "certificates that sign the broker's; empty: those of the system");
    table.section("OPC UA (Debian 13). Another address than loopback requires user and certificate.");
    table.number("opcua_port", opcua_port, "1", Range::closed(0, 65535),
                 "port to listen at, 4840 by convention; 0: no OPC UA");
    table.text("opcua_address", opcua_address, "as agent_address");
    table.text("opcua_user", opcua_user, "user; empty: everybody on this computer");
    table.text("opcua_password_file", opcua_password_file,
               "file with the password, readable by its owner only; empty: none");
    table.text("opcua_certificate_file", opcua_certificate_file,
               "certificate of the server (PEM or DER) for urn:smartmill:exchange; empty: no encryption");
    table.text("opcua_key_file", opcua_key_file, "its private key");
  }
  OpcUaOptions opcua() const {
    OpcUaOptions options;
    options.address = opcua_address;
    options.port = opcua_port;
    options.device = device;
    options.uuid = uuid;
    options.manufacturer = manufacturer;
    options.model = machine;
    options.user = opcua_user;
    options.password_file = opcua_password_file;
    options.certificate_file = opcua_certificate_file;
    options.key_file = opcua_key_file;
    options.most_clients = static_cast<std::size_t>(most_clients);
    return options;
  }
  /// @throws Error naming key and value.
  void validate() const {
    checkBounds(*this);
    if (!mqtt.broker.empty()) check(mqtt);
    if (opcua_port > 0) check(opcua());
  }
};

}  // namespace smartmill::exchange
