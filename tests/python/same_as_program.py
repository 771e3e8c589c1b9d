#!/usr/bin/env python3
"""Whether captures get the same values, doubts and warnings from the program as from the Python module, with defaults.

    SCANSHADE_PROGRAM=build/scanshade SCANSHADE_LIBRARY=build/libscanshade.so PYTHONPATH=apps/python \\
        tests/python/same_as_program.py CAPTURE...

Prints a line for each capture: its number of frames, and each difference. Ends with 1 if there is any.
"""

import json
import os
import pathlib
import subprocess
import sys
import tempfile

import numpy as np

import scanshade


def program_result(path, out, *words):
    """manifest.json of a run with maps as floats; None, and why, where the program refuses the capture."""
    command = [os.environ["SCANSHADE_PROGRAM"], "run", path, "-o", out, "--page", "no", "--format", "tiff"]
    done = subprocess.run([*map(str, command), *map(str, words)], capture_output=True, text=True)
    manifest = pathlib.Path(out, "manifest.json")
    return (json.loads(manifest.read_text()), "") if manifest.exists() else (None, done.stderr)


def written(path):
    """A float map that the program wrote, read as depth in metres: NaN becomes 0, other values keep their bits."""
    return scanshade.open(path, camera="525,525,319.5,239.5", depth_scale="m")[0].depth


def same_bits(values, path):
    return np.array_equal(np.nan_to_num(values).view(np.uint32), written(path).view(np.uint32))


def differences(path, *words, opening=None, session=None):
    """Sentences on what differs, and the number of frames that were compared.

    words: flags of the program; opening, session: the same as settings of open() and Session.
    """
    with tempfile.TemporaryDirectory() as out:
        manifest, refusal = program_result(path, out, *words)
        try:
            capture = scanshade.open(path, **(opening or {}))
        except scanshade.Error as error:
            return ([] if manifest is None else [f"only the module refuses it: {error}"]), 0
        if manifest is None:
            return [f"only the program refuses it: {refusal.strip().splitlines()[-1]}"], 0
        found, settings = [], scanshade.Session(**(session or {}))
        for index, row in enumerate(manifest["frames"]):
            found += [f"{row['name']}: {sentence}" for sentence in frame_differences(capture, index, row, settings, pathlib.Path(out))]
        return found, len(manifest["frames"])


def frame_differences(capture, index, row, session, out):
    try:
        frame = capture[index]
        result = session.ambient_occlusion(frame)
    except scanshade.Error as error:
        return [] if row["status"] == "failed" else [f"only the module fails: {error}"]
    if row["status"] == "failed":
        return [f"only the program fails: {row['why']}"]
    found, own = [], result.info["frames"][0]
    for name in ("doubts", "notes", "warnings"):
        if own[name] != row.get(name, []):
            found.append(f"{name}: the program has {row.get(name, [])}, the module {own[name]}")
    for name in ("coverage", "mean_visibility", "expected_error"):
        a, b = own[name], row.get(name)
        if (a is None) != (b is None) or (a is not None and abs(a - b) > 0.51e-4):
            found.append(f"{name}: the program has {b}, the module {a}")
    if frame.points is not None and frame.points.ndim == 2:
        return found  # the program's maps are of the camera's pixels, the module's values of points
    for kind, values in (("ao", result.ao), ("confidence", result.confidence)):
        file = out / kind / f"{row['name']}.tiff"
        if file.exists() and not same_bits(values, file):
            found.append(f"{kind}: values differ")
    return found


def main(paths):
    bad = 0
    for path in paths:
        found, frames = differences(path)
        bad += bool(found)
        print(f"{path}: {frames} frames, {'same' if not found else f'{len(found)} differences'}", flush=True)
        for sentence in found[:5]:
            print(f"  {sentence}")
    print(f"{len(paths)} captures, {bad} that differ")
    return bad > 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
