"""The layouts for Foxglove and PlotJuggler name only topics and fields that exist."""
import json
import pathlib
import re
import unittest
import xml.etree.ElementTree as ElementTree

ROOT = pathlib.Path(__file__).resolve().parents[2]
LAYOUTS = ROOT / "launch/layouts"
TYPES = {"force/wrench": "geometry_msgs/WrenchStamped", "cnc/load": "LoadSample", "cnc/state": "CncState", "chatter/state": "ChatterState",
         "discrepancy/state": "DiscrepancyState", "stability/chart": "StabilityChart", "tool/frf": "Frf", "force/estimate": "ForceEstimate",
         "machine/temperature": "MachineTemperature"}
OTHERS = {"geometry_msgs/WrenchStamped": {"wrench": "geometry_msgs/Wrench"}, "geometry_msgs/Wrench": {"force": "geometry_msgs/Vector3"},
          "geometry_msgs/Vector3": {"x": "float64", "y": "float64", "z": "float64"}}


def fields(kind):
    """{name: type} of a message; a list keeps its brackets."""
    if kind in OTHERS:
        return OTHERS[kind]
    text = (ROOT / f"smartmill_msgs/msg/{kind}.msg").read_text()
    return {name: base for base, name in re.findall(r"^([\w/]+(?:\[\d*\])?)\s+(\w+)\s*(?:#.*)?$", text, re.MULTILINE)}


class Layouts(unittest.TestCase):
    def check(self, path, separator):
        topic = next((t for t in TYPES if path.startswith(f"/smartmill/{t}{separator}")), None)
        self.assertIsNotNone(topic, path)
        self.assertIn(f'"{topic}"', (ROOT / "src/smartmill_core/include/smartmill_core/names.h").read_text())
        kind = TYPES[topic]
        for part in path.removeprefix(f"/smartmill/{topic}{separator}").split(separator):
            name, bracket = re.fullmatch(r"(\w+)(\[(?:\d+|:)\])?", part).groups()
            self.assertIn(name, fields(kind), path)
            kind = fields(kind)[name]
            self.assertEqual(bracket is not None, kind.endswith("]"), path)
            kind = re.sub(r"\[\d*\]$", "", kind)
        self.assertNotIn("/", kind, path)

    def test_foxglove(self):
        layout = json.loads((LAYOUTS / "foxglove.json").read_text())
        panels = layout["configById"]
        placed = re.findall(r'"(\w+!\w+)"', json.dumps(layout["layout"]))
        self.assertEqual(sorted(placed), sorted(panels))
        for panel in panels.values():
            for path in panel.get("paths", []) + ([panel["xAxisPath"]] if "xAxisPath" in panel else []):
                self.check(path["value"], ".")

    def test_plotjuggler(self):
        curves = list(ElementTree.parse(LAYOUTS / "plotjuggler.xml").getroot().iter("curve"))
        self.assertGreater(len(curves), 10)
        for curve in curves:
            self.check(curve.get("name"), "/")


if __name__ == "__main__":
    unittest.main()
