"""The page of results is made from records: the newest of each study, misses marked, invalid records refused in one line."""
import contextlib
import io
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

DOCS = pathlib.Path(__file__).resolve().parents[1]
sys.path.insert(0, str(DOCS / "site"))
import results_page  # noqa: E402

RECORD = {"study": "slot", "package": "smartmill_sim", "title": "a slot", "command": "./run", "commit": None, "date": "2026-01-02",
          "machine": None, "seed": 7, "parameters": None, "remark": None,
          "figures": [{"name": "gap", "value": 1.25, "unit": "N", "target": "1 N", "met": False}]}


class ResultsTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.page = self.folder / "results.md"

    def write(self, name, **changes):
        (self.folder / name).write_text(json.dumps({**RECORD, **changes}), encoding="utf-8")

    def run_page(self, *arguments):
        """Exit code and error text."""
        with contextlib.redirect_stderr(io.StringIO()) as errors:
            code = results_page.main([*arguments, "--records", str(self.folder), "--page", str(self.page)])
        return code, errors.getvalue()

    def text(self):
        self.assertEqual(self.run_page(), (0, ""))
        return self.page.read_text(encoding="utf-8")

    def test_newest_record_is_shown(self):
        self.write("slot_a.json", title="the new one", date="2026-03-01")
        self.write("slot_b.json", title="the old one", date="2026-02-28")
        self.write("slot_c.json", title="the one without a date", date=None)
        text = self.text()
        self.assertIn("the new one", text)
        self.assertNotIn("the old one", text)
        self.assertNotIn("without a date", text)

    def test_miss_is_marked(self):
        self.write("slot.json")
        self.assertIn("gap: 1.25 N (target 1 N: **missed**)", self.text())
        self.assertIn("1 of 1 figures with a verdict", " ".join(self.text().split()))
        self.write("slot.json", figures=[{**RECORD["figures"][0], "met": True}])
        self.assertNotIn("**missed**", self.text())

    def test_ledger_sums_runs_and_lists_failures(self):
        self.write("slot.json", ledger={"hours": 2, "kills": 3})
        self.write("other.json", study="other", ledger={"hours": 0.5})
        self.text()
        text = (self.folder / "ledger.md").read_text(encoding="utf-8")
        self.assertIn("| hours | 2.5 |", text)
        self.assertIn("| kills | 3 |", text)
        self.assertIn("gap: 1.25 N", text.split("Open failures")[1])
        self.write("slot.json", ledger={"hours": "2"})
        self.assertEqual(self.run_page()[0], 1)

    def test_digits_are_kept(self):
        (self.folder / "slot.json").write_text(json.dumps(RECORD).replace("1.25", "1.2500"), encoding="utf-8")
        self.assertIn("gap: 1.2500 N", self.text())

    def test_unknown_origin_is_stated(self):
        self.write("slot.json", command=None, date=None)
        for what in ("command", "date", "commit", "machine"):
            self.assertIn(f"{what} not recorded", self.text())

    def test_invalid_record_gives_one_line_with_file_and_key(self):
        figure = RECORD["figures"][0]
        for changes, key in (({"date": "yesterday"}, "date: 'yesterday'"), ({"seeds": 1}, "seeds: unknown key"),
                             ({"figures": [{**figure, "met": "yes"}]}, "figures[0].met: 'yes'"),
                             ({"figures": [{**figure, "target": None}]}, "figures[0].met: False"),
                             ({"figures": [{"name": "gap"}]}, "figures[0].value: not found"),
                             ({"figures": []}, "figures: expected at least one"),
                             ({"tables": [{"title": "t", "columns": ["a"], "rows": [["1", "2"]]}]}, "tables[0].rows[0]: expected a list of 1")):
            with self.subTest(key=key):
                self.write("slot.json", **changes)
                code, errors = self.run_page("--check")
                self.assertEqual(code, 1)
                self.assertEqual(errors.count("\n"), 1, errors)
                self.assertIn(f"{self.folder}/slot.json: {key}", errors)

    def test_no_json(self):
        (self.folder / "slot.json").write_text("{", encoding="utf-8")
        code, errors = self.run_page()
        self.assertEqual((code, errors.count("\n")), (1, 1))
        self.assertIn("slot.json: Expecting", errors)

    def test_two_records_of_one_date(self):
        self.write("a.json")
        self.write("b.json")
        self.assertIn("b.json: date: a second record", self.run_page()[1])

    def test_page_out_of_date(self):
        self.write("slot.json")
        self.assertEqual(self.run_page("--check")[0], 1)
        self.text()
        self.assertEqual(self.run_page("--check"), (0, ""))
        self.write("slot.json", title="another")
        self.assertIn("out of date", self.run_page("--check")[1])

    def test_collect_writes_a_record(self):
        run = self.folder / "run"
        (run / "cases").mkdir(parents=True)
        study = {"name": "tried", "program": "smartmill_studies/hammer_try", "arguments": ["--fast"], "cases": 3, "seed": 4, "build": "b",
                 "commit": "abc", "score": [], "times": ["seconds"], "picture": ""}
        (run / "study.json").write_text(json.dumps(study), encoding="utf-8")
        for k in range(3):
            case = {"case": k, "build": "b", "host": "here", "cpu": 1.0, "began": 86400.0 * 365, "seconds": 2.0,
                    "result": {"case": k, "gap": 1.0 + k, "right": k > 0, "seconds": 9.0}}
            (run / f"cases/{k}.json").write_text(json.dumps(case), encoding="utf-8")
        subprocess.run([DOCS.parent / "smartmill_studies/runner/collect", run], check=True, capture_output=True)
        record = results_page.read(run / "record.json")
        self.assertEqual((record["package"], record["date"], record["commit"], record["seed"]), ("smartmill_hammer", "1971-01-01", "abc", 4))
        self.assertEqual(record["command"], "rosrun smartmill_studies hammer_try --fast --cases 3 --seed 4")
        self.assertEqual({f["name"]: f["value"] for f in record["figures"]}, {"gap": "2 (1.1, 2.9)", "right": "2 of 3"})

    def test_page_of_the_tree(self):
        self.assertEqual(results_page.main(["--check"]), 0)


if __name__ == "__main__":
    unittest.main()
