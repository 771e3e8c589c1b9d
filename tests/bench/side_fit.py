#!/usr/bin/env python3
"""Fits the weights of ao/cloud/sides/side_score.cpp: side_fit.py ROWS.jsonl... (lines of `developers_bench sides`; needs numpy)

Prints the weights, and rates of five folds, each of scenes that its weights were not fitted to: all clouds, and those whose
sides are right relative to each other, so that a right answer exists. Kinds of scenes count alike.
"""
import collections
import json
import pathlib
import sys
import zlib

import numpy as np

RANDOM = ("room", "body", "things", "hills")
DOUBTED = 0.1


def rows_from(files):
    rows = [json.loads(line) for file in files for line in pathlib.Path(file).read_text().splitlines()]
    without_up = {row["name"]: row for row in rows if not row["up"]}
    for row in rows:
        kind, seed = row["name"].split("-")[:2]
        row["kind"] = "frames" if "frames" in row["name"] else kind if kind in RANDOM else "scene"
        row["scene"] = kind + seed
        # With `up` known, planes may face up whatever the answer; the same cloud without it tells which is right.
        same = without_up[row["name"]]
        row["inner_right"] = (same["right"] > 0.5) == same["inner"]
        row["clear"] = not 0.1 < same["right"] < 0.9
        row["weight"] = abs(2 * same["right"] - 1)
        if row["kind"] == "hills" and not row["up"]:
            row["weight"] /= 2  # hills are as good as hollows; the program mostly knows where the sky is
    return [row for row in rows if row["features"][3] > 0]


def fitted(features, right, weights, drawn_to_zero=3.0):
    """A logistic regression by Newton's steps, on features of unit deviation."""
    mean, deviation = features.mean(0), np.maximum(features.std(0), 1e-9)
    mean[0], deviation[0] = 0, 1
    z = (features - mean) / deviation
    ridge = drawn_to_zero * np.eye(z.shape[1])
    ridge[0, 0] = 0
    found = np.zeros(z.shape[1])
    for _ in range(60):
        p = 1 / (1 + np.exp(-np.clip(z @ found, -30, 30)))
        step = np.linalg.solve((z * (weights * p * (1 - p))[:, None]).T @ z + ridge, z.T @ (weights * (p - right)) + ridge @ found)
        found -= step
        if abs(step).max() < 1e-7:
            break
    raw = found / deviation
    raw[0] = found[0] - (found[1:] * mean[1:] / deviation[1:]).sum()
    return raw


def print_rates(title, rows, probabilities):
    print(f"\n| {title} | clouds | wrong | right and doubted | wrong and not doubted |\n| --- | --- | --- | --- | --- |")
    counts = collections.OrderedDict()
    for row, p in zip(rows, probabilities):
        right, doubted = (p > 0.5) == row["inner_right"], DOUBTED < p < 1 - DOUBTED
        for name in (row["kind"] + (", up known" if row["up"] else ""), "all"):
            count = counts.setdefault(name, np.zeros(4, int))
            count += [1, not right, right and doubted, not right and not doubted]
    for name, count in sorted(counts.items()):
        print(f"| {name} | " + " | ".join(map(str, count)) + " |")


def main():
    rows = rows_from(sys.argv[1:])
    features = np.array([row["features"] for row in rows])
    right = np.array([row["inner_right"] for row in rows], float)
    of_kind = collections.Counter(row["kind"] for row in rows)
    # Kinds count alike, those of few clouds less.
    weights = np.array([row["weight"] / max(of_kind[row["kind"]], 600) for row in rows])
    weights /= weights.mean()
    fold = np.array([zlib.crc32(row["scene"].encode()) % 5 for row in rows])
    held_out = np.zeros(len(rows))
    for k in range(5):
        of_others = fitted(features[fold != k], right[fold != k], weights[fold != k])
        held_out[fold == k] = 1 / (1 + np.exp(-np.clip(features[fold == k] @ of_others, -30, 30)))
    print("weights:", ", ".join(f"{w:.2f}" for w in fitted(features, right, weights)))
    print_rates("all", rows, held_out)
    clear = np.array([row["clear"] for row in rows])
    print_rates("with a right answer", [row for row in rows if row["clear"]], held_out[clear])


if __name__ == "__main__":
    main()
