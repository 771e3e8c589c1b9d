"""Compares what other people's readers find in recordings and clouds (read.js) with what scanshade finds.

compare.py MODULES FILE... prints a row per file; the exit code tells whether all agree. MODULES is a folder with the npm packages
of `run`. Depth must be equal but for the last bit of a float (millimetres become metres in either precision), stamps to a
microsecond, points to a micrometre.
"""
import json
import os
import subprocess
import sys
import tempfile
import warnings
from pathlib import Path

import cv2
import numpy as np
import scanshade

HERE = Path(__file__).parent


def by_their_reader(modules, file, out):
    subprocess.run(["node", HERE / "read.js", file, out], check=True, env={**os.environ, "NODE_PATH": str(modules)})
    return json.loads((out / "index.json").read_text())


def of_rvl(data):
    """Wilson 2017, "Fast Lossless Depth Image Compression": runs of holes and of differences, in groups of three bits."""
    width, height = np.frombuffer(data[:8], np.uint32)
    words = np.frombuffer(data[8 : 8 + (len(data) - 8) // 4 * 4], np.uint32)
    nibbles = ((int(word) >> shift) & 15 for word in words for shift in range(28, -1, -4))

    def number():
        value = 0
        for place in range(0, 30, 3):
            nibble = next(nibbles)
            value |= (nibble & 7) << place
            if nibble < 8:
                break
        return value

    image, at, last = np.zeros(int(width) * int(height), np.uint16), 0, 0
    while at < image.size:
        at += number()
        for _ in range(number()):
            value = number()
            last += (value >> 1) ^ -(value & 1)
            image[at], at = last, at + 1
    return image.reshape(int(height), int(width))


def unpacked(row, out):
    """compressed_depth_image_transport: two floats a, b after four bytes, then millimetres, or a / z + b, as PNG or RVL."""
    data = (out / row["file"]).read_bytes()
    is_rvl = row["encoding"].endswith("rvl")
    image = of_rvl(data[12:]) if is_rvl else cv2.imdecode(np.frombuffer(data[12:], np.uint8), cv2.IMREAD_UNCHANGED)
    if not row["encoding"].startswith("32FC1"):
        return image
    a, b = np.frombuffer(data[4:12], np.float32)
    with np.errstate(divide="ignore"):
        return np.where(image > 0, a / (image.astype(np.float32) - b), 0).astype(np.float32)


def stored(row, out):
    if "width" not in row:
        return unpacked(row, out)
    kind = np.float32 if row["encoding"] == "32FC1" else np.uint16
    return np.fromfile(out / row["file"], kind).reshape(row["height"], row["width"])


def metres(image):
    """Integers are millimetres; 0 and what is not finite are holes."""
    z = image.astype(np.float32) if image.dtype == np.float32 else (image / np.float64(1000)).astype(np.float32)
    return np.where(np.isfinite(z) & (z > 0), z, 0)


def alike(a, b):
    return a.shape == b.shape and bool((np.abs(a - b) <= np.spacing(np.maximum(a, b))).all())


def recording(file, rows, out):
    capture = scanshade.open(file)
    by_stamp = {}
    for row in rows:
        by_stamp.setdefault(round(row["stamp_s"] * 1e6), []).append(row)
    equal = 0
    for listed, frame in zip(capture.info["frames"], capture):
        images = [stored(row, out) for row in by_stamp.get(round(listed["stamp_s"] * 1e6), [])]
        equal += any(alike(metres(image), frame.depth) for image in images)
    depth = {row["topic"] for row in rows}
    return equal == len(capture) > 0, f"{equal} of {len(capture)} depth images equal; {len(rows)} messages in {len(depth)} topics"


def cloud(file, rows, out):
    theirs = np.fromfile(out / rows[0]["file"]).reshape(-1, 3)
    ours = scanshade.open(file)[0].points
    if ours.shape != theirs.shape:
        return False, f"{len(ours)} points, {len(theirs)} theirs"
    worst = float(np.abs(ours - theirs).max()) if len(ours) else 0.0
    nodes = f" in {rows[0]['nodes']} nodes with {', '.join(rows[0]['added']) or 'nothing added'}" if "nodes" in rows[0] else ""
    return worst < 1e-6, f"{len(ours)} points{nodes}, worst difference {worst:.1e}"


def main():
    modules, files = sys.argv[1], sys.argv[2:]
    warnings.simplefilter("ignore")
    failed = 0
    for name in files:
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder)
            rows = by_their_reader(modules, name, out)
            good, words = (cloud if name.endswith(".laz") else recording)(name, rows, out)
        print(f"{'equal ' if good else 'DIFFER'} {name}: {words}", flush=True)
        failed += not good
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
