#!/usr/bin/env python3
"""Tests the page in a real browser with a panel node and the topics of a simulated machine, so that each value is known.
usage: page_test.py NODE PAGE OUT: writes OUT/results.json, {case: failure or ""}, and screenshots in each size."""
import calendar
import json
import math
import os
import signal
import subprocess
import sys
import threading
import time
import traceback
import urllib.error
import urllib.request

from browser import PATIENCE, Browser, free_port

NODE, PAGE, OUT = sys.argv[1:4]
TOKEN = "a token that is long enough"
SIZES = {"1280x800": (1280, 800), "1920x1080": (1920, 1080), "phone": (390, 844)}
VIEWS = ["overview", "forces", "part", "stability", "dynamics", "session", "model", "instruments", "fleet", "health"]
LOSS_TIMEOUT = 2.0  # [s] in which the page must report a lost node


class Machine:
    """Topics of a machine in a cut, ten times a second."""

    def __init__(self):
        import rospy
        from diagnostic_msgs.msg import DiagnosticArray
        from smartmill_msgs import msg
        self.rospy, self.msg, self.publishers, self.silent = rospy, msg, {}, False
        rospy.init_node("machine", anonymous=True, disable_signals=True)
        self.index = 0
        self.last = {}
        self.others = []  # (publisher, state) of other machines
        self.once()
        for topic, kind in (("goal", msg.MeasureFrfActionGoal), ("feedback", msg.MeasureFrfActionFeedback)):  # as an action's client and server
            name = "hammer/measure_frf/" + topic
            self.publishers[name] = rospy.Publisher("/smartmill/" + name, kind, queue_size=10)
        self.requests = []
        from smartmill_msgs.srv import FindCoefficients
        self.service = rospy.Service("/smartmill/loadmeter/find_coefficients", FindCoefficients, self.find)
        self.front_end, self.tried, self.calibrated, self.moved = True, [], [], []
        self.diagnostics_publisher = rospy.Publisher("/diagnostics", DiagnosticArray, queue_size=10)
        from smartmill_msgs.srv import ArmMotion, CalibrateChannel, SetSoundCut, TryInstrument
        self.cuts = []
        self.setup = [rospy.Service("/smartmill/daq/try_instrument", TryInstrument, self.try_instrument),
                      rospy.Service("/smartmill/daq/calibrate_channel", CalibrateChannel, self.calibrate),
                      rospy.Service("/smartmill/cnc/arm_motion", ArmMotion, self.moved.append),
                      rospy.Service("/smartmill/sound/set_cut", SetSoundCut, self.set_cut)]
        self.thread = threading.Thread(target=self.run, daemon=True)
        self.thread.start()

    def find(self, request):
        from smartmill_msgs.srv import FindCoefficientsResponse
        m, nan = self.msg, math.nan
        self.requests.append((request.tool, request.material))
        if request.material != "al7050":
            return FindCoefficientsResponse(code=1, message=f"no records for '{request.tool}' in '{request.material}'; known: end_mill / al7050",
                                            database="/data/mill.sqlite")
        found = m.CuttingCoefficients(tool="end_mill", material="al7050", ktc=796.4e6, krc=nan, kac=nan, kte=27.7e3, kre=nan, kae=nan, ktc_std=4.2e6,
                                      krc_std=nan, kac_std=nan, kte_std=800.0, kre_std=nan, kae_std=nan, source="load_meter", test_count=8)
        test = m.CuttingCondition(kind=2, spindle_speed=2 * math.pi * 100, feed_per_tooth=2e-4, axial_depth=1.5e-3, entry_angle=math.pi / 2,
                                  exit_angle=math.pi, teeth=3, helix=math.radians(40))
        return FindCoefficientsResponse(message="8 tests in 2 identifications", coefficients=found, of_pair=True, database="/data/mill.sqlite",
                                        identifications=2, production_cuts=5, cutting_speed=[1.0, 2.5], feed_per_tooth=[5e-5, 2e-4],
                                        axial_depth=[1e-3, 1e-3], edge_age=[nan, nan], next_test=test, next_std=[2.1e6, 400.0])

    def set_cut(self, request):
        """As sound_node: a number of teeth beyond the bounds is refused."""
        from smartmill_msgs.srv import SetSoundCutResponse as Response
        self.cuts.append(request)
        if request.spindle_speed > 5000.0:
            return Response(code=1, message="speed: 95493 rpm: expected 4000 to 18000 rpm, the range of the spindle")
        return Response(message="4 teeth, next cut at 9120 rpm")

    def sound(self, **changes):
        m, rad = self.msg, 2 * math.pi / 60
        heard = [m.SoundTry(kind=2, spindle_speed=8000 * rad, probability=0.99, frequency=1068.4, used=True, text="chatter (probability of chatter 99 %)"),
                 m.SoundTry(kind=3, spindle_speed=15920 * rad, probability=0.5, frequency=math.nan),
                 m.SoundTry(kind=2, spindle_speed=15920 * rad, probability=0.97, frequency=2210.2, used=True)]
        for k, one in enumerate(heard):
            one.begin = one.end = self.rospy.Time(100 * (k + 1))
        fields = dict(state=2, level=0.02, quiet_level=0.004, unit="1", clipped=0.0, teeth=4, spindle_speed=15920 * rad, speed_low=4000 * rad,
                      speed_high=18000 * rad, tries=heard, running=True, next_speed=[9120 * rad, 12210 * rad], next_stable=[0.356, 0.21],
                      text="chatter (probability of chatter 97 %) at 2210.2 Hz")
        self.publish("sound/advice", m.SoundAdvice(**{**fields, **changes}), latch=True)

    def try_instrument(self, request):
        """As setup_node: a wrong sensitivity is named, a file is written once."""
        from smartmill_msgs.srv import TryInstrumentResponse as Response
        self.tried.append(request)
        known = {"drivers": ["file", "tcp"], "option_driver": ["file", "tcp", "tcp"], "option_key": ["path", "host", "port"],
                 "option_meaning": ["measurement file", "name of the device", "TCP port"], "files": ["front_end"]}
        if "sensitivity: 0," in request.description:
            return Response(code=1, message="instrument: streams[0].channels[1].sensitivity: 0, expected volts per m/s2", **known)
        if request.file:
            return Response(message=f"stored in /instruments/{request.file}.yaml", path=f"/instruments/{request.file}.yaml", **known)
        if not request.description:
            return Response(**known)
        return Response(topic=["daq/vibration"] * 2, channel=["x", "c2"], unit=["m/s2", "V"], mean=[0.12, math.nan], rms=[9.87, math.nan], peak=[0.42, 1.0],
                        clipped=[0, 173], faulty=[False, True], samples=51200, drift=31e-6, drift_std=4e-6, jitter=210e-6, faults=["clipping: c2: clipped at 10 V"], **known)

    def calibrate(self, request):
        from smartmill_msgs.srv import CalibrateChannelResponse as Response
        self.calibrated.append(request)
        if request.method == Response.OK and request.exciter != 10.0:
            return Response(code=3, message="x: distortion 34 %")
        line = "x: 0.0104 +- 0.00016 V/(m/s2), so far 0.01 (+4.00 %), from 9 parts of the record"
        return Response(message=line + ("; stored, daq_node reads it at its next start" if request.method == 4 else ""), sensitivity=0.0104, parts=9)

    def diagnostics(self):
        """As daq_node with a clipped channel, and as the nodes that align streams and choose the source of the angle."""
        from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

        def status(name, level, message, **values):
            return DiagnosticStatus(name=name, level=level, message=message, values=[KeyValue(key, str(value)) for key, value in values.items()])

        def channel(name, level, message, clipped, peak, date):
            return status("smartmill/daq: channel daq/dynamometer/" + name, level, message, **{
                "unit": "N", "mean [N]": 12.3456, "rms [N]": 45.6, "peak [share of the range]": peak, "samples clipped": clipped, "sensitivity [V/N]": 0.0102,
                "standard deviation of the sensitivity": "5.0e-05", "date of the sensitivity": date})
        array = DiagnosticArray(status=[status("smartmill/panel: panel", 0, "serving")])
        array.header.stamp = self.rospy.Time.now()
        if self.front_end:
            array.status += [
                status("smartmill/daq: instrument front end", 0, "measuring", **{
                    "driver": "tcp", "sample rate [Hz]": 51200.0, "samples in blocks": 123456789, "samples lost": 512, "samples lost by the clock": 0,
                    "samples withheld": 0, "clock drift [ppm]": 30.02, "standard deviation of the drift [ppm]": 0.05, "clock offset [s]": -0.0012,
                    "standard deviation of the offset [s]": 2.1e-6, "jitter of the arrivals [s]": 310e-6, "latency [s]": 0.0125,
                    "standard deviation of the latency [s]": 3e-5, "last fault": "512 samples are missing"}),
                channel("fx", 0, "alive", 0, 0.42, "2026-09-14"), channel("fy", 2, "no measurement: clipped, stuck or without supply", 173, 1.0, "not stated"),
                status("smartmill/alignment: alignment daq/hammer/hammer to daq/dynamometer/fx", 0, "12.5 ms later, by taps", **{
                    "shift [s]": 0.0125, "standard deviation of the shift [s]": 3e-5}),
                status("smartmill/angle: spindle angle", 1, "pulses in place of encoder: no samples for 0.5 s")]
        self.diagnostics_publisher.publish(array)

    def publish(self, topic, message, latch=False):
        if topic not in self.publishers:
            self.publishers[topic] = self.rospy.Publisher("/smartmill/" + topic, type(message), queue_size=100, latch=latch)
        message.header.stamp = self.rospy.Time.now()
        self.last[topic] = message
        self.publishers[topic].publish(message)

    def once(self):
        m = self.msg
        self.publish("cut/condition", m.CuttingCondition(
            kind=2, name="slot_7", material="al7050", tool="end_mill", teeth=4, diameter=0.01905, helix=0.5236, spindle_speed=418.9,
            feed_per_tooth=1e-4, axial_depth=1.234e-3, entry_angle=0.0, exit_angle=math.pi), latch=True)
        self.sensor(calibrated=True)
        speeds = [200.0 + 6.0 * k for k in range(300)]
        limits = [math.inf if k == 150 else 1e-3 * (2.0 + math.sin(0.1 * k)) for k in range(300)]
        best = m.StabilityPoint(spindle_speed=1200.0, axial_depth=2.2e-3, depth_limit=2.9e-3, chatter_frequency=1234.5, torque=3.21, power=3852.0,
                                material_removal_rate=8.0e-6)
        self.publish("stability/chart", m.StabilityChart(
            tool="end_mill", material="al7050", method="zero_order", exit_angle=math.pi, feed_per_tooth=1e-4, spindle_speed=speeds,
            depth_limit=limits, chatter_frequency=[math.nan if math.isinf(x) else 1200.0 for x in limits],
            torque_depth_limit=[5e-3] * 300, power_depth_limit=[8.0 / s for s in speeds], absolute_depth_limit=1e-3, recommended=[best]), latch=True)
        f = [10.0 * k for k in range(300)]
        self.publish("tool/frf", m.Frf(tool="end_mill", point="tool_tip", direction="x", unit="m/N", averages=5, frequency=f,
                                       real=[1e-8 * math.cos(x / 500) for x in f], imag=[-1e-8] * 300, coherence=[0.99] * 300,
                                       standard_deviation=[math.nan] * 300), latch=True)
        mode = m.Mode(frequency=1210.0, damping_ratio=0.031, gain=1 / 28e6, frequency_std=0.3, damping_ratio_std=2e-4, gain_std=1e-10)
        self.publish("tool/modes", m.ModalModel(tool="end_mill", point="tool_tip", direction="x", unit="m/N", modes=[mode],
                                                direct_std=math.nan, relative_error=0.04), latch=True)
        nan = math.nan
        self.publish("material/coefficients", m.CuttingCoefficients(
            tool="end_mill", material="al7050", ktc=796.4e6, krc=nan, kac=nan, kte=27.7e3, kre=nan, kae=nan, ktc_std=4.2e6, krc_std=nan, kac_std=nan,
            kte_std=800.0, kre_std=nan, kae_std=nan, friction_viscous=nan, friction_coulomb=nan, source="load_meter", test_count=12), latch=True)
        self.tool(broken=False)
        steps = [m.SessionStep(name="connect", detail="all there", elapsed=1.5, state=1), m.SessionStep(name="slot test", elapsed=61.0)]
        self.publish("session/state", m.SessionState(tool="end_mill", material="al7050", running=True, steps=steps), latch=True)
        self.fleet()
        self.part()

    def part(self):
        """A slot (line 4), the way to the next pass in air (5), and that pass (6), predicted to chatter."""
        m, nan = self.msg, math.nan
        xs, ys = [-0.04, 0.0, 0.02, 0.02, -0.02], [0.05, 0.05, 0.05, 0.06, 0.06]
        place = [0.0]
        for k in range(1, len(xs)):
            place.append(place[-1] + math.hypot(xs[k] - xs[k - 1], ys[k] - ys[k - 1]))
        self.publish("program/path", m.ProgramPath(program="/parts/part.nc", place=place, x=xs, y=ys, z=[-0.1] * 5, line=[4, 4, 5, 6], kind=[2, 2, 1, 2],
                                                   peak_force=[200.0, 210.0, nan, 300.0], stability_margin=[1.8, 1.7, nan, 0.9]), latch=True)
        for line, begin, end, force, expected, margin, chatter in ((4, 0.0, 0.06, 205.0, 210.0, 1.7, nan), (5, 0.06, 0.07, 3.0, nan, nan, nan),
                                                                   (6, 0.07, 0.09, 420.0, 300.0, 0.9, 812.0)):
            self.publish("program/progress", m.ProgramProgress(
                program="/parts/part.nc", part=1, first_line=line, last_line=line, from_place=begin, to_place=end, peak_force=force, compensated=True,
                predicted_peak_force=expected, stability_margin=margin, judged=line != 5, chatter=line == 6, chatter_frequency=chatter))
            time.sleep(0.25)  # as program_node

    def fleet(self, reached=True, message="2 new of 2 sent to postgresql://mill_07@shop/fleet"):
        """A fleet of twelve machines: Ktc of mill 3 is 24 % larger, mill 7 is this one, mill 9 has never pushed."""
        m, nan = self.msg, math.nan
        pairs = [m.FleetPair(tool="end_mill", material="al7050", records=220, own=14, ktc=796.4e6, ktc_std=9.1e6),
                 m.FleetPair(tool="end_mill_16", material="1045 steel", records=85, own=0, ktc=1893e6, ktc_std=61e6)]
        machines = []
        for k in range(1, 13):
            odd = k == 3
            machines.append(m.FleetMachine(
                name=f"mill {k}", here=k == 7, member=k != 12, records=20 + k, knows=[18, 0 if k == 7 else 9 + k], silent=nan if k == 9 else 40.0 + 400.0 * k,
                behind=17 if k == 5 else 0, effect=nan if k == 9 else 0.215 if odd else 0.012 * math.sin(k), effect_std=nan if k == 9 else 0.009,
                odd=nan if k == 9 else 0.981 if odd else 0.004, meaning="the same in all cuts: a wrong load-meter constant" if odd else ""))
        self.publish("loadmeter/fleet", m.FleetState(
            server="postgresql://mill_07@shop/fleet", reached=reached, message=message, behind=0 if reached else 3, between_machines=0.021,
            between_batches=0.008, between_tools=0.09, between_cuts=0.015, pairs=pairs, machines=machines), latch=True)

    def tool(self, broken):
        nan = math.nan
        self.publish("tool/condition", self.msg.ToolCondition(
            condition="slot_7", tool="end_mill", teeth=4, broken=broken, tooth=3 if broken else 0, revolutions=1.0 if broken else nan, loss=0.93 if broken else nan,
            loss_std=0.04 if broken else nan, log_likelihood_ratio=60.0 if broken else nan, wear=12.4, wear_std=1.6, edge_wear=nan, edge_wear_std=nan,
            feed_per_tooth=1e-4), latch=True)

    def sensor(self, calibrated):
        from geometry_msgs.msg import Vector3
        self.publish("force/sensor", self.msg.ForceSensorState(
            sensor="spindle", calibrated=calibrated, message="36 measurements at 3 lengths" if calibrated else "not calibrated: weights are missing",
            constant=Vector3(18.0, 18.2, 62.0), constant_std=Vector3(0.04, 0.05, 0.3), error=Vector3(0.002, 0.003, math.nan)), latch=True)

    def run(self):
        while not self.rospy.is_shutdown():
            if not self.silent:
                self.tick()
            time.sleep(0.1)

    def tick(self):
        m = self.msg
        for publisher, state in list(self.others):
            state.header.stamp = self.rospy.Time.now()
            publisher.publish(state)
        self.publish("cnc/state", m.CncState(connected=True, armed=True, mode=10, run=3, axes=["x", "y", "z"], position=[-0.0123456, 0.05, -0.1],
                                             distance_to_go=[0.001, 0.0, 0.0], spindle_speed=418.87902, feed=0.0123))
        self.publish("cnc/load", m.LoadSample(spindle_load=0.4567, spindle_speed=418.87902, axes=["x"], axis_load=[0.12]))
        self.publish("chatter/state", m.ChatterState(condition="slot_7", valid=True, chatter=True, frequency=1203.4, energy_ratio=0.4, severity=85.2))
        self.publish("discrepancy/state", m.DiscrepancyState(condition="slot_7", channels=["fx", "fy"], gap=[1.04, 3.21], model_fits=False))
        self.publish("spindle/angle", m.SpindleAngle(angle=(41.887902 * self.index) % (2 * math.pi), speed=418.87902))
        n, rate = 2560, 25600.0
        first = self.index * n
        fx = [100.0 + 40.0 * math.sin(2 * math.pi * 300.0 * (first + i) / rate) for i in range(n)]
        for topic, status in (("force/measured", 0), ("force/compensated", 1)):
            self.publish(topic, m.ForceBlock(sample_rate=rate, first_index=first, fx=fx, fy=fx, fz=[0.0] * n, status=status))
        self.diagnostics()
        self.health()
        self.index += 1

    def health(self):
        """Of a node that was restarted and has lost messages of one input, which is stuck."""
        m = self.msg
        force = m.StreamHealth(topic="/smartmill/daq/dynamometer", publishers=1, received=2 ** 53 + 12, lost=3, processed=2 ** 53, waiting=5, dropped=4,
                               refused=3, lost_samples=256, silent=0.01, latency=0.0123, fault="channel fx repeats one value")
        angle = m.StreamHealth(topic="/smartmill/spindle/angle")
        self.publish("health", m.NodeHealth(node="/smartmill/kalman", started=time.time() - 600, starts=3, cpu=0.214, memory=48.4e6, descriptors=31, threads=9,
                                            inputs=[force, angle]))


