#!/usr/bin/env python3
"""Latency and CPU load of the panel's page in headless Chromium.
usage: devel/env.sh smartmill_studies/panel/page_figures.py strips MINUTES      25.6 kHz x 6 to panel and page
       devel/env.sh smartmill_studies/panel/page_figures.py what-if BAG N       N moves of sliders on a recorded session
"""
import math
import os
import subprocess
import sys
import threading
import time

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "../../smartmill_panel/test/page"))
from browser import Browser, free_port  # noqa: E402

RATE, BLOCK = 25600.0, 256  # [Hz], [samples]
SPEED = 418.879  # [rad/s]
CLOCK_TICK = os.sysconf("SC_CLK_TCK")
STRIPS = "window.smartmill.parts.find(p => p.strips)"
# A drawing is displayed two frames later.
WATCH_STRIPS = """((s) => { window.lags = []; const draw = s.draw.bind(s); s.draw = () => { draw();
  const newest = s.strips.filter(m => m.source === s.store.source).at(-1);
  if (!newest || newest === s.seen) return; s.seen = newest;
  const end = newest.header.stamp + newest.low.length / 3 * newest.bin;
  requestAnimationFrame(() => requestAnimationFrame(() => window.lags.push(Date.now() / 1e3 - end))); }; return 1; })"""
MOVE_SLIDER = """((k) => { const names = ['helix', 'feed', 'overhang', 'depth', 'width', 'teeth'];
  const i = document.querySelector('#what-if-' + names[k % 6]), share = ((k * 37) % 83) / 83;
  i.value = +i.min + (i.max - i.min) * share * (i.id === 'what-if-depth' ? 0.5 : 1);
  i.dispatchEvent(new Event('input')); })(arguments[0])"""


class Launch:
    """A launch file of smartmill_launch with a separate master."""

    def __init__(self, file, *arguments):
        master = free_port()
        os.environ["ROS_MASTER_URI"] = f"http://localhost:{master}"
        self.process = subprocess.Popen(["roslaunch", "-p", str(master), "smartmill_launch", file, *arguments],
                                        stdout=subprocess.DEVNULL)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.terminate()
        self.process.wait()

    def node(self, name):
        while True:
            for process in below(self.process.pid):
                if nameOf(process) == name:
                    return process
            time.sleep(0.2)


def nameOf(process):
    with open(f"/proc/{process}/comm") as comm:
        return comm.read().strip()


def below(process):
    out = subprocess.run(["ps", "-o", "pid=", "--ppid", str(process)], capture_output=True, text=True).stdout.split()
    return [int(child) for child in out] + [deeper for child in out for deeper in below(int(child))]


