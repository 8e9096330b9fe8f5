#!/usr/bin/env python3
"""Runs exchange_node with topics of known values and reads what it sends with clients of other hands: urllib and xml.etree for the agent, a
socket for the adapter, python3-paho-mqtt for a broker (mosquitto), node-opcua-client (npm) for OPC UA.

usage: node_test.py NODE OUT: writes OUT/results.json, {case: failure, "skipped: REASON" or ""}, and prints the latency from topic to item."""
import json
import math
import os
import pathlib
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
import traceback

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "clients"))
from mtconnect import Client, Shdr, assets  # noqa: E402

NODE, OUT = sys.argv[1:3]
PATIENCE = 60.0  # [s] a test that waits longer has failed


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


def becomes(read, expected):
    end = time.time() + PATIENCE
    while (found := read()) != expected and time.time() < end:
        time.sleep(0.05)
    assert found == expected, f"{found!r}, expected {expected!r}"


def digits(value):
    """As every protocol prints a number."""
    return f"{value:.9g}"


class Bench:
    def __init__(self):
        self.results = {}
        self.log = open(OUT + "/log.txt", "w")
        self.agent, self.adapter, self.broker, master = free_port(), free_port(), free_port(), free_port()
        os.environ.update(ROS_MASTER_URI=f"http://localhost:{master}", ROS_HOSTNAME="localhost", ROS_HOME=OUT)
        self.processes = [subprocess.Popen(["rosmaster", "--core", "-p", str(master)], stdout=self.log, stderr=self.log)]
        self.missing = ""
        mosquitto = shutil.which("mosquitto", path=os.environ["PATH"] + ":/usr/sbin")
        try:
            import paho.mqtt.client  # noqa: F401
        except ImportError:
            self.missing = "skipped: python3-paho-mqtt is not installed"
        if not mosquitto:
            self.missing = "skipped: mosquitto is not installed"
        if not self.missing:
            with open(OUT + "/mosquitto.conf", "w") as f:
                f.write(f"listener {self.broker} 127.0.0.1\nallow_anonymous true\n")
            self.processes.append(subprocess.Popen([mosquitto, "-c", OUT + "/mosquitto.conf"], stdout=self.log, stderr=self.log))

    def start(self):
        parameters = {"agent_port": self.agent, "adapter_port": self.adapter, "device": "mill", "input_timeout": 2.0, "sample_period": 0.0}
        if not self.missing:
            parameters |= {"mqtt_broker": f"mqtt://127.0.0.1:{self.broker}", "mqtt_prefix": "mill"}
        self.node = subprocess.Popen([NODE, "__ns:=/smartmill", "__name:=exchange"] + [f"_{k}:={v}" for k, v in parameters.items()],
                                     stdout=self.log, stderr=self.log)
        self.processes.append(self.node)
        end = time.time() + PATIENCE
        while True:
            try:
                return Client(self.agent)
            except OSError:
                assert time.time() < end and self.node.poll() is None, "the node did not start"
                time.sleep(0.05)

    def mqtt(self):
        """The last payload of each topic, kept up to date."""
        import paho.mqtt.client
        found = {}
        client = paho.mqtt.client.Client()
        client.on_connect = lambda c, *rest: c.subscribe("mill/#", qos=1)
        client.on_message = lambda c, data, m: found.__setitem__(m.topic.removeprefix("mill/"), m.payload.decode())
        client.connect("127.0.0.1", self.broker)
        client.loop_start()
        return found

    def stop(self):
        for process in reversed(self.processes):
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
        for process in self.processes:
            process.wait()

    def case(self, work, *arguments):
        name = "".join(word.capitalize() for word in work.__name__.split("_"))
        try:
            self.results[name] = work(*arguments) or ""
        except Exception:
            self.results[name] = traceback.format_exc()
            print(name, self.results[name], flush=True)


class Machine:
    """Publishers of the topics of a machine."""

    def __init__(self):
        import rospy
        from smartmill_msgs import msg
        self.rospy, self.msg, self.publishers = rospy, msg, {}
        rospy.init_node("machine", anonymous=True, disable_signals=True)

    def publish(self, topic, message, stamp=None):
        if topic not in self.publishers:
            self.publishers[topic] = self.rospy.Publisher("/smartmill/" + topic, type(message), queue_size=1000, latch=True)
            end = time.time() + PATIENCE
            while self.publishers[topic].get_num_connections() == 0 and time.time() < end:
                time.sleep(0.01)
        message.header.stamp = stamp or self.rospy.Time.now()
        self.publishers[topic].publish(message)
        return message

    def state(self, **fields):
        fields = {"connected": True, "mode": 10, "run": 3, "program": 4711, "sequence": 120, "axes": ["X", "Y", "Z"],
                  "position": [0.123456789012, -0.05, 1 / 3], "distance_to_go": [0.0] * 3, "spindle_speed": 621.17, "feed": 0.0123} | fields
        return self.publish("cnc/state", self.msg.CncState(**fields))