class Bench:
    def __init__(self):
        self.port, self.failed, self.pids = free_port(), {}, []
        self.log = open(OUT + "/log.txt", "w")
        self.token_file = OUT + "/token"
        with open(os.open(self.token_file, os.O_CREAT | os.O_WRONLY | os.O_TRUNC, 0o600), "w") as f:
            f.write(TOKEN)
        master = free_port()
        os.environ.update(ROS_MASTER_URI=f"http://localhost:{master}", ROS_HOSTNAME="localhost", ROS_HOME=OUT)
        self.core = subprocess.Popen(["rosmaster", "--core", "-p", str(master)], stdout=self.log, stderr=self.log)
        self.node, self.others = None, []
        self.address = f"http://127.0.0.1:{self.port}/"

    def start_node(self, namespace="/smartmill", name="SmartMill"):
        port = self.port if namespace == "/smartmill" else free_port()
        parameters = {"page": PAGE, "port": port, "allow_commands": "true", "token_file": self.token_file}
        arguments = [f"_{key}:={value}" for key, value in parameters.items()] + ["_name:=" + name]
        node = subprocess.Popen([NODE, "__ns:=" + namespace, "__name:=panel"] + arguments, stdout=self.log, stderr=self.log)
        if namespace == "/smartmill":
            self.node = node
        else:
            self.others.append(node)
        end = time.time() + 60
        while True:
            try:
                urllib.request.urlopen(f"http://127.0.0.1:{port}/", timeout=5).read()
                return port
            except OSError:
                if time.time() > end or node.poll() is not None:
                    raise
                time.sleep(0.1)

    def start_first_node(self):
        """Another program may take the port before the node has it."""
        for attempts_left in (2, 1, 0):
            try:
                return self.start_node()
            except OSError:
                if self.node.poll() is None or attempts_left == 0:
                    raise
                self.port = free_port()
                self.address = f"http://127.0.0.1:{self.port}/"

    def stop(self):
        processes = [p for p in [self.node, *self.others, self.core] if p]
        for process in processes:
            process.send_signal(signal.SIGINT)
        for process in processes:
            process.wait()

    def case(self, work, *args):
        name = "".join(word.capitalize() for word in work.__name__.split("_"))
        try:
            work(*args)
            self.failed[name] = ""
        except Exception:
            self.failed[name] = traceback.format_exc()
            print(name, self.failed[name], flush=True)  # before the other cases, in case of a timeout


