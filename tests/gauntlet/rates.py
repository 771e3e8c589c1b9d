#!/usr/bin/env python3
"""Rates of every check: rates.py ROWS.jsonl... FOLDER...

ROWS are lines that the gauntlets append to the file GAUNTLET_ROWS, a FOLDER is one of tests/gauntlet/valid. Data whose names
have an even checksum may choose limits; the table is of the others, or with --half choose of those. Intervals are Wilson's, 95 %.
"""
import argparse
import csv
import json
import math
import pathlib
import zlib
from collections import defaultdict

LARGEST_RMS, STATED_ENOUGH = 0.1, 1.33  # beyond both, a result that is nowhere perturbed is wrong


def rows_of(path):
    """Rows {data, perturbation, kind, found: [[check, value, limit, doubtful]]}; of a folder also rms and expected."""
    if path.is_file():
        yield from map(json.loads, path.read_text().splitlines())
        return
    for file in sorted(path.glob("*.json")):
        errors = [float(row["expected_error"]) for row in csv.DictReader(file.with_suffix(".csv").open()) if row["expected_error"]]
        rms = json.loads(file.with_suffix(".compare").read_text())["total"]["rms"]
        expected = math.sqrt(sum(e * e for e in errors) / len(errors)) if errors else math.nan
        found = [[f["check"], f["value"], f["limit"], f["doubtful"]]
                 for frame in json.loads(file.read_text())["frames"] for f in frame["found"]]
        wrong = not rms <= max(LARGEST_RMS, STATED_ENOUGH * expected)
        yield {"data": file.stem, "perturbation": "", "kind": "wrong" if wrong else "valid", "found": found,
               "rms": rms, "expected": expected}


def half_of(data):
    return "report" if zlib.crc32(data.encode()) % 2 else "choose"


def interval(hits, all_):
    if not all_:
        return "", 0, 1
    z, share = 1.96, hits / all_
    middle = (share + z * z / 2 / all_) / (1 + z * z / all_)
    half = z / (1 + z * z / all_) * math.sqrt(share * (1 - share) / all_ + z * z / 4 / all_ / all_)
    return f"{hits}/{all_}", max(0, middle - half), min(1, middle + half)


def area_under_curve(valid, wrong, rising):
    """Of the values of a check: the share of pairs in which the wrong one looks worse."""
    valid, wrong = ([v if rising else -v for v in values] for values in (valid, wrong))
    if not valid or not wrong:
        return math.nan
    ranked = sorted([(v, 0) for v in valid] + [(w, 1) for w in wrong])
    total, at = 0.0, 0
    while at < len(ranked):
        end = at
        while end < len(ranked) and ranked[end][0] == ranked[at][0]:
            end += 1
        below = sum(1 for _, wrong_one in ranked[:at] if not wrong_one)
        level = sum(1 for _, wrong_one in ranked[at:end] if not wrong_one)
        total += sum(wrong_one for _, wrong_one in ranked[at:end]) * (below + level / 2)
        at = end
    return total / len(valid) / len(wrong)


def doubts(row):
    return {check for check, _, _, doubtful in row["found"] if doubtful}


def print_checks(rows, names):
    by_kind = {kind: [row for row in rows if row["kind"] == kind] for kind in ("valid", "harmless", "wrong")}
    print("| check | valid doubted | harmless | wrong doubted | only by it | AUC |\n| --- | --- | --- | --- | --- | --- |")
    for name, rising in names.items():
        cells = []
        for kind in ("valid", "harmless", "wrong"):
            having = [row for row in by_kind[kind] if any(each[0] == name for each in row["found"])]
            cells.append(interval(sum(name in doubts(row) for row in having), len(having))[0])
        alone = sum(doubts(row) == {name} for row in by_kind["wrong"])
        values = {kind: [max((v if rising else -v) for c, v, _, _ in row["found"] if c == name and v is not None)
                         for row in by_kind[kind] if any(c == name and v is not None for c, v, _, _ in row["found"])]
                  for kind in ("valid", "wrong")}
        area = area_under_curve(values["valid"], values["wrong"], True)
        print(f"| `{name}` | {cells[0]} | {cells[1]} | {cells[2]} | {alone or ''} | {'' if math.isnan(area) else f'{area:.2f}'} |")
    for kind, of_kind in by_kind.items():
        text, low, high = interval(sum(bool(doubts(row)) for row in of_kind), len(of_kind))
        print(f"{kind}: {text} doubted, {100 * low:.1f} to {100 * high:.1f} %")


def print_errors(rows):
    """Expected errors against found ones, in eight bins of as many rows."""
    pairs = defaultdict(list)
    for row in rows:
        if "rms" in row and not math.isnan(row["expected"]):
            pairs["all"].append((row["expected"], row["rms"]))
            pairs[row["data"].split("-")[0]].append((row["expected"], row["rms"]))
    for name, of_name in pairs.items():
        of_name.sort()
        print(f"\n| {name}: rows | expected | found | found / expected |\n| --- | --- | --- | --- |")
        for k in range(8):
            part = of_name[k * len(of_name) // 8:(k + 1) * len(of_name) // 8]
            if part:
                expected, found = (math.sqrt(sum(p[i] ** 2 for p in part) / len(part)) for i in (0, 1))
                print(f"| {len(part)} | {expected:.3f} | {found:.3f} | {found / expected:.2f} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rows", nargs="+", type=pathlib.Path)
    parser.add_argument("--half", choices=("choose", "report", "both"), default="report")
    asked = parser.parse_args()
    rows = [row for path in asked.rows for row in rows_of(path)]
    rows = [row for row in rows if asked.half in ("both", half_of(row["data"]))]
    seen = {}
    for row in rows:
        for name, value, limit, doubtful in row["found"]:
            if doubtful and value is not None and limit is not None:
                seen[name] = value > limit
            seen.setdefault(name, True)
    print_checks(rows, seen)
    print_errors(rows)


if __name__ == "__main__":
    main()
