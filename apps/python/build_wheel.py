"""Builds the wheel: the module with libscanshade.so in it, for every Python 3 and NumPy of this platform.

    python3 apps/python/build_wheel.py build [-o FOLDER]

It is the build backend of pyproject.toml, too, so that `pip wheel apps/python` works after a build; SCANSHADE_BUILD names
the build folder then. The library inside needs the system's OpenCV, Ceres, Vulkan and so on: apps/setup lists them.
"""

import argparse
import base64
import hashlib
import os
import re
import sysconfig
import zipfile
from pathlib import Path

here = Path(__file__).resolve().parent


def version():
    return re.search(r"VERSION ([0-9.]+)", (here.parents[1] / "CMakeLists.txt").read_text().split("project(")[1])[1]


def build(build_folder, out):
    """Returns the name of the wheel. SystemExit where there is no library."""
    library = Path(build_folder) / "libscanshade.so.0"
    if not library.exists():
        raise SystemExit(f"{library}: no such file; build it first: ninja -C {build_folder} library")
    platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
    tag, name = f"py3-none-{platform}", f"scanshade-{version()}"
    info = f"{name}.dist-info"
    files = {f"scanshade/{p.name}": p.read_bytes() for p in sorted((here / "scanshade").iterdir()) if p.is_file()}
    files["scanshade/libscanshade.so.0"] = library.read_bytes()
    files[f"{info}/METADATA"] = (
        f"Metadata-Version: 2.1\nName: scanshade\nVersion: {version()}\nRequires-Python: >=3.9\nRequires-Dist: numpy\n"
        "Summary: Ambient occlusion for recorded depth images and point clouds\nLicense: not yet chosen\n"
    ).encode()
    files[f"{info}/WHEEL"] = f"Wheel-Version: 1.0\nGenerator: scanshade\nRoot-Is-Purelib: false\nTag: {tag}\n".encode()
    record = ""
    for path, data in files.items():
        digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
        record += f"{path},sha256={digest},{len(data)}\n"
    files[f"{info}/RECORD"] = (record + f"{info}/RECORD,,\n").encode()
    wheel = f"{name}-{tag}.whl"
    Path(out).mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(Path(out) / wheel, "w", zipfile.ZIP_DEFLATED) as archive:
        for path, data in files.items():
            archive.writestr(zipfile.ZipInfo(path), data, zipfile.ZIP_DEFLATED)  # no times: same input, same bytes
    return wheel


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    """PEP 517."""
    return build(os.environ.get("SCANSHADE_BUILD", here.parents[1] / "build"), wheel_directory)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("build", help="the folder that has libscanshade.so.0")
    parser.add_argument("-o", "--out", default=".", help="where the wheel goes")
    chosen = parser.parse_args()
    print(Path(chosen.out) / build(chosen.build, chosen.out))
