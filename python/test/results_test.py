"""The classes of results, and the stubs next to the compiled part."""
import ast
import copy
import dataclasses
import json
import math
import pathlib
import pickle
import re
import tempfile
import unittest

import numpy as np
import smartmill
from shared import MODEL
from smartmill import Coefficients, Estimate, Mode, _smartmill


class EstimateTest(unittest.TestCase):
    def test_it_is_a_float_with_a_standard_deviation(self):
        value = Estimate(1074.21, 0.32)
        self.assertEqual((value, value.std, value.value), (1074.21, 0.32, 1074.21))
        self.assertIs(type(value + 1.0), float)
        self.assertEqual(json.dumps([value]), "[1074.21]")
        for same in (copy.deepcopy(value), pickle.loads(pickle.dumps(value))):
            self.assertEqual((same, same.std), (value, value.std))

    def test_text(self):
        for value, text in ((Estimate(1074.21, 0.32), "1074.21 +- 0.32"), (Estimate(953e6, 20e6), "9.53e+08 +- 2e+07"),
                            (Estimate(0.0251, 0.0012), "0.0251 +- 0.0012"), (Estimate(2.5), "2.5"),
                            (Estimate(1.6e-7, 5e-9), "1.6e-07 +- 5e-09"),
                            (Estimate(12.0, 0.0), "12.000000 +- 0.000000")):
            self.assertEqual(str(value), text)
        self.assertEqual(f"{Estimate(1074.21, 0.32)} Hz, {Estimate(1074.21, 0.32):.0f}", "1074.21 +- 0.32 Hz, 1074")


class DataclassesTest(unittest.TestCase):
    def test_all_are_frozen(self):
        classes = [c for c in vars(smartmill).values() if dataclasses.is_dataclass(c)]
        self.assertGreater(len(classes), 20)
        for c in classes:
            self.assertTrue(c.__dataclass_params__.frozen, c)
        with self.assertRaises(dataclasses.FrozenInstanceError):
            Mode(900.0, 0.02, 1e-7).frequency = 800.0

    def test_numbers_become_estimates(self):
        mode = Mode(900.0, Estimate(0.02, 0.001), 1e-7)
        self.assertTrue(math.isnan(mode.frequency.std))
        self.assertEqual(mode.damping_ratio.std, 0.001)
        self.assertTrue(math.isnan(Coefficients(1e9, 1e8).kae.std))

    def test_the_standard_deviation_of_the_stiffness(self):
        stiffness = Mode(900.0, 0.02, Estimate(1e-7, 2e-9)).stiffness
        self.assertAlmostEqual(stiffness, 1e7)
        self.assertAlmostEqual(stiffness.std / stiffness, 0.02)

    def test_results_become_dictionaries(self):
        lobes = smartmill.lobes(MODEL, [5000.0, 6000.0], max_depth=0.01)
        self.assertEqual(set(dataclasses.asdict(lobes)), {"speed", "depth", "frequency", "kind", "error"})
        self.assertEqual(lobes, lobes)
        self.assertEqual(copy.deepcopy(smartmill.Model(MODEL)).tool, smartmill.Model(MODEL).tool)

    def test_the_standard_deviation_of_a_limit(self):
        depth = np.linspace(0.0, 0.01, 400)
        risk = smartmill.ChatterRisk(
            speed=np.array([500.0, 600.0]), depth=depth, nominal=np.array([0.004, 0.005]), points=(),
            probability=np.array([[0.5 * math.erfc((mean - d) / (std * math.sqrt(2.0))) for d in depth]
                                  for mean, std in ((0.004, 0.0005), (0.005, 0.001))]))
        np.testing.assert_allclose(risk.depth_std, [0.0005, 0.001], rtol=1e-3)


class ModelTest(unittest.TestCase):
    def test_a_model_of_numbers_survives_its_file(self):
        tool = smartmill.Tool(teeth=2, diameter=0.01, helix=0.5, pitch=(3.0, 2.0 * math.pi - 3.0))
        cutting = Coefficients(*(Estimate(value, 0.02 * value) for value in (9e8, 3e8, 1e8, 2e4, 1e4, 1e3)))
        mode = Mode(Estimate(900.0, 2.0), Estimate(0.02, 0.001), Estimate(1e-7, 2e-9))
        share = Mode(1200.0, 0.03, 0.9)
        model = smartmill.machine_model(tool, cutting, tool_tip={"y": [mode]}, force_sensor={"z": [share]})
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder) / "model.yaml"
            model.save(file)
            read = smartmill.Model(file)
        np.testing.assert_allclose(dataclasses.astuple(read.tool)[:3], dataclasses.astuple(tool)[:3], rtol=1e-9)
        np.testing.assert_allclose(read.tool.pitch, tool.pitch, rtol=1e-9)
        for name, value in vars(cutting).items():
            found = getattr(read.cutting, name)
            np.testing.assert_allclose((found, found.std), (value, value.std), rtol=1e-9)
        self.assertEqual(read.tool_tip["x"], ())
        for found, given in ((read.tool_tip["y"][0], mode), (read.force_sensor["z"][0], share)):
            for name in ("frequency", "damping_ratio", "gain"):
                np.testing.assert_allclose(getattr(found, name), getattr(given, name), rtol=1e-9)
        np.testing.assert_allclose(read.tool_tip["y"][0].gain.std, mode.gain.std, rtol=1e-9)


class StubsTest(unittest.TestCase):
    """_smartmill.pyi declares what the compiled part has, with the same parameters."""

    def test_they_are_complete(self):
        stub = ast.parse((pathlib.Path(smartmill.__file__).parent / "_smartmill.pyi").read_text())
        declared = {node.name: [argument.arg for argument in node.args.args] for node in stub.body
                    if isinstance(node, ast.FunctionDef)}
        compiled = {}
        for name, value in vars(_smartmill).items():
            if callable(value) and not isinstance(value, type):
                signature = re.match(r"\w+\((.*)\) ->", value.__doc__)[1]
                compiled[name] = re.findall(r"(?:^|, )(\w+):", signature)
        self.assertEqual(declared, compiled)
        declared_model, = (node for node in stub.body if isinstance(node, ast.ClassDef))
        compiled_model = {name for name in vars(smartmill.Model) if not name.startswith("_")} | {"__init__"}
        self.assertEqual({node.name for node in declared_model.body if isinstance(node, ast.FunctionDef)}, compiled_model)
        self.assertTrue((pathlib.Path(smartmill.__file__).parent / "py.typed").exists())

    def test_the_package_exports_what_it_lists(self):
        public = {name for name, value in vars(smartmill).items()
                  if not name.startswith("_") and not isinstance(value, type(ast))}
        self.assertEqual(set(smartmill.__all__), public)
