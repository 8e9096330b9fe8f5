"""The five examples run, print the expected numbers and draw pictures. The pictures stay in $PICTURES."""
import os
import pathlib
import re
import subprocess
import sys

import matplotlib.image
import numpy as np
from shared import EXAMPLES, FolderTest, shared, subset

PICTURES = pathlib.Path(os.environ.get("PICTURES", "pictures"))


class ExamplesTest(FolderTest):
    def run_example(self, name, *arguments):
        """The numbers that an example prints, line by line."""
        PICTURES.mkdir(parents=True, exist_ok=True)
        picture = PICTURES / f"{name}.png"
        picture.unlink(missing_ok=True)
        done = subprocess.run([sys.executable, EXAMPLES / f"{name}.py", *arguments], cwd=PICTURES, capture_output=True,
                              text=True, env={**os.environ, "MPLCONFIGDIR": str(self.folder)})
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertNotIn("Warning", done.stderr)
        pixels = matplotlib.image.imread(picture)[:, :, :3]
        self.assertGreater(min(pixels.shape[:2]), 400)
        self.assertGreater((pixels.min(axis=2) < 0.9).mean(), 0.02)  # not white
        self.assertGreater(len(np.unique((255.0 * pixels).astype(int).reshape(-1, 3), axis=0)), 50)  # colours
        return [[float(number) for number in re.findall(r"-?\b\d+\.?\d*(?:e[-+]\d+)?", line)]
                for line in done.stdout.splitlines()]

    def test_each_example_has_a_test(self):
        tested = {name[len("test_"):] for name in dir(self) if name.startswith("test_")}
        self.assertEqual(tested - {"each_example_has_a_test"}, {file.stem for file in EXAMPLES.glob("*.py")})

    def test_slot_forces(self):
        for mean, expected in self.run_example("slot_forces"):
            self.assertLess(abs(mean - expected), 1e-3 * abs(expected))

    def test_tap_test(self):
        for found, true in zip(self.run_example("tap_test"), ((820.0, 0.02, 12.0), (1430.0, 0.015, 25.0))):
            for value, std, expected in zip(found[::2], found[1::2], true):
                self.assertLess(abs(value - expected), 4.0 * std)

    def test_chatter_free_speed(self):
        (lowest,), (speed, depth, probability) = self.run_example("chatter_free_speed")
        self.assertLessEqual(probability, 0.05)
        self.assertGreater(depth, 3.0 * lowest)
        self.assertLess(abs(speed * 3 / 60 / 920.0 - 0.5), 0.05)  # tooth passing at half the natural frequency

    def test_dynamometer(self):
        campaign = subset(shared("campaigns/none"), self.folder / "campaign", "tap_x", "tap_y", "tap_z", "slot_4500_030",
                          "slot_4500_100", "up_4500")
        lines = self.run_example("dynamometer", campaign)
        for (value, std), expected in zip(lines[:3], (1130.0, 1764.0, 2029.0)):
            self.assertLess(abs(value - expected), 1e-3 * expected)
        for (value, std), expected in zip((line[:2] for line in lines[4:]), (953.0, 357.0, 188.0, 17.3, 17.7, 0.72)):
            self.assertLess(abs(value - expected), 0.02 * expected)

    def test_why(self):
        campaign = subset(shared("campaigns/runout"), self.folder / "campaign", "slot_3000", "slot_4500_060",
                          "slot_4500_100")
        (angle, angle_std, offset, offset_std) = self.run_example("why", campaign)[-1]
        self.assertLess(abs(angle - 261.8), 4.0 * angle_std + 0.05)
        self.assertLess(abs(offset - 21.08), 4.0 * offset_std + 0.005)