def equal(found, expected):
    assert found == expected, f"{found!r}, expected {expected!r}"


def becomes(read, expected):
    """Waits for a value."""
    end = time.time() + PATIENCE
    while read() != expected and time.time() < end:
        time.sleep(0.05)
    equal(read(), expected)


def tile(browser, what):
    return browser.js("[...document.querySelectorAll('.tile')].find(t => t.querySelector('.what').textContent.startsWith(arguments[0]))"
                      ".querySelector('.value').textContent", what)


def values_are_the_topics(browser, machine):
    browser.wait("document.querySelector('.tile.bad')")
    becomes(lambda: tile(browser, "Spindle [rpm]"), "4000")
    becomes(lambda: tile(browser, "Spindle load"), "45.7")
    becomes(lambda: tile(browser, "Feed"), "738")
    becomes(lambda: tile(browser, "Cut"), "CHATTER")
    becomes(lambda: tile(browser, "Tool"), "12 %")
    machine.tool(broken=True)
    becomes(lambda: tile(browser, "Tool"), "Tooth 3 lost")
    machine.tool(broken=False)
    becomes(lambda: "1203 Hz, 85 N" in browser.text(".tile.lamp .more"), True)
    becomes(lambda: browser.js("[...document.querySelectorAll('.axes b')].map(e => e.textContent)"), ["-12.346", "50.000", "-100.000"])
    for word in ("Connected", "Armed", "DNC", "running", "no alarm", "Chatter"):
        becomes(lambda: word in browser.text("#status"), True)
    row = "[...document.querySelectorAll('#points tbody td')].map(e => e.textContent)"
    browser.wait("document.querySelector('#points td')")
    becomes(lambda: browser.js(row), ["11459", "2.200", "2.90", "1235", "3.21", "3.85", "480.0"])
    becomes(lambda: browser.js("[...document.querySelectorAll('#coefficients td')].map(e => e.textContent)"),
          ["Ktc", "796 ± 4", "N/mm²", "Kte", "27.7 ± 0.8", "N/mm"])
    browser.js("(location.hash = 'model', 1)")
    browser.wait("document.querySelector('#gap td')")
    becomes(lambda: browser.js("[...document.querySelectorAll('#gap td:nth-child(2)')].map(e => e.textContent)"), ["1.04", "3.21"])
    becomes(lambda: browser.text("#force-sensor"), "Six sensors in the spindle: in use.")
    becomes(lambda: browser.js("[...document.querySelectorAll('#force-sensor ~ div td, #force-sensor ~ table td')].map(e => e.textContent)"),
          ["x", "18.00 ± 0.04", "0.20 %", "y", "18.20 ± 0.05", "0.30 %", "z", "62.0 ± 0.3", "–"])
    machine.sensor(calibrated=False)
    becomes(lambda: "Sensor spindle not calibrated" in browser.text("#status"), True)
    becomes(lambda: browser.text("#force-sensor"), "Six sensors in the spindle: not calibrated, no force is published.")
    machine.sensor(calibrated=True)
    becomes(lambda: "Sensor spindle, calibrated" in browser.text("#status"), True)
    browser.js("(location.hash = 'session', 1)")
    browser.wait("document.querySelector('#steps td')")
    becomes(lambda: browser.js("[...document.querySelectorAll('#steps tbody tr')].map(e => e.children[0].textContent + ' ' + e.children[1].textContent)"),
          ["done connect", "running slot test"])


