"""The C interface by ctypes: structs, signatures and the error check. ctypes releases the GIL during every call."""

from __future__ import annotations

import ctypes as c
import os
from pathlib import Path
from typing import Any


class Error(Exception):
    """What the library refused, in the program's own sentence.

    `kind` is "misuse" (a setting or argument is impossible), "bad input" (a file, image or cloud is), "outage" (device
    lost, memory full; a later try may succeed) or "internal".
    """

    def __init__(self, sentence: str, kind: str = "misuse") -> None:
        super().__init__(sentence)
        self.kind = kind


class Setting(c.Structure):
    _fields_ = [("name", c.c_char_p), ("value", c.c_char_p)]


class Sized(c.Structure):
    """A struct whose first member is its size."""

    def __init__(self, **members: Any) -> None:
        super().__init__(size=c.sizeof(type(self)), **members)


class Camera(Sized):
    _fields_ = [
        ("size", c.c_size_t),
        *[(name, c.c_double) for name in ("fx", "fy", "cx", "cy")],
        *[(name, c.c_int32) for name in ("width", "height", "lens")],
        ("distortion", c.c_double * 5),
        ("denominator", c.c_double * 3),
    ]


class Depth(Sized):
    _fields_ = [
        ("size", c.c_size_t),
        ("values", c.c_void_p),
        *[(name, c.c_int32) for name in ("type", "width", "height")],
        *[(name, c.c_int64) for name in ("count", "row_bytes", "image_bytes")],
        ("depth_scale", c.c_char_p),
        ("camera", c.POINTER(Camera)),
        ("world_from_camera", c.c_void_p),
    ]


class Points(Sized):
    _fields_ = [
        ("size", c.c_size_t),
        ("points", c.c_void_p),
        ("points_type", c.c_int32),
        ("count", c.c_int64),
        ("points_bytes", c.c_int64),
        ("normals", c.c_void_p),
        ("normals_type", c.c_int32),
        ("normals_bytes", c.c_int64),
        ("triangles", c.c_void_p),
        ("triangle_count", c.c_int64),
        ("scanner", c.c_void_p),
        ("z_up", c.c_int32),
    ]


class Arrays(Sized):
    _fields_ = [
        ("size", c.c_size_t),
        *[(name, c.c_int64) for name in ("count", "height", "width")],
        *[(name, c.c_void_p) for name in ("visibility", "confidence", "normals")],
    ]


class FrameData(Sized):
    _fields_ = [
        ("size", c.c_size_t),
        ("name", c.c_char_p),
        ("width", c.c_int32),
        ("height", c.c_int32),
        ("depth_m", c.c_void_p),
        ("points", c.c_void_p),
        ("colour_width", c.c_int32),
        ("colour_height", c.c_int32),
        ("colour", c.c_void_p),
        ("colour_registered", c.c_int32),
        ("camera", c.POINTER(Camera)),
        ("world_from_camera", c.c_void_p),
    ]


class Heights(Sized):
    _fields_ = [
        ("size", c.c_size_t),
        ("values", c.c_void_p),
        *[(name, c.c_int32) for name in ("type", "width", "height")],
        ("row_bytes", c.c_int64),
        ("cell", c.c_double),
        ("path", c.c_char_p),
    ]


CONFIDENCE, NORMALS = 1, 2
UINT16, FLOAT32, FLOAT64 = 1, 2, 3
_KINDS = {1: "misuse", 2: "bad input", 4: "outage", 5: "internal"}


def _open() -> c.CDLL:
    """$SCANSHADE_LIBRARY, else the library in this package (a wheel has it), else that of the system."""
    beside = Path(__file__).parent / "libscanshade.so.0"
    name = os.environ.get("SCANSHADE_LIBRARY") or (str(beside) if beside.exists() else "libscanshade.so.0")
    try:
        return c.CDLL(name)
    except OSError as failure:
        raise ImportError(f"scanshade: {failure}; install libscanshade, or name it by SCANSHADE_LIBRARY") from None


library = _open()
_handle, _out, _text = c.c_void_p, c.POINTER(c.c_void_p), c.c_char_p
_SIGNATURES: dict[str, tuple[Any, list[Any]]] = {
    "version": (_text, []),
    "last_error": (_text, []),
    "settings": (_text, []),
    "devices": (_text, []),
    "session_open": (c.c_int, [c.POINTER(Setting), c.c_size_t, _out]),
    "session_close": (None, [_handle]),
    "session_settings": (_text, [_handle]),
    "compute_depth": (c.c_int, [_handle, c.POINTER(Depth), c.c_uint32, _out]),
    "compute_points": (c.c_int, [_handle, c.POINTER(Points), c.c_uint32, _out]),
    "compute_frame": (c.c_int, [_handle, _handle, c.c_uint32, _out]),
    "result_arrays": (c.c_int, [_handle, c.POINTER(Arrays)]),
    "result_info": (_text, [_handle]),
    "result_free": (None, [_handle]),
    "capture_open": (c.c_int, [_text, c.POINTER(Setting), c.c_size_t, _out]),
    "capture_close": (None, [_handle]),
    "capture_count": (c.c_int64, [_handle]),
    "capture_info": (_text, [_handle]),
    "capture_load": (c.c_int, [_handle, c.c_int64, _out]),
    "frame_get": (c.c_int, [_handle, c.POINTER(FrameData)]),
    "frame_free": (None, [_handle]),
    "refine": (c.c_int, [_text, c.POINTER(Setting), c.c_size_t, _out]),
    "refinement_camera": (c.c_int, [_handle, c.POINTER(Camera)]),
    "refinement_report": (_text, [_handle]),
    "refinement_summary": (_text, [_handle]),
    "refinement_trajectory": (_text, [_handle]),
    "refinement_free": (None, [_handle]),
    "relief": (c.c_int, [c.POINTER(Heights), c.POINTER(Setting), c.c_size_t, _out]),
    "relief_map": (c.c_void_p, [_handle, _text]),
    "relief_info": (_text, [_handle]),
    "relief_free": (None, [_handle]),
}
for _name, (_result, _arguments) in _SIGNATURES.items():
    _function = getattr(library, f"scanshade_{_name}")
    _function.restype, _function.argtypes = _result, _arguments


def call(name: str, *arguments: Any) -> None:
    """Calls a function that returns a status; raises Error where it failed."""
    status = getattr(library, f"scanshade_{name}")(*arguments)
    if status != 0:
        raise Error(library.scanshade_last_error().decode(errors="replace"), _KINDS.get(status, "internal"))


def text(name: str, *arguments: Any) -> str:
    """Calls a function that returns text, or NULL on failure."""
    found = getattr(library, f"scanshade_{name}")(*arguments)
    if found is None:
        raise Error(library.scanshade_last_error().decode(errors="replace"), "internal")
    return found.decode(errors="replace")


class Handle:
    """Owns a handle of the library; frees it when the last reference goes."""

    def __init__(self, kind: str, open_with: str, *arguments: Any) -> None:
        self._free = getattr(library, f"scanshade_{kind}")
        self.value = c.c_void_p()
        self.process = os.getpid()
        call(open_with, *arguments, c.byref(self.value))

    def close(self) -> None:
        value, self.value = self.value, c.c_void_p()
        if value and self.process == os.getpid():  # a forked process cannot use its parent's device
            self._free(value)

    def __del__(self) -> None:
        if getattr(self, "value", None):
            self.close()