def cpu(process):  # [s]
    try:
        with open(f"/proc/{process}/stat") as stat:
            fields = stat.read().rsplit(")", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / CLOCK_TICK
    except FileNotFoundError:
        return 0.0


def memory(process):  # [MB]
    with open(f"/proc/{process}/statm") as statm:
        return int(statm.read().split()[1]) * os.sysconf("SC_PAGESIZE") / 1e6


def report(name, seconds):
    ordered = sorted(seconds)
    print(f"{name}: median {1e3 * ordered[len(ordered) // 2]:.0f} ms, 99 % {1e3 * ordered[int(0.99 * len(ordered))]:.0f} ms, "
          f"largest {1e3 * ordered[-1]:.0f} ms, of {len(ordered)}")


def open_page(page, url):
    page.resize(1280, 800)
    while True:
        try:
            page.open(url)
            break
        except AssertionError:  # the panel is not ready yet
            time.sleep(0.5)
    page.wait("!!window.smartmill")


class Source(threading.Thread):
    """Measured and compensated force of a cutting machine, as blocks that end at the present time."""

    def __init__(self):
        super().__init__(daemon=True)
        import rospy
        from smartmill_msgs import msg
        self.rospy, self.msg = rospy, msg
        rospy.init_node("source", disable_signals=True)
        self.forces = [rospy.Publisher("/smartmill/force/" + k, msg.ForceBlock, queue_size=100) for k in ("measured", "compensated")]
        self.angle = rospy.Publisher("/smartmill/spindle/angle", msg.SpindleAngle, queue_size=100)
        self.state = rospy.Publisher("/smartmill/cnc/state", msg.CncState, queue_size=10)
        self.waves = [[100.0 + 80.0 * math.sin(2.0 * math.pi * 300.0 * (block * BLOCK + i) / RATE) for i in range(BLOCK)]
                      for block in range(64)]

    def send(self, publisher, message, at):
        message.header.stamp = self.rospy.Time.from_sec(at)
        publisher.publish(message)

    def run(self):
        begin, block = time.time(), 0
        while True:
            end = begin + (block + 1) * BLOCK / RATE
            time.sleep(max(end - time.time(), 0.0))
            fx, fy, fz = (self.waves[(block + shift) % 64] for shift in (0, 9, 20))
            for status, publisher in enumerate(self.forces):
                self.send(publisher, self.msg.ForceBlock(sample_rate=RATE, first_index=block * BLOCK, fx=fx, fy=fy, fz=fz, status=status),
                          end - BLOCK / RATE)
            self.send(self.angle, self.msg.SpindleAngle(angle=(SPEED * end) % (2.0 * math.pi), speed=SPEED), end)
            if block % 10 == 0:
                self.send(self.state, self.msg.CncState(connected=True, mode=10, run=3, axes=["x"], position=[0.0], distance_to_go=[0.0]), end)
            block += 1


def strips(minutes):
    port = free_port()
    with Launch("panel.launch", f"port:={port}") as launch, Browser() as page:
        node = launch.node("panel_node")
        Source().start()
        open_page(page, f"http://127.0.0.1:{port}/#forces")
        page.wait(f"{STRIPS}?.strips.length > 20")
        page.js(f"{WATCH_STRIPS}({STRIPS})")
        browser = below(page.driver.pid)
        begin, node_cpu, page_cpu = time.time(), cpu(node), sum(map(cpu, browser))
        bytes_before = page.js("window.smartmill.link.bytes")
        while True:
            took = time.time() - begin
            heap = page.js("performance.memory.usedJSHeapSize") / 1e6
            print(f"{took:4.0f} s: node {memory(node):.1f} MB, heap of the page {heap:.1f} MB, load {os.getloadavg()[0]:.1f}", flush=True)
            if took >= 60.0 * minutes:
                break
            time.sleep(min(30.0, 60.0 * minutes - took))
        report("sample to drawn strip", page.js("window.lags"))
        print(f"node {100.0 * (cpu(node) - node_cpu) / took:.1f} % of a core, browser {100.0 * (sum(map(cpu, browser)) - page_cpu) / took:.1f} %, "
              f"{(page.js('window.smartmill.link.bytes') - bytes_before) / took / 1e3:.0f} kB/s, lost {page.js('window.smartmill.link.lost')}")
        print("errors of the page:", page.errors())


def what_if(bag, questions):
    port = free_port()
    with Launch("replay.launch", f"bag:={bag}", "panel:=true", f"panel_port:={port}", "stay:=true", "rate:=0"), Browser() as page:
        open_page(page, f"http://127.0.0.1:{port}/#stability")
        page.wait("window.smartmill.link.message('stability/chart') !== undefined", seconds=600)
        page.wait("(s => s && s.position >= s.length - 0.5)(window.smartmill.link.message('replay/state'))", seconds=1200)
        computed = []
        for k in range(questions):
            page.js(MOVE_SLIDER, k)
            page.wait(f"window.smartmill.parts.find(p => p.times).times.length > {k}")
            computed.append(float(page.text("#what-if-answer").rsplit("(", 1)[1].split()[0]) / 1e3)
        report("slider to drawn chart", [t / 1e3 for t in page.js("window.smartmill.parts.find(p => p.times).times")])
        report("computed in the node", computed)
        print(f"load {os.getloadavg()[0]:.1f}; errors of the page: {page.errors()}")


if __name__ == "__main__":
    try:
        if sys.argv[1:2] == ["strips"]:
            strips(float(sys.argv[2]))
        elif sys.argv[1:2] == ["what-if"]:
            what_if(os.path.abspath(sys.argv[2]), int(sys.argv[3]))
        else:
            sys.exit(__doc__)
    except (IndexError, ValueError):
        sys.exit(__doc__)