def database_answers_and_fills_the_chart(browser, machine):
    browser.js("(location.hash = 'model', 1)")
    cells = "[...document.querySelectorAll(arguments[0])].map(e => e.textContent)"
    becomes(lambda: browser.js(cells, "#knowledge-coefficients td"), ["Ktc", "796 ± 4", "N/mm²", "Kte", "27.7 ± 0.8", "N/mm"])
    assert machine.requests[0] == ("end_mill", "al7050"), machine.requests
    becomes(lambda: browser.js(cells, "#knowledge-covered td"),
          ["Cutting speed", "60 … 150", "m/min", "Feed per tooth", "0.050 … 0.200", "mm", "Axial depth", "1.00 … 1.00", "mm"])
    becomes(lambda: browser.text("#knowledge-file"), "Database: /data/mill.sqlite")
    becomes(lambda: "half immersion, down milling, 6000 rpm, 0.200 mm per tooth, 1.50 mm deep; then Ktc ± 2.1 N/mm², Kte ± 0.40 N/mm"
            in browser.text("#knowledge-next"), True)
    browser.js("(document.querySelector('#knowledge-use').click(), 1)")
    for key, value in (("depth", "1.5"), ("feed", "0.2"), ("teeth", "3"), ("helix", "40"), ("width", "50")):
        becomes(lambda: browser.js("document.querySelector('#what-if-' + arguments[0]).value", key), value)
    browser.js("(location.hash = 'model', document.querySelector('#knowledge-material').value = 'steel',"
               " document.querySelector('#knowledge-show').click(), 1)")
    becomes(lambda: browser.text("#knowledge p"), "no records for 'end_mill' in 'steel'; known: end_mill / al7050")


def messages_are_decoded_as_by_ros(browser, machine):
    import io
    for topic in ("stability/chart", "tool/frf", "tool/modes", "material/coefficients", "cut/condition", "session/state", "loadmeter/fleet", "force/sensor"):
        browser.wait("window.smartmill.link.message(arguments[0]) !== undefined", topic)
        sent = machine.last[topic]
        wire = io.BytesIO()
        sent.serialize(wire)
        page = browser.js("JSON.parse(JSON.stringify(window.smartmill.link.message(arguments[0]), (k, v) => ArrayBuffer.isView(v) ?"
                          " Array.from(v, x => Number.isFinite(x) ? x : String(x)) : typeof v === 'number' && !Number.isFinite(v) ? String(v) : v))", topic)
        compare(page, sent, topic)


def compare(page, sent, where):
    if hasattr(sent, "__slots__") and hasattr(sent, "to_sec"):
        assert abs(page - sent.to_sec()) < 1e-6, where
    elif hasattr(sent, "__slots__"):
        for name in sent.__slots__:
            if name != "seq":  # set by the publisher
                compare(page[name], getattr(sent, name), where + "." + name)
    elif isinstance(sent, (list, tuple)):
        equal(len(page), len(sent))
        for k, (a, b) in enumerate(zip(page, sent)):
            compare(a, b, f"{where}[{k}]")
    elif isinstance(sent, float) and not math.isfinite(sent):
        equal(page, {"nan": "NaN", "inf": "Infinity", "-inf": "-Infinity"}[str(sent)])
    else:
        assert page == sent, f"{where}: {page!r}, expected {sent!r}"


def every_view_is_drawn(browser):
    canvases = ("[...document.querySelectorAll('.view:not([hidden]) canvas')].map(c => [c.getAttribute('aria-label'),"
                " c.width && c.height ? c.getContext('2d').getImageData(0, 0, c.width, c.height).data.filter((v, i) => i % 4 == 3 && v > 0).length : 0])")
    browser.wait("window.smartmill.link.message('panel/spectrum') && window.smartmill.link.message('panel/revolution')")
    for size, (width, height) in SIZES.items():
        browser.resize(width, height)
        for view in VIEWS:
            browser.js("(location.hash = arguments[0], 1)", view)
            browser.wait("[...document.querySelectorAll('.view:not([hidden]) canvas')].every(c => c.dataset.drawn == 'yes')")
            time.sleep(0.15)  # two redraws
            for name, count in browser.js(canvases):
                assert count > 500, f"{view} at {size}: {name} is empty"
            wide = browser.js("document.documentElement.scrollWidth")
            assert wide <= width, f"{view} at {size}: {wide} pixels wide"
            browser.picture(f"{OUT}/{view}_{size}.png")
    browser.resize(*SIZES["1280x800"])
    browser.js("(location.hash = 'overview', 1)")


def force_and_spectrum_are_those_of_the_machine(browser):
    # 40 N at 300 Hz about a mean of 100 N: a line of the spectrum, minimum and maximum of every strip.
    line = browser.wait("(m => m && [m.fx[Math.floor(300 / m.step)], m.resolution])(window.smartmill.link.message('panel/spectrum'))")
    assert abs(line[0] - 40.0) < 0.5, line
    strip = browser.js("(m => [Math.min(...m.low.filter((v, i) => i % 3 == 0 && v == v)), Math.max(...m.high.filter((v, i) => i % 3 == 0 && v == v))])"
                       "(window.smartmill.link.message('panel/strip'))")
    assert abs(strip[0] - 60.0) < 0.5 and abs(strip[1] - 140.0) < 0.5, strip