def values_are_the_topics(bench, machine, client, shdr, broker):
    m = machine.msg
    state = machine.state()
    machine.publish("cnc/load", m.LoadSample(spindle_load=0.4567, axes=["X", "Y", "Z"], axis_load=[0.1, 0.2, 0.3]))
    machine.publish("cnc/alarms", m.CncAlarms(alarms=[m.CncAlarm(number=417, axis=2, text="SERVO <ALARM> & more")]))
    machine.publish("cut/condition", m.CuttingCondition(kind=2, name="slot_7", material="al7050", tool="end_mill", teeth=2, axial_depth=1.5e-3,
                                                        exit_angle=math.pi))
    machine.publish("machine/temperature", m.MachineTemperature(spindle_motor=312.4))
    estimate = m.ForceEstimate(cut="slot_7", torque=3.25, torque_std=0.125)
    estimate.mean.x, estimate.mean_std.x = 211.7, 3.25
    machine.publish("force/estimate", estimate)
    machine.publish("chatter/state", m.ChatterState(condition="slot_7", valid=True, chatter=True, frequency=843.21, energy_ratio=0.3, severity=17.5))
    expected = {"execution": "ACTIVE", "mode": "AUTOMATIC", "program": "4711", "line": "120", "feed": digits(1e3 * state.feed),
                "spindle_speed": digits(state.spindle_speed * 60 / (2 * math.pi)), "x_position": digits(1e3 * state.position[0]),
                "y_position": "-50", "z_position": digits(1e3 * state.position[2]), "spindle_load": digits(100 * 0.4567),
                "z_load": "30", "cut": "slot_7", "tool": "end_mill", "material": "al7050", "spindle_temperature": digits(312.4 - 273.15),
                "force_mean_x": "211.7", "force_mean_x_std": "3.25", "cutting_torque": "3.25", "cutting_torque_std": "0.125",
                "chatter_frequency": "843.21", "chatter_energy": "30", "chatter_force": "17.5"}
    conditions = {"alarms": [["Fault", "417.2", "SERVO <ALARM> & more"]], "chatter": [["Fault", "CHATTER", "slot_7 chatters at 843 Hz"]],
                  "connection": [["Normal", "", ""]]}
    becomes(lambda: {k: v for k, v in client.current().values().items() if k in expected}, expected)
    becomes(lambda: {k: v for k, v in client.current().values().items() if k in conditions}, conditions)
    while any(shdr.values.get(k) != v for k, v in expected.items()) or "417.2" not in shdr.values["alarms"] or "CHATTER" not in shdr.values["chatter"]:
        shdr.step()
    assert shdr.values["alarms"] == {"417.2": ("fault", "SERVO <ALARM> & more")}, shdr.values["alarms"]
    if broker is None:
        return
    text = lambda value: digits(value) if isinstance(value, (int, float)) else value  # noqa: E731
    becomes(lambda: {k: text(json.loads(broker["items/" + k])["value"]) for k in expected if "items/" + k in broker}, expected)
    becomes(lambda: json.loads(broker["items/alarms"])["value"], [{"level": "fault", "code": "417.2", "text": "SERVO <ALARM> & more"}])


