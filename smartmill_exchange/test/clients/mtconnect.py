"""An MTConnect client of the Python standard library, and the rules of the standard (1.8) for what an agent sends: names and order of elements,
required attributes, types of values, uniqueness and consecutive sequence numbers."""
import re
import socket
import urllib.error
import urllib.request
import xml.etree.ElementTree as ElementTree

VERSION = "1.8"
EXTENSION = "urn:smartmill:MTConnect:1.0"
TIME = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d+)?Z$")
CATEGORIES = {"SAMPLE": "Samples", "EVENT": "Events", "CONDITION": "Condition"}
LEVELS = ("Normal", "Warning", "Fault", "Unavailable")
# Attributes that the header of each document must have.
HEADER = {"Devices": {"assetBufferSize", "assetCount", "bufferSize"},
          "Streams": {"bufferSize", "firstSequence", "lastSequence", "nextSequence"},
          "Assets": {"assetBufferSize", "assetCount"}, "Error": {"bufferSize"}}
ERRORS = {"ASSET_NOT_FOUND", "INTERNAL_ERROR", "INVALID_REQUEST", "INVALID_URI", "INVALID_XPATH", "NO_DEVICE", "OUT_OF_RANGE", "QUERY_ERROR",
          "TOO_MANY", "UNAUTHORIZED", "UNSUPPORTED"}


def local(tag):
    return tag.rsplit("}", 1)[-1]


def pascal(words):
    return "".join(word.capitalize() for word in words.split("_"))


class Document:
    """A document whose root and header are valid."""

    def __init__(self, text):
        self.root = ElementTree.fromstring(text)
        space, _, name = self.root.tag[1:].partition("}")
        self.kind = name.removeprefix("MTConnect")
        assert space == f"urn:mtconnect.org:{name}:{VERSION}", self.root.tag
        self.space = "{" + space + "}"
        header = self.root[0]
        assert header.tag == self.space + "Header"
        required = HEADER[self.kind] | {"version", "creationTime", "instanceId", "sender"}
        assert required <= set(header.attrib), required - set(header.attrib)
        assert header.get("version").startswith(VERSION + ".")
        assert TIME.match(header.get("creationTime"))
        self.header = {key: int(value) for key, value in header.attrib.items() if re.fullmatch(r"\d+", value)}

    def all(self, name):
        return self.root.iter(self.space + name)


class Devices(Document):
    """Checks probe; `items` has the attributes of each data item, with its component."""

    def __init__(self, text):
        super().__init__(text)
        assert self.kind == "Devices"
        self.items, ids = {}, set()
        device, = self.root[1]
        assert {"id", "name", "uuid"} <= set(device.attrib)
        for element in self.root.iter():
            if "id" in element.attrib:
                assert re.fullmatch(r"[A-Za-z_][\w.-]*", element.get("id")), element.get("id")
                assert element.get("id") not in ids, element.get("id")
                ids.add(element.get("id"))
        self.component(device)
        types = {item["type"] for item in self.items.values()}
        assert {"AVAILABILITY", "ASSET_CHANGED", "ASSET_REMOVED"} <= types  # required of a device since 1.2 and 1.3

    def component(self, element):
        order = [local(child.tag) for child in element]
        expected = [name for name in ("Description", "Configuration", "DataItems", "Compositions", "Components") if name in order]
        assert order == expected, order
        for child in element:
            if local(child.tag) == "DataItems":
                for item in child:
                    self.item(item, element)
            if local(child.tag) == "Components":
                for inner in child:
                    assert {"id"} <= set(inner.attrib)
                    self.component(inner)

    def item(self, item, component):
        assert item.tag == self.space + "DataItem"
        a = item.attrib
        assert {"id", "type", "category"} <= set(a)
        assert set(a) <= {"id", "name", "type", "subType", "statistic", "units", "category", "representation", "coordinateSystem"}, a
        assert a["category"] in CATEGORIES
        assert ("units" in a) == (a["category"] == "SAMPLE"), a
        assert a.get("representation", "VALUE") in ("VALUE", "DATA_SET")
        assert re.fullmatch(r"[A-Z_]+|[a-ln-z][a-z]*:[A-Z_0-9]+", a["type"])
        self.items[a["id"]] = {**a, "component": component.get("id"), "element": local(component.tag)}


class Streams(Document):
    """Checks current and sample; `observations` is a list of dictionaries in the order of their sequence numbers."""

    def __init__(self, text, devices):
        super().__init__(text)
        assert self.kind == "Streams"
        self.devices = devices
        self.observations = []
        stream, = self.root[1]
        assert stream.tag == self.space + "DeviceStream" and {"name", "uuid"} <= set(stream.attrib)
        for component in stream:
            assert component.tag == self.space + "ComponentStream" and {"component", "componentId"} <= set(component.attrib)
            order = [local(part.tag) for part in component]
            assert order == [name for name in CATEGORIES.values() if name in order], order
            for part in component:
                assert len(part) > 0
                for element in part:
                    self.observation(element, part, component)
        self.observations.sort(key=lambda o: o["sequence"])
        sequences = [o["sequence"] for o in self.observations]
        assert len(set(sequences)) == len(sequences)

    def observation(self, element, part, component):
        a = element.attrib
        assert {"dataItemId", "timestamp", "sequence"} <= set(a), a
        item = self.devices.items[a["dataItemId"]]
        assert TIME.match(a["timestamp"]), a
        assert CATEGORIES[item["category"]] == local(part.tag)
        assert item["component"] == component.get("componentId") and item["element"] == component.get("component")
        assert a.get("subType") == item.get("subType") and a.get("name") == item.get("name")
        value = element.text or ""
        if item["category"] == "CONDITION":
            assert element.tag in [self.space + level for level in LEVELS] and a["type"] == item["type"]
            value = [local(element.tag), a.get("nativeCode", ""), value]
        else:
            prefix, _, words = item["type"].rpartition(":")
            space = "{" + EXTENSION + "}" if prefix else self.space
            is_set = item.get("representation") == "DATA_SET"
            assert element.tag == space + pascal(words) + ("DataSet" if is_set else ""), element.tag
            if is_set:
                assert int(a["count"]) == len(element)
                if value != "UNAVAILABLE":
                    assert all(entry.tag == self.space + "Entry" for entry in element)
                    value = {entry.get("key"): float(entry.text) for entry in element}
            elif item["category"] == "SAMPLE":
                assert a.get("statistic") == item.get("statistic")
                assert value == "UNAVAILABLE" or float(value) == float(value)
        self.observations.append({"id": a["dataItemId"], "sequence": int(a["sequence"]), "time": a["timestamp"], "value": value})

    def values(self):
        """The last value of each item; of a condition all entries."""
        found = {}
        for o in self.observations:
            if self.devices.items[o["id"]]["category"] == "CONDITION":
                found.setdefault(o["id"], []).append(o["value"])
            else:
                found[o["id"]] = o["value"]
        return found