def the_fleet_is_shown(browser, machine):
    browser.js("(location.hash = 'fleet', 1)")
    browser.wait("document.querySelectorAll('#fleet-machines tbody tr').length == 12")
    rows = browser.js("[...document.querySelectorAll('#fleet-machines tbody tr')].map(r => [...r.children].map(e => e.textContent))")
    equal(rows[0][0], "mill 3")  # outliers first
    equal(rows[0][4], "21.5 ± 0.9 %")
    equal(rows[0][6], "outlier, 98.1 %: the same in all cuts: a wrong load-meter constant")
    equal([r[0] for r in rows[1:4]], ["mill 1", "mill 2", "mill 4"])
    by_name = {r[0]: r for r in rows}
    equal(by_name["mill 5"][2:4], ["17", "25"])
    equal(by_name["mill 9"][1], "never")
    equal(by_name["mill 12"][1], "no login")
    assert by_name["mill 2"][1].endswith(" min ago"), by_name["mill 2"]
    assert "mill 7 this one" in by_name, list(by_name)
    equal(browser.js("[...document.querySelectorAll('#fleet-pairs tbody td')].map(e => e.textContent)"),
          ["end_mill", "al7050", "220", "796 ± 9", "14 own", "end_mill_16", "1045 steel", "85", "1893 ± 61", "no own records"])
    equal(browser.js("[...document.querySelectorAll('#fleet-knows tbody tr:nth-child(7) td')].map(e => e.textContent)"), ["mill 7", "18", "·"])
    text = browser.text("#fleet-server")
    for words in ("The server answers: 2 new of 2 sent", "outliers: mill 3", "2.1 % between machines"):
        assert words in text, text
    browser.picture(OUT + "/fleet.png")
    why = 'postgresql://mill_07@shop/fleet: connection to server at "shop", port 5432 failed: FATAL: password authentication failed for user "mill_07"'
    machine.fleet(False, why)
    browser.wait("document.querySelector('#fleet-server .word.bad')")
    equal(browser.text("#fleet-server .word.bad"), "The last push failed: " + why)
    assert "3 of this machine's records are not sent yet" in browser.text("#fleet-server")
    assert "the values below are older" in browser.text("#fleet-server")
    browser.resize(*SIZES["phone"])
    browser.picture(OUT + "/fleet_away_phone.png")
    wide = browser.js("document.documentElement.scrollWidth")
    assert wide <= SIZES["phone"][0], wide
    browser.resize(*SIZES["1280x800"])
    machine.fleet()
    browser.wait("!document.querySelector('#fleet-server .word.bad')")
    browser.js("(location.hash = 'overview', 1)")