def assets_have_their_deviations(bench, machine, client, shdr, broker):
    m = machine.msg
    machine.publish("material/coefficients", m.CuttingCoefficients(
        tool="end_mill", material="al7050", ktc=796.4e6, ktc_std=4.2e6, krc=math.nan, kac=math.nan, kte=27.7e3, kte_std=math.nan, kre=math.nan,
        kae=math.nan, friction_coulomb=0.31, friction_viscous=0.0011, source="load_meter", test_count=8))
    machine.publish("tool/modes", m.ModalModel(tool="end_mill", point="tool_tip", direction="x", unit="m/N", direct=1e-9, direct_std=math.nan, modes=[
        m.Mode(frequency=930.5, damping_ratio=0.021, gain=1.5e-7, frequency_std=0.4, damping_ratio_std=4e-4, gain_std=2e-9)]))
    names = {"coefficients.end_mill.al7050", "modes.end_mill.tool_tip.x"}
    becomes(lambda: set(assets(client.get("/assets"))), names)
    found = assets(client.get("/assets"))
    assert found["coefficients.end_mill.al7050"]["quantities"] == {
        "ktc": (796.4e6, 4.2e6), "kte": (27.7e3, None), "friction_coulomb": (0.31, None), "friction_viscous": (0.0011, None)}, found
    assert found["modes.end_mill.tool_tip.x"]["groups"] == [
        {"frequency": (930.5, 0.4), "damping_ratio": (0.021, 4e-4), "gain": (1.5e-7, 2e-9)}], found
    becomes(lambda: client.current().values()["asset_changed"], "modes.end_mill.tool_tip.x")
    while set(shdr.assets) != names:
        shdr.step()
    speed = machine.state().spindle_speed
    becomes(lambda: client.current().values()["spindle_friction"], digits(0.31 + 0.0011 * speed))
    if broker is not None:
        becomes(lambda: {k.removeprefix("assets/") for k in broker if k.startswith("assets/")}, names)
        assert json.loads(broker["assets/coefficients.end_mill.al7050"])["quantities"]["ktc"] == {"value": 796.4e6, "units": "N/m2", "std": 4.2e6}


def a_stream_has_every_value_of_the_topic(bench, machine, client, shdr, broker):
    """400 states at 100 Hz with a ramp, and a rotating compensated force of 100 N; the client reads the stream meanwhile."""
    start = client.current().header["nextSequence"]
    arrived, stop = {}, threading.Event()

    def read():
        for document in client.stream(f"/sample?from={start}&interval=0&count=1000&heartbeat=500"):
            now = time.time()
            for o in document.observations:
                arrived.setdefault(o["id"], []).append((o["time"], o["value"], now))
            if stop.is_set():
                return

    reader = threading.Thread(target=read)
    reader.start()
    m, sent, speed, rate, index = machine.msg, [], 2 * math.pi * 50, 10000.0, 0
    begin, first = time.time(), machine.rospy.Time.now()
    for k in range(400):
        message = machine.state(feed=1e-3 + 1e-5 * math.sin(k) + 1e-6 * k, spindle_speed=speed)
        sent.append((message.header.stamp, message.feed, time.time()))
        stamp = first + machine.rospy.Duration.from_sec(0.01 * k)  # blocks without gaps, however late this loop is
        machine.publish("spindle/angle", m.SpindleAngle(angle=(speed * stamp.to_sec()) % (2 * math.pi), speed=speed), stamp)
        angles = [speed * (stamp.to_sec() + i / rate) for i in range(100)]
        machine.publish("force/compensated", m.ForceBlock(
            sample_rate=rate, first_index=index, status=1, fx=[100 * math.cos(a) for a in angles], fy=[100 * math.sin(a) for a in angles],
            fz=[-20.0] * 100), stamp)
        index += 100
        time.sleep(max(0.0, begin + 0.01 * (k + 1) - time.time()))
    # A pause of a busy computer makes topics unavailable meanwhile.
    values = lambda: [o for o in arrived.get("feed", []) if o[1] != "UNAVAILABLE"]  # noqa: E731
    becomes(lambda: len(values()) >= 400, True)
    stop.set()
    reader.join()
    feed = values()[-400:]
    for (stamp, value, _), (time_text, found, _) in zip(sent, feed):
        micro = round(stamp.to_nsec() / 1000) % 1000000
        assert abs(int(time_text[-7:-1]) - micro) <= 1, (time_text, stamp)
        assert found == digits(1e3 * value), (found, value)
    peaks = [float(v) for _, v, _ in arrived["force_peak"] if v != "UNAVAILABLE"]
    rms = [float(v) for _, v, _ in arrived["force_rms_x"] if v != "UNAVAILABLE"]
    assert peaks and all(abs(p - 100) < 1e-6 for p in peaks), peaks
    assert rms and all(abs(r - 100 / math.sqrt(2)) < 0.5 for r in rms), rms  # a revolution of 200 samples may have one more or less
    latency = sorted(1e3 * (now - t) for (_, _, t), (_, _, now) in zip(sent, feed))
    print(f"latency from topic to item, {len(latency)} values at 100 Hz: median {latency[len(latency) // 2]:.1f} ms, 99 % {latency[-4]:.1f} ms, "
          f"largest {latency[-1]:.1f} ms", flush=True)


def silent_topics_become_unavailable(bench, machine, client, shdr, broker):
    becomes(lambda: client.current().values()["feed"], "UNAVAILABLE")
    values = client.current().values()
    assert values["availability"] == values["force_peak"] == "UNAVAILABLE" and values["tool"] == "end_mill", values
    machine.state()
    becomes(lambda: client.current().values()["availability"], "AVAILABLE")