def assets(text):
    """Checks an assets document. @return {id: {"type", labels, "quantities": {name: (value, std or None)}, "groups": [quantities]}}"""
    document = Document(text)
    assert document.kind == "Assets"
    space = "{" + EXTENSION + "}"

    def quantities(element):
        return {q.get("name"): (float(q.text), float(q.get("standardDeviation")) if "standardDeviation" in q.attrib else None)
                for q in element.findall(space + "Quantity")}

    found = {}
    for asset in document.root[1]:
        assert asset.tag.startswith(space) and {"assetId", "timestamp", "deviceUuid"} <= set(asset.attrib)
        assert TIME.match(asset.get("timestamp"))
        labels = {local(c.tag).lower(): c.text for c in asset if local(c.tag) not in ("Quantity", "Group")}
        found[asset.get("assetId")] = {"type": local(asset.tag), **labels, "quantities": quantities(asset),
                                       "groups": [quantities(group) for group in asset.findall(space + "Group")]}
    return found


def error(text):
    document = Document(text)
    assert document.kind == "Error"
    errors = list(document.all("Error"))
    assert errors and all(e.get("errorCode") in ERRORS and e.text for e in errors)
    return errors[0].get("errorCode")


class Client:
    def __init__(self, port):
        self.base = f"http://127.0.0.1:{port}"
        self.devices = Devices(self.get("/probe"))

    def get(self, target, method="GET"):
        with urllib.request.urlopen(urllib.request.Request(self.base + target, method=method), timeout=30) as answer:
            assert answer.headers["Content-Type"].startswith("text/xml") or method == "HEAD"
            return answer.read()

    def refused(self, target, method="GET"):
        """(status, error code) of a request that is refused."""
        try:
            self.get(target, method)
        except urllib.error.HTTPError as failure:
            return failure.code, error(failure.read())
        raise AssertionError(target + " was answered")

    def current(self, query=""):
        return Streams(self.get("/current" + query), self.devices)

    def sample(self, query):
        return Streams(self.get("/sample" + query), self.devices)

    def stream(self, target):
        """Documents of a streaming request, until the agent or the caller ends it."""
        with urllib.request.urlopen(self.base + target, timeout=30) as answer:
            kind, _, boundary = answer.headers["Content-Type"].partition(";boundary=")
            assert kind == "multipart/mixed" and boundary
            while True:
                line = answer.readline().strip()
                if line in (b"", b"--" + boundary.encode() + b"--"):
                    if line:
                        return
                    continue
                assert line == b"--" + boundary.encode(), line
                head = {}
                while True:
                    line = answer.readline().strip().decode()
                    if not line:
                        break
                    key, _, value = line.partition(":")
                    head[key.lower()] = value.strip()
                assert head["content-type"] == "text/xml"
                yield Streams(answer.read(int(head["content-length"])), self.devices)


class Shdr:
    """Reads an SHDR adapter as an agent does."""

    def __init__(self, port):
        self.socket = socket.create_connection(("127.0.0.1", port), timeout=30)
        self.file = self.socket.makefile("r", encoding="utf-8", newline="\n")
        self.values, self.history, self.assets, self.pongs = {}, {}, {}, []

    def ping(self):
        self.socket.sendall(b"* PING\n")

    def step(self):
        """Reads one line, or one asset."""
        line = self.file.readline()
        assert line, "the adapter has closed the connection"
        line = line.rstrip("\n")
        if line.startswith("* PONG "):
            self.pongs.append(int(line[7:]))
        if line.startswith("*"):
            return
        time, item, *rest = line.split("|")
        assert TIME.match(time), line
        if item == "@ASSET@":
            name, kind, tag = rest
            assert tag.startswith("--multiline--")
            body = ""
            while (part := self.file.readline()) != tag + "\n":
                assert part
                body += part
            element = ElementTree.fromstring(body)
            assert element.get("assetId") == name and local(element.tag) == kind
            self.assets[name] = element
            return
        if len(rest) == 5:  # condition
            level, code, _, _, text = rest
            active = self.values.setdefault(item, {})
            if level in ("UNAVAILABLE", "normal") and not code:
                active.clear()
            if level == "normal":
                active.pop(code, None)
            elif level != "UNAVAILABLE":
                active[code] = (level, text)
            return
        value, = rest
        self.values[item] = value
        self.history.setdefault(item, []).append(value)
