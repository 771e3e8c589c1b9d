#!/usr/bin/env python3
"""Tests of tests/bench/compare_methods.py: two methods on one small view of two scenes. SCANSHADE names the program."""

import base64
import contextlib
import hashlib
import io
import json
import os
import re
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = os.environ.get("SCANSHADE", str(ROOT / "build/scanshade"))
sys.path.insert(0, str(ROOT / "tests/bench"))
sys.dont_write_bytecode = True
import compare_methods  # noqa: E402
import comparison_page  # noqa: E402

MARKS = f"above\n\n{compare_methods.BEGIN}\nold\n{compare_methods.END}\n\nbelow\n"


def called(*words):
    """Exit code and what was said on stderr."""
    said = io.StringIO()
    with contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()):
        code = compare_methods.main([str(w) for w in words])
    return code, said.getvalue()


class MeasuredOnce(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.kept = tempfile.TemporaryDirectory()
        cls.folder = Path(cls.kept.name)
        cls.readme = cls.folder / "README.md"
        cls.readme.write_text(MARKS)
        cls.words = ["--program", PROGRAM, "-o", cls.folder, "--methods", "alchemy,luna", "--scenes", "office,thin", "--frames", 1,
                     "--sensors", "ideal,kinect", "--size", "64x48", "--rays", 8]
        cls.brief = cls.folder / "brief.md"
        cls.brief.write_text(MARKS.replace("old", "| `luna` high | an idea | a source | old |\n| `surfel` high | best | ours |"))
        cls.results = ["--readme", cls.readme, "--brief", cls.brief, "--json", cls.folder / "comparison.json"]
        # The bench's own progress goes to stderr as well; it is of no interest here.
        done = subprocess.run([sys.executable, ROOT / "tests/bench/compare_methods.py", *map(str, cls.words + cls.results)],
                              capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        cls.report = next(p for p in cls.folder.glob("*/bench.json"))
        cls.result = json.loads((cls.folder / "comparison.json").read_text())

    @classmethod
    def tearDownClass(cls):
        cls.kept.cleanup()

    def table(self):
        lines = [line for line in self.readme.read_text().splitlines() if line.startswith("| ")]
        cells = [[c.strip() for c in line.strip("|").split(" | ")] for line in lines if not line.startswith("| ---")]
        return cells[0], {row[0]: row for row in cells[1:]}

    def test_the_table_has_the_numbers_of_the_json_and_that_those_of_bench(self):
        heads, rows = self.table()
        bench = json.loads(self.report.read_text())
        self.assertEqual({name.split()[1] for name in rows}, {"high", "high,"}, "one quality is enough to compare methods")
        for row in self.result["rows"]:
            cells = rows.get(f"{row['method']} {row['name']}", heads)
            self.assertEqual(cells is heads, not compare_methods.in_readme(row["name"]))
            if cells is not heads:
                self.assertEqual(cells[heads.index(row["sensor"])], f"{row['rms']:.3f}, {row['held_out_rms']:.3f}")
            if row["sensor"] == "clean" and cells is not heads:
                self.assertEqual(cells[heads.index("bias")], f"{row['bias']:+.3f}")
                self.assertEqual(cells[heads.index("SSIM")], f"{row['ssim']:.2f}")
                self.assertEqual(cells[-1], compare_methods.ms_text(next(iter(row["ms"].values()))))
            group = next(g for g in bench["groups"] if g["sensor"] == row["sensor"])
            measured = next(c for c in group["configurations"] if (c["method"], c["name"]) == (row["method"], row["name"]))
            self.assertAlmostEqual(measured["difference"]["rms"], row["rms"], delta=6e-6)
            self.assertAlmostEqual(measured["held_out"]["rms"], row["held_out_rms"], delta=6e-6)
            for place in measured["errors"]["place"]:
                self.assertEqual(place["pixels"], row["place"][place["class"]][0])

    def test_errors_by_place_are_over_the_pixels_of_all_sensors(self):
        heads, rows = self.table()
        of_one = [row for row in self.result["rows"] if (row["method"], row["name"]) == ("luna", "high")]
        self.assertEqual(len(of_one), 2)
        places = [row["place"]["near depth edges"] for row in of_one]
        pixels = sum(p[0] for p in places)
        rms = (sum(p[0] * p[3] ** 2 for p in places) / pixels) ** 0.5
        self.assertEqual(rows["luna high"][heads.index("near depth edges")], f"{rms:.3f}")

    def test_the_brief_table_keeps_its_words_and_has_the_same_numbers(self):
        heads, rows = self.table()
        lines = self.brief.read_text().splitlines()
        row = rows["luna high"]
        numbers = " | ".join([*(row[heads.index(s)].split(", ")[0] for s in ("clean", "structured light")), row[-1]])
        self.assertIn(f"| `luna` high | an idea | a source | {numbers} |", lines)
        self.assertIn("| `surfel` high | best | ours |  |  |  |", lines, "not measured this time")

    def test_every_row_of_the_top_readme_has_numbers(self):
        text = (ROOT / "README.md").read_text().split(compare_methods.BEGIN)[1].split(compare_methods.END)[0]
        known = {f"{row['method']} {row['name']}" for row in json.loads((ROOT / "ao/comparison.json").read_text())["rows"]}
        rows = [line.split(" | ")[0].strip("| ").replace("`", "") for line in text.splitlines() if line.startswith("| `")]
        self.assertEqual([row for row in rows if row not in known], [])
        self.assertGreater(len(rows), 12)

    def test_what_is_around_the_table_stays(self):
        text = self.readme.read_text()
        self.assertTrue(text.startswith("above\n\n<!--") and text.endswith("-->\n\nbelow\n"))
        self.assertNotIn("old", text)

    def test_every_quality_of_every_chosen_method_is_there(self):
        names = {(row["method"], row["name"]) for row in self.result["rows"]}
        for method in ("alchemy", "luna"):
            for quality in ("lowest", "low", "medium", "high", "highest"):
                self.assertIn((method, quality), names)

    def test_the_page_is_whole_and_asks_for_nothing(self):
        page = (self.folder / "comparison.html").read_text()
        for tag in ("script", "style"):  # the policy allows what is there, by its hash, and nothing else
            text = page.partition(f"<{tag}>")[2].partition(f"</{tag}>")[0]
            digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
            self.assertIn(f"{tag}-src 'sha256-{digest}'", page)
        self.assertTrue(page.endswith("</html>\n"))
        self.assertEqual(page.count("<table class=\"sorted\">"), 2)
        self.assertEqual(page.count("<svg"), page.count("</svg>"))
        self.assertNotIn("no picture", page)
        self.assertIsNone(re.search(r'(src|href)="(?!data:)', page))
        for row in self.result["rows"]:
            self.assertIn(f'data-v="{row["rms"]!r}"', page)

    def test_captures_are_made_once(self):
        notes = {p: p.stat().st_mtime_ns for p in self.folder.glob("captures/*/truth/truth.json")}
        asked = compare_methods.parsed([str(w) for w in self.words])
        for path in notes:
            self.assertTrue(compare_methods.is_there(asked, path.parents[1], path.parents[1].name.split("-")[1]))
        asked.rays = 9
        self.assertFalse(any(compare_methods.is_there(asked, p.parents[1], "ideal") for p in notes))

    def test_a_second_device_adds_a_column(self):
        other = json.loads(self.report.read_text())
        other["device"] = "NVIDIA H100 80GB HBM3"
        for group in other["groups"]:
            for row in group["configurations"]:
                row["device_ms"]["median"] = 0.25
        path = self.folder / "other.json"
        path.write_text(json.dumps(other))
        out = self.folder / "both"
        out.mkdir()
        for name in ("README.md", "brief.md"):
            (out / name).write_text(MARKS)
        code, said = called("--render", self.report, path, "-o", out, "--readme", out / "README.md", "--brief", out / "brief.md", "--json",
                            out / "c.json")
        self.assertEqual(code, 0, said)
        self.assertIn("| ms, lavapipe | ms, H100 |", (out / "README.md").read_text())
        self.assertEqual((out / "README.md").read_text().count("| 0.25 |\n"), len(self.table()[1]))

    def test_names_of_others_stay_names(self):
        bad = '<script>alert(1)</script>"&|'
        report = json.loads(self.report.read_text())
        report["captures"][0]["name"] = bad
        report["captures"][0]["picture"] = "../README.md"
        for group in report["groups"]:
            group["configurations"][0]["name"] = bad
        for capture in report["captures"]:
            capture["configurations"][0]["name"] = "medium, " + bad
        result = compare_methods.merged([report])
        page = comparison_page.page(result, report, self.folder, 4)
        self.assertEqual(page.count("<script>"), 1, "the page's own")
        self.assertIn("&lt;script&gt;", page)
        self.assertIn("no picture of truth of", page, "a name that leads out of the folder is not read")
        self.assertIn('"&\\|', compare_methods.markdown(result))

    def test_what_cannot_be_rendered_is_named(self):
        path = self.folder / "bad.json"
        for text in ("", "[]", "{}", '{"program": "scanshade", "groups": [], "captures": []}'):
            path.write_text(text)
            code, said = called("--render", path, "-o", self.folder, *self.results)
            self.assertEqual(code, 1)
            self.assertIn("bad.json", said)
        unmarked = self.folder / "unmarked.md"
        unmarked.write_text("no marks")
        code, said = called("--render", self.report, "-o", self.folder, *self.results[2:], "--readme", unmarked)
        self.assertEqual(code, 1)
        self.assertIn("unmarked.md", said)

    def test_a_dry_run_prints_commands_alone(self):
        out = self.folder / "dry"
        done = subprocess.run([sys.executable, ROOT / "tests/bench/compare_methods.py", "--program", PROGRAM, "-o", out, "--dry-run",
                               "--device", "0", "--scenes", "office"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual([line.split()[1] for line in done.stdout.splitlines()], ["generate"] * 3 + ["bench"])
        self.assertFalse(out.exists())


if __name__ == "__main__":
    unittest.main()