def instruments_are_shown(browser, machine):
    browser.js("(location.hash = 'instruments', 1)")
    browser.wait("document.querySelectorAll('[data-instrument] tbody tr').length == 2")
    rows = "[...document.querySelectorAll('[data-instrument] tbody tr')].map(r => [...r.children].map(e => e.textContent))"
    found = browser.js(rows)
    days = int((time.time() - calendar.timegm((2026, 9, 14, 0, 0, 0))) // 86400)
    equal(found[0][:2] + found[0][3:], ["daq/dynamometer/fx", "alive", "12.35 N", "45.60 N", "0", "0.01020 ± 0.00005 V/N", f"2026-09-14, {max(0, days)} days ago"])
    equal(found[1][1:2] + found[1][5:6] + found[1][7:], ["no measurement: clipped, stuck or without supply", "173", "date not stated"])
    equal(browser.js("[...document.querySelectorAll('[data-instrument] .bar')].map(e => [e.className.trim(), e.title])"), [["bar", "42.0 % of the range"], ["bar bad", "100.0 % of the range"]])
    clock = browser.text("#instruments .clock")
    for part in ("tcp, 51200.0 Hz", "drift 30.02 ± 0.05 ppm", "offset -1.200 ± 0.002 ms", "late by 0.310 ms", "latency 12.50 ± 0.03 ms", "512 lost", "last fault: 512 samples are missing"):
        assert part in clock, (part, clock)
    table = browser.text("#alignments")
    for part in ("Alignment daq/hammer/hammer to daq/dynamometer/fx", "12.5 ms later, by taps", "pulses in place of encoder"):
        assert part in table, (part, table)
    for size, (width, height) in SIZES.items():
        browser.resize(width, height)
        browser.picture(f"{OUT}/instruments_{size}.png")
        wide = browser.js("document.documentElement.scrollWidth")
        assert wide <= width, (size, wide)
    browser.resize(*SIZES["1280x800"])
    machine.front_end = False
    browser.wait("document.querySelector('#instruments .stale')?.textContent.startsWith('no report for')")
    machine.front_end = True
    browser.wait("!document.querySelector('#instruments .stale')")


def the_part_is_shown(browser, machine):
    browser.js("(location.hash = 'part', 1)")
    browser.wait("document.querySelector('#part-path').dataset.drawn == 'yes'")
    machine.part()  # the page is subscribed
    row = "[...document.querySelectorAll('#part-lines tbody tr')].map(r => [...r.children].map(e => e.textContent))"
    becomes(lambda: browser.js(row), [["6", "chatter at 812 Hzpredicted to chattermore force than predicted", "420", "300", "1.40", "0.90"]])
    becomes(lambda: browser.text("#part-scale"), "Measured peak force 0 to 420 N, grey: not cut yet")
    # Colours of the pieces at their middle: the slot is cut with half of the largest force, the pass with all of it.
    at = ("(p => { const [x, y] = p.toPixel(arguments[0], arguments[1]), r = devicePixelRatio;"
          " return [...p.canvas.getContext('2d').getImageData(x * r, y * r, 1, 1).data].slice(0, 3); })(window.smartmill.parts.find(p => p.between))")
    slot, last = browser.js(at, -0.03, 0.05), browser.js(at, 0.0, 0.06)
    assert max(abs(a - b) for a, b in zip(last, (254, 232, 56))) < 12, last
    assert max(abs(a - b) for a, b in zip(slot, (122, 122, 115))) < 20, slot
    browser.js("(document.querySelector('#part-quantity').value = 'margin', document.querySelector('#part-quantity').dispatchEvent(new Event('change')), 1)")
    becomes(lambda: browser.text("#part-scale"), "Stability margin 0.500 to 3.00 , grey: not predicted")
    browser.js("(document.querySelector('#part-quantity').value = 'measured', document.querySelector('#part-quantity').dispatchEvent(new Event('change')), 1)")
    browser.js("(location.hash = 'overview', 1)")


def health_of_the_nodes_is_shown(browser, machine):
    browser.js("(location.hash = 'health', 1)")
    browser.wait("document.querySelectorAll('#health-inputs tbody tr').length >= 2")
    rows = "[...document.querySelectorAll('%s tbody tr')].map(r => [...r.children].map(e => e.textContent))"
    nodes = {row[0]: row[1:] for row in browser.js(rows % "#health-nodes")}
    equal(nodes["kalman"], ["restarted 2 times", "10 min", "21", "48", "31", "9"])
    inputs = {tuple(row[:2]): row[2:] for row in browser.js(rows % "#health-inputs")}
    equal(inputs["kalman", "daq/dynamometer"],
          ["", str(2 ** 53 + 12), "3", "5", "4", "3", "256", "0.0 s", "12", "channel fx repeats one value"])
    equal(inputs["kalman", "spindle/angle"], ["no publisher", "0", "0", "0", "0", "0", "0", "–", "–", ""])
    browser.js("(location.hash = 'overview', 1)")


def a_new_instrument_is_tried_written_and_calibrated(browser, bench, machine):
    browser.js("(location.hash = 'instruments', 1)")
    fill = "(e => { e.value = arguments[1]; e.dispatchEvent(new Event('change')); return 1; })(document.querySelector(arguments[0]))"
    answer = lambda: browser.text("#instrument-answer")
    browser.js(fill, "[aria-label=Name]", "tester")
    browser.js(fill, "[aria-label=Token]", "wrong")
    browser.click("#instrument-begin")
    becomes(answer, "the token is missing or wrong")
    equal(machine.tried, [])
    browser.js(fill, "[aria-label=Token]", TOKEN)
    browser.click("#instrument-begin")
    browser.wait("document.querySelectorAll('#instrument-driver option').length == 2")
    browser.js(fill, "#instrument-driver", "tcp")
    browser.js(fill, "#instrument-option-host", "192.168.1.7")
    browser.js(fill, "#instrument-option-port", "5045")
    browser.js(fill, "#instrument-count", "2")
    cell = "#instrument-channels tbody tr:nth-child({}) td:nth-child({}) :is(input, select)"
    for column, value in ((3, "x"), (4, "m/s2"), (5, "0.0102"), (6, "5.0"), (7, "iepe")):
        browser.js(fill, cell.format(1, column), value)
    browser.js(fill, cell.format(2, 5), "0")
    browser.click("#instrument-read")
    becomes(answer, "instrument: streams[0].channels[1].sensitivity: 0, expected volts per m/s2")
    browser.js(fill, cell.format(2, 5), "1.0")
    browser.click("#instrument-read")
    becomes(answer, "51200 samples; drift 31 ± 4 ppm after one second, arrivals late by 0.210 ms")
    becomes(lambda: browser.js("[...document.querySelectorAll('#instrument-levels tbody tr')].map(r => [...r.children].map(e => e.textContent))"),
            [["daq/vibration/x", "", "0.1200 m/s2", "9.870 m/s2", "0", "alive"], ["daq/vibration/c2", "", "– V", "– V", "173", "no measurement"]])
    assert "clipping: c2" in browser.text("#instrument-levels")
    browser.resize(1280, 1500)
    browser.picture(OUT + "/first_connection.png")
    browser.resize(*SIZES["1280x800"])
    browser.click("#instrument-write")
    becomes(answer, "stored in /instruments/front_end.yaml. Start it: roslaunch smartmill_daq daq.launch instrument:=/instruments/front_end.yaml")
    written = machine.tried[-1]
    equal((written.file, written.replace, written.seconds), ("front_end", False, 0.0))
    equal(written.description, """format: smartmill-instrument/1
name: "front end"
driver: tcp
options: {host: "192.168.1.7", port: 5045}
sample_rate: 51200.0   # [Hz]
streams:
  - topic: "daq/vibration"
    channels:
      - {input: 1, name: "x", unit: "m/s2", sensitivity: 0.0102, range: 5.0, coupling: iepe}
      - {input: 2, name: "c2", unit: "V", sensitivity: 1.0, range: 10.0, coupling: dc}
""")
    # Calibration: a record that is refused, a good one, its result stored.
    result = lambda: browser.text("#calibrate-answer")
    browser.js(fill, "#calibrate-exciter", "9")
    browser.click("[data-method=exciter]")
    becomes(result, "x: distortion 34 %")
    equal(browser.js("document.querySelector('[data-method=store]').hidden"), True)
    browser.js(fill, "#calibrate-exciter", "10")
    browser.click("[data-method=exciter]")
    becomes(lambda: result().startswith("x: 0.0104 +- 0.00016"), True)
    asked = machine.calibrated[-1]
    equal((asked.file, asked.topic, asked.channel, asked.method, asked.seconds, asked.reference_std), ("front_end", "daq/vibration", "x", 0, 5.0, 0.015))
    browser.click("[data-method=store]")
    becomes(lambda: result().endswith("stored, daq_node reads it at its next start"), True)
    equal(machine.calibrated[-1].method, 4)
    # Without token nothing is opened or written, and nothing of all this has touched the machine.
    count = len(machine.tried)
    for path in ("instrument", "calibrate"):
        equal(status_of(bench.address + "api/" + path, b"{}"), 401)
        equal(status_of(bench.address + "api/" + path, b"{}", X_SmartMill_Token=TOKEN), 400)  # no name
        equal(status_of(bench.address + "api/" + path, b"{}", X_SmartMill_Token=TOKEN, Origin="http://evil.example"), 403)
    equal((len(machine.tried), machine.moved), (count, []))
    browser.js("(location.hash = 'overview', 1)")


def silence_turns_values_grey(browser, machine):
    machine.silent = True
    browser.wait("document.querySelector('#status').textContent.includes('Controller silent')")
    browser.wait("[...document.querySelectorAll('.tile .value')].every(e => e.classList.contains('stale'))")
    machine.silent = False
    browser.wait("document.querySelector('#status').textContent.includes('Connected')")


def a_lost_node_is_reported_and_a_restarted_one_is_shown(browser, bench):
    browser.js("(location.hash = 'overview', 1)")
    bench.node.kill()
    bench.node.wait()
    begin = time.time()
    browser.wait("document.querySelector('#status').textContent.includes('Panel does not answer')")
    seconds = time.time() - begin
    assert seconds < LOSS_TIMEOUT, f"{seconds:.1f} s"
    browser.wait("[...document.querySelectorAll('.tile .value')].every(e => e.classList.contains('stale'))")
    bench.start_node()
    browser.wait("document.querySelector('#status').textContent.includes('Connected')")
    browser.wait("!document.querySelector('.tile .value.stale')")
    browser.errors()  # discards the expected connection errors


def status_of(address, body=None, **headers):
    request = urllib.request.Request(address, body, {key.replace("_", "-"): value for key, value in headers.items()})
    try:
        with urllib.request.urlopen(request, timeout=30) as answer:
            return answer.status
    except urllib.error.HTTPError as error:
        return error.code


def hostile_origins_and_commands_without_token_are_refused(bench):
    equal(status_of(bench.address, Origin="http://evil.example"), 403)
    command = json.dumps({"command": "cancel", "who": "test"}).encode()
    equal(status_of(bench.address + "api/command", command), 401)
    equal(status_of(bench.address + "api/command", command, X_SmartMill_Token="wrong"), 401)
    equal(status_of(bench.address + "api/command", command, X_SmartMill_Token=TOKEN, Origin="http://evil.example"), 403)
    equal(status_of(bench.address + "api/command", command, X_SmartMill_Token=TOKEN), 200)
    equal(status_of(bench.address + "api/command", json.dumps({"command": "start_spindle", "who": "test"}).encode(), X_SmartMill_Token=TOKEN), 409)
    equal(status_of(bench.address + "api/command", json.dumps({"command": "cancel"}).encode(), X_SmartMill_Token=TOKEN), 400)
    note = json.dumps({"text": "here"}).encode()
    equal(status_of(bench.address + "api/note", note, Origin="http://evil.example"), 403)
    equal(status_of(bench.address + "api/note", b"no json"), 400)


def the_page_commands_after_an_unlock(browser):
    browser.js("(location.hash = 'session', 1)")
    assert not browser.js("document.querySelector('[data-command=disarm]').checkVisibility()")
    browser.js("(document.querySelector('input[type=password]').value = arguments[0],"
               " document.querySelector('input[placeholder^=Your]').value = 'a tester', 1)", TOKEN)
    browser.click("#unlock")
    browser.wait("document.querySelector('[data-command=disarm]').checkVisibility()")
    browser.click("[data-command=disarm]")
    browser.wait("document.querySelector('#command-answer').textContent.includes('does not answer')")
    browser.wait("window.smartmill.link.message('panel/log')?.data.includes('a tester')")
    text = browser.js("window.smartmill.link.message('panel/log').data")
    assert "disarm REFUSED" in text, text
    browser.js("(window.smartmill.parts.find(p => p.unlocked).until = 0, 1)")  # as after a minute
    browser.wait("!document.querySelector('[data-command=disarm]').checkVisibility()")


def a_note_is_kept_in_the_log_for_every_page(browser, bench):
    browser.js("(location.hash = 'session', document.querySelector('[aria-label=Note]').value = arguments[0], 1)", "<b>whistles</b>, really")
    browser.click("#mark")
    browser.wait("document.querySelector('#notes td')")
    cells = browser.js("[...document.querySelectorAll('#notes td')].map(e => e.textContent)")
    equal(cells[1:], ["a tester", "slot_7: <b>whistles</b>, really"])
    browser.open(bench.address + "#forces")
    browser.wait("window.smartmill?.parts.find(p => p.strips)?.plots[0].marks.some(m => m.label.includes('whistles'))")


def accepted_and_rejected_hits_are_shown(browser, machine):
    m, now = machine.msg, machine.rospy.Time.now
    for topic in ("goal", "feedback"):
        becomes(lambda: machine.publishers["hammer/measure_frf/" + topic].get_num_connections(), 1)
    goal = m.MeasureFrfActionGoal()
    goal.goal_id.id, goal.goal_id.stamp = "hits", now()
    goal.goal.point, goal.goal.direction, goal.goal.hits = "tool_tip", "x", 2
    machine.publish("hammer/measure_frf/goal", goal)
    for stage in ("turning the spindle", "hit 1 of 2", "hit thrown away: a second blow after 1.3 ms", "hit 2 of 2"):
        feedback = m.MeasureFrfActionFeedback()
        feedback.status.goal_id.id, feedback.feedback.stage = "hits", stage
        machine.publish("hammer/measure_frf/feedback", feedback)
        time.sleep(0.05)
    browser.js("(location.hash = 'dynamics', 1)")
    becomes(lambda: browser.js("[...document.querySelectorAll('#hits .word')].map(e => e.textContent)"),
            ["hit 2 rejected: a second blow after 1.3 ms"])
    equal(browser.js("document.querySelectorAll('#hits i').length"), 2)
    becomes(lambda: "Hits tool x: 2 accepted, 1 rejected" in browser.text("#hits"), True)


def every_plot_is_saved_as_picture_and_numbers(browser):
    browser.js("(window.saved = [], URL.createObjectURL = blob => { window.saved.push([blob.type, blob.size]); return 'data:,'; }, 1)")
    plots = 0
    for view in VIEWS:
        browser.js("(location.hash = arguments[0], 1)", view)
        browser.wait("[...document.querySelectorAll('.view:not([hidden]) canvas')].every(c => c.dataset.drawn == 'yes')")
        plots += browser.js("document.querySelectorAll('.view:not([hidden]) .plot canvas').length")
        browser.js("([...document.querySelectorAll('.view:not([hidden]) .plot .tools button')].forEach(b => b.click()), 1)")
    browser.wait("window.saved.length >= 2 * arguments[0]", plots)
    found = browser.js("window.saved")
    equal(len([f for f in found if f[0] == "image/png" and f[1] > 1000]), plots)
    equal(len([f for f in found if f[0] == "text/csv" and f[1] > 200]), plots)
    # The exported numbers are those of the topic.
    line = browser.js("window.smartmill.parts.find(p => p.plot?.options.name == 'stability_stability').plot.csv().split('\\n').find(l => l.startsWith('chatter limit'))")
    speed, depth = (float(x) for x in line.split(",")[1:3])
    assert abs(speed - 200.0 * 30 / math.pi) < 1e-6 and abs(depth - 2.0) < 1e-9, line


def the_layout_is_kept(browser, bench):
    browser.js("(location.hash = 'forces', 1)")
    browser.js("([...document.querySelectorAll('#view-forces .choice button')].find(b => b.textContent == 'z').click(), 1)")
    browser.open("about:blank")
    browser.open(bench.address)
    browser.wait("!!window.smartmill")
    equal(browser.js("[window.smartmill.current, window.smartmill.store.axis]"), ["forces", "z"])
    pressed = "[...document.querySelectorAll('#view-forces .choice button[aria-pressed=true]')].map(b => b.textContent)"
    assert "z" in browser.js(pressed)
    browser.js("([...document.querySelectorAll('#view-forces .choice button')].find(b => b.textContent == 'x').click(), 1)")


def machines_of_other_namespaces_have_their_status_lines(browser, bench, machine):
    """Two pipelines with one ROS master: the second has its own namespace and panel."""
    other = bench.start_node("/mill2/smartmill", "Mill 2")
    try:
        state = machine.msg.CncState(connected=True, alarm=True, alarm_text="1010", mode=10, run=1, axes=["x"], position=[0.0], distance_to_go=[0.0])
        publisher = machine.rospy.Publisher("/mill2/smartmill/cnc/state", type(state), queue_size=10)
        machine.others.append((publisher, state))
        line = "document.querySelector('[data-machine=mill2]')"
        browser.wait(line + "?.textContent.includes('Alarm 1010')")
        browser.picture(OUT + "/machines.png")
        assert "1010" not in browser.text("#status"), "the status line shows the alarm of the other machine"
        machine.others.clear()
        browser.wait(line + ".textContent.includes('Controller silent')")
        machine.others.append((publisher, state))
        browser.js(line + ".click()")
        browser.wait("location.port == arguments[0] && !!window.smartmill", str(other))
        browser.wait("document.querySelector('#status').textContent.includes('Alarm 1010')")
        browser.wait("document.querySelector('#status').textContent.startsWith('Mill 2')")
        browser.wait("document.querySelector('[data-machine=SmartMill]')?.textContent.includes('Chatter')")
    finally:
        browser.open(bench.address)


def reports_sort_and_zoom_without_a_server(browser):
    """report.html, written by page_test.cpp with the report writer of the project."""
    browser.open("file://" + OUT + "/report.html")
    column = "[...document.querySelectorAll('tr td:first-child')].map(e => e.textContent)"
    equal(browser.js(column), ["b", "c", "a", "d"])
    browser.click("th:nth-child(2)")
    equal(browser.js(column), ["a", "b", "d", "c"])  # by number: 9, 10.5 +- 2, 1e3; rows without a number are last
    browser.click("th:nth-child(2)")
    equal(browser.js(column), ["d", "b", "a", "c"])
    browser.click("figure img")
    browser.wait("document.querySelector('dialog').open")
    scale = "new DOMMatrix(getComputedStyle(document.querySelector('dialog img')).transform).a"
    before = browser.wait(scale + " > 5 && " + scale)  # a small picture fills the window
    browser.js("document.querySelector('dialog').dispatchEvent(new WheelEvent('wheel', {deltaY: -100, clientX: 200, clientY: 200})) || 1")
    assert abs(browser.js(scale) / before - 1.25) < 1e-4  # printed with six digits
    for name, (width, height) in SIZES.items():
        browser.resize(width, height)
        browser.picture(f"{OUT}/report_{name}.png")
    browser.resize(*SIZES["1280x800"])
    browser.click("dialog")
    assert not browser.js("document.querySelector('dialog').open")
    wide = browser.js("document.documentElement.scrollWidth")
    assert wide <= SIZES["1280x800"][0], wide


def the_phone_shows_verdict_and_next_speed(browser, bench, machine):
    browser.resize(*SIZES["phone"])
    browser.open(bench.address + "phone")
    browser.wait("window.smartmill?.link.alive")
    becomes(lambda: browser.text("#state"), "No microphone yet")
    machine.sound()
    becomes(lambda: browser.text("#state"), "Cutting")
    equal(browser.text("#verdict"), "CHATTER")
    assert browser.js("document.querySelector('.verdict .shape.chatter').checkVisibility()")
    equal(browser.text("#frequency"), "2210 Hzat 15920 rpmprobability of chatter 97 %")
    equal(browser.text("#next"), "9120 rpm")
    equal(browser.text("#stable"), "stable with a probability of 36 %")
    equal(browser.text("#others"), "12210 rpm, 21 %")
    equal(browser.text("#level"), "-34 dB of full scale")
    equal(browser.js("[...document.querySelectorAll('#tries tbody tr')].map(e => e.textContent)"),
          ["315920Chatter2210", "215920Not certain", "18000Chatter1068"])
    equal(browser.js("['teeth', 'speed', 'low', 'high'].map(id => document.getElementById(id).value)"), ["4", "15920", "4000", "18000"])
    # All but the list fits on the screen, and nothing is wider than it; what is tapped is large.
    assert browser.js("document.documentElement.scrollWidth") <= SIZES["phone"][0]
    assert browser.js("document.querySelector('#set').getBoundingClientRect().bottom") <= SIZES["phone"][1]
    small = browser.js("[...document.querySelectorAll('button, input')].filter(e => e.checkVisibility() && e.getBoundingClientRect().height < 44).map(e => e.id)")
    equal(small, [])
    browser.picture(f"{OUT}/sound_phone.png")


def the_phone_sets_speed_and_teeth(browser, machine):
    browser.click("#go")
    becomes(lambda: len(machine.cuts), 1)
    first = machine.cuts[0]
    assert abs(first.spindle_speed - 9120 * 2 * math.pi / 60) < 1e-6, first
    assert first.teeth == 0 and math.isnan(first.speed_low) and not first.restart and not first.discard_last, first
    becomes(lambda: browser.text("#answer"), "4 teeth, next cut at 9120 rpm")
    browser.js("(document.querySelector('#teeth').value = '3', document.querySelector('#speed').value = '60000', 1)")
    browser.click("#set")
    becomes(lambda: browser.text("#answer"), "speed: 95493 rpm: expected 4000 to 18000 rpm, the range of the spindle")
    equal(machine.cuts[1].teeth, 3)
    browser.click("#restart")
    becomes(lambda: len(machine.cuts), 3)
    assert machine.cuts[2].restart and math.isnan(machine.cuts[2].spindle_speed), machine.cuts[2]
    browser.wait("window.smartmill.link.channels.has('/smartmill/panel/log')")


def the_phone_states_that_there_is_no_sound(browser, machine):
    machine.sound(clipped=0.031, state=1, tries=[], running=False, next_speed=[], next_stable=[], teeth=0)
    becomes(lambda: browser.text("#clipping"), "Clipping, 3.1 %: reduce the gain")
    equal([browser.text(at) for at in ("#state", "#verdict", "#next")], ["Listening", "Set the teeth", "Enter the number of teeth"])
    machine.sound(state=0, level=math.nan)
    becomes(lambda: browser.text("#state"), "No sound")
    equal(browser.text("#level"), "–")
    browser.picture(f"{OUT}/sound_phone_no_sound.png")
    browser.wait("document.querySelector('#state').textContent.startsWith('No report for')")
    assert browser.js("document.querySelector('.next').classList.contains('stale')")


def raw_sound_is_not_served(browser, bench, machine):
    """Anyone who reads the panel could listen to the workshop otherwise. Settings are bounded."""
    block = machine.msg.SampleBlock(sample_rate=48000.0, channels=["sound"], units=["1"], samples=[0.1] * 240)
    machine.publish("daq/sound", block)
    machine.publish("daq/vibration", block)
    browser.wait("window.smartmill.link.channels.has('/smartmill/daq/vibration')")
    assert not browser.js("window.smartmill.link.channels.has('/smartmill/daq/sound')")
    at = bench.address + "api/sound"
    for bad in (b"no json", b"[]", b'{"teeth": 0}', b'{"teeth": 2.5}', b'{"teeth": "4"}', b'{"restart": 1}', b'{"speed": 3}', b'{"spindle_speed": null}'):
        equal(status_of(at, bad), 400)
    equal(status_of(at, b'{"teeth": 4}', Origin="http://evil.example"), 403)
    equal(status_of(at), 405)


def no_error_on_the_console(browser):
    errors = [e for e in browser.errors() if not any(api in e for api in ("/api/command", "/api/instrument", "/api/sound"))]  # the refusals above are expected
    assert not errors, errors


def main():
    bench = Bench()
    try:
        machine = Machine()
        bench.start_first_node()
        with Browser() as browser:
            browser.resize(*SIZES["1280x800"])
            browser.open(bench.address)
            bench.case(values_are_the_topics, browser, machine)
            bench.case(database_answers_and_fills_the_chart, browser, machine)
            bench.case(messages_are_decoded_as_by_ros, browser, machine)
            bench.case(force_and_spectrum_are_those_of_the_machine, browser)
            bench.case(every_view_is_drawn, browser)
            bench.case(the_fleet_is_shown, browser, machine)
            bench.case(instruments_are_shown, browser, machine)
            bench.case(a_new_instrument_is_tried_written_and_calibrated, browser, bench, machine)
            bench.case(the_part_is_shown, browser, machine)
            bench.case(health_of_the_nodes_is_shown, browser, machine)
            bench.case(silence_turns_values_grey, browser, machine)
            bench.case(hostile_origins_and_commands_without_token_are_refused, bench)
            bench.case(the_page_commands_after_an_unlock, browser)
            bench.case(a_note_is_kept_in_the_log_for_every_page, browser, bench)
            bench.case(accepted_and_rejected_hits_are_shown, browser, machine)
            bench.case(every_plot_is_saved_as_picture_and_numbers, browser)
            bench.case(the_layout_is_kept, browser, bench)
            bench.case(machines_of_other_namespaces_have_their_status_lines, browser, bench, machine)
            bench.case(reports_sort_and_zoom_without_a_server, browser)
            bench.case(the_phone_shows_verdict_and_next_speed, browser, bench, machine)
            bench.case(the_phone_sets_speed_and_teeth, browser, machine)
            bench.case(the_phone_states_that_there_is_no_sound, browser, machine)
            bench.case(raw_sound_is_not_served, browser, bench, machine)
            browser.resize(*SIZES["1280x800"])
            browser.open(bench.address)
            bench.case(no_error_on_the_console, browser)
            bench.case(a_lost_node_is_reported_and_a_restarted_one_is_shown, browser, bench)
    finally:
        bench.stop()
        with open(OUT + "/results.json", "w") as out:
            json.dump(bench.failed, out, indent=1)


main()