def nothing_from_outside_reaches_the_graph(bench, machine, client, shdr, broker):
    import rosgraph
    publishers, _, services = rosgraph.Master("/test").getSystemState()
    topics = {topic for topic, nodes in publishers if "/smartmill/exchange" in nodes}
    assert topics == {"/rosout", "/diagnostics", "/smartmill/health"}, topics
    offered = {service for service, nodes in services if "/smartmill/exchange" in nodes}
    assert all(s.rsplit("/", 1)[1] in ("follow", "get_loggers", "set_logger_level") for s in offered), offered
    for method in ("POST", "PUT", "DELETE"):
        assert client.refused("/current", method) == (405, "UNSUPPORTED")


def opc_ua_has_the_values_of_the_topics(bench, machine, client, shdr, broker):
    """A second node, since not every build has OPC UA."""
    port = free_port()
    node = subprocess.Popen([NODE, "__ns:=/smartmill", "__name:=opcua", "_agent:=false", "_adapter:=false", f"_opcua_port:={port}", "_sample_period:=0.0",
                             "_input_timeout:=60.0"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    bench.processes.append(node)
    line = ""
    while "OPC UA" not in line:
        line = node.stdout.readline()
        assert line, "the node ended"
    if "this build has no OPC UA" in line:
        return "skipped: open62541 is not installed"
    if subprocess.run(["node", "-e", "require('node-opcua-client')"], capture_output=True).returncode != 0:
        return "skipped: node-opcua-client is not installed"
    assert line.strip() == f"exchange: OPC UA at opc.tcp://127.0.0.1:{port}", line

    def read():
        script = pathlib.Path(__file__).resolve().parent.parent / "clients/opcua.js"
        return json.loads(subprocess.run(["node", script, str(port)], capture_output=True, text=True, check=True, timeout=PATIENCE).stdout)

    for topic in ("cnc/state", "cnc/load", "cnc/alarms", "cut/condition", "machine/temperature", "chatter/state", "material/coefficients"):
        end = time.time() + PATIENCE
        while machine.publishers[topic].get_num_connections() < 2 and time.time() < end:
            time.sleep(0.01)
    state = machine.state(feed=0.0321)  # a value that is not repeated keeps its time
    expected = {"feed": 1e3 * state.feed, "x_position": 1e3 * state.position[0], "execution": "ACTIVE", "tool": "end_mill", "chatter_frequency": 843.21,
                "alarms": ["fault 417.2: SERVO <ALARM> & more"], "connection": []}
    becomes(lambda: {k: v["value"] for k, v in read().items() if k in expected}, expected)
    found = read()
    assert abs(found["feed"]["time"] - state.header.stamp.to_nsec() / 1000) <= 1, (found["feed"], state.header.stamp)
    assert found["feed"]["units"] == "mm/s" and found["force_peak"]["status"] == "BadNoCommunication", found
    ktc = "assets/coefficients.end_mill.al7050/ktc"
    assert (found[ktc]["value"], found[ktc + "/StandardDeviation"]["value"], found[ktc]["units"]) == (796.4e6, 4.2e6, "N/m2"), found


def a_killed_node_leaves_its_last_will(bench, machine, client, shdr, broker):
    bench.node.kill()
    bench.node.wait()
    if broker is None:
        return bench.missing
    becomes(lambda: broker["status"], "offline")


def a_remote_broker_without_tls_is_refused(bench):
    found = subprocess.run([NODE, "__ns:=/smartmill", "__name:=refused", "_agent:=false", "_adapter:=false", "_mqtt_broker:=mqtt://192.0.2.1:1883"],
                           capture_output=True, text=True, timeout=PATIENCE)
    assert found.returncode == 1 and "expected TLS" in found.stdout + found.stderr, found


def main():
    bench = Bench()
    try:
        machine = Machine()
        client = bench.start()
        parts = (bench, machine, client, Shdr(bench.adapter), None if bench.missing else bench.mqtt())
        for case in (values_are_the_topics, assets_have_their_deviations, a_stream_has_every_value_of_the_topic, silent_topics_become_unavailable,
                     nothing_from_outside_reaches_the_graph, opc_ua_has_the_values_of_the_topics, a_killed_node_leaves_its_last_will):
            bench.case(case, *parts)
        bench.case(a_remote_broker_without_tls_is_refused, bench)
    finally:
        bench.stop()
        with open(OUT + "/results.json", "w") as out:
            json.dump(bench.results, out, indent=1)


main()
