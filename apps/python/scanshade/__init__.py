"""Ambient occlusion for recorded depth images and point clouds, and sky view of height fields.

Conventions: x right, y down, z forward; metres; depth is z along the optical axis, 0 = hole; pixel centres at integers;
poses are world_from_camera. Ambient occlusion is visibility: 1 = open, 0 = closed, NaN = no surface.

Settings are those of the program `scanshade run`, by name: `method="surfel"`, `radius=0.5`, `depth_noise="kinect"`. An
underscore stands for a dash. Names with a dot go in by `**{"surfel.downsampled": True}`. `scanshade.settings()` lists
all. Wrong ones raise `scanshade.Error` with the program's own sentence.
"""

from __future__ import annotations

import ctypes as c
import functools
import json
import os
import sys
import warnings
from typing import Any, Iterator, Mapping, Optional, Sequence, Union

import numpy as np

from . import _c
from ._c import Error

__all__ = [
    "Capture", "Doubt", "Error", "Frame", "ReliefMaps", "Result", "Session", "ambient_occlusion", "devices", "open",
    "point_ambient_occlusion", "refine_camera", "relief", "settings",
]  # fmt: skip
__version__: str = _c.text("version")

Value = Union[str, bool, int, float]


class Doubt(UserWarning):
    """Why values may be wrong. `warnings.simplefilter("error", scanshade.Doubt)` makes it an exception."""


def __dir__() -> list[str]:
    return [*__all__, "__version__"]


def _warn_of_doubts(result: Result) -> None:
    """Where the caller's line is not in this file."""
    for frame in result.info["frames"]:
        for doubt in frame["doubts"]:
            name = f"image {frame['name']}: " if len(result.info["frames"]) > 1 else ""
            warnings.warn(name + doubt, Doubt, stacklevel=_callers_level())


def _callers_level() -> int:
    frame, level = sys._getframe(1), 1
    while frame.f_back is not None and frame.f_code.co_filename == __file__:
        frame, level = frame.f_back, level + 1
    return level


def _array(values: Any) -> np.ndarray:
    """Of lists, of NumPy, and without a copy of what other libraries keep in the processor's memory (DLPack)."""
    if not isinstance(values, np.ndarray) and hasattr(values, "__dlpack__") and hasattr(np, "from_dlpack"):
        return np.from_dlpack(values)
    return np.asarray(values)


def _depth_images(depth: Any) -> np.ndarray:
    """(H, W) or (N, H, W) of uint16 or float32."""
    images = _array(depth)
    given = images.shape
    if images.ndim in (3, 4) and images.shape[-1] == 1:
        images = images[..., 0]
    if images.ndim not in (2, 3) or 0 in images.shape:
        raise Error(f"depth: shape {given} given, expected (H, W) or (N, H, W), maybe with a last axis of 1")
    if images.dtype in (np.uint16, np.float32):
        return images
    if images.dtype in (np.float16, np.float64):
        return images.astype(np.float32)
    if images.dtype.kind in "iu" and images.dtype.itemsize > 1:
        if images.max() > 65535:
            raise Error(f"depth: {images.dtype} up to {images.max()} given, expected integers of 0 .. 65535")
        return np.maximum(images, 0).astype(np.uint16)  # negative numbers mark holes
    raise Error(f"depth: {images.dtype} given, expected floats, or integers of 16 bits or more")


def _setting_text(value: Value) -> str:
    return str(value).lower() if isinstance(value, (bool, np.bool_)) else str(value)


def _settings(given: Mapping[str, Optional[Value]]) -> Any:
    """None means: not given."""
    pairs = [(name.replace("_", "-"), _setting_text(value)) for name, value in given.items() if value is not None]
    return (_c.Setting * len(pairs))(*[(name.encode(), value.encode()) for name, value in pairs])


def _camera(K: Any, distortion: Optional[Sequence[float]], fisheye: bool) -> _c.Camera:
    if isinstance(K, Mapping):
        missing = [name for name in ("fx", "fy", "cx", "cy") if name not in K]
        if missing:
            raise Error(f"K: {', '.join(missing)} missing among {', '.join(map(str, K))}")
        K = [K[name] for name in ("fx", "fy", "cx", "cy")]
    matrix = _array(K).astype(np.float64)
    if matrix.shape == (4,):
        fx, fy, cx, cy = matrix
    elif matrix.shape == (3, 3):
        if matrix[0, 1] != 0 or matrix[1, 0] != 0 or tuple(matrix[2]) != (0, 0, 1):
            raise Error(f"K: {matrix.tolist()} given, expected [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]")
        fx, fy, cx, cy = matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2]
    else:
        raise Error(f"K: shape {matrix.shape} given, expected (3, 3), or (4,): fx, fy, cx, cy")
    bends = [float(value) for value in (() if distortion is None else distortion)]
    if len(bends) > (4 if fisheye else 8):
        names = "k3, k4" if fisheye else "p1, p2, k3, k4, k5, k6"
        raise Error(f"distortion: {len(bends)} numbers given, expected k1, k2, {names}")
    camera = _c.Camera(fx=fx, fy=fy, cx=cx, cy=cy, lens=1 if fisheye else 2 if len(bends) > 5 else 0)
    camera.distortion[: len(bends[:5])] = bends[:5]
    camera.denominator[: len(bends[5:])] = bends[5:]
    return camera


def _matrix(camera: _c.Camera) -> np.ndarray:
    return np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]])


def _view(address: Optional[int], shape: tuple[int, ...], kind: Any, owner: _c.Handle) -> Optional[np.ndarray]:
    """The library's memory as an array without a copy. The array keeps its owner alive, and is not to be written."""
    if not address or 0 in shape:
        return None
    buffer = (np.ctypeslib.as_ctypes_type(kind) * int(np.prod(shape))).from_address(address)
    buffer.owner = owner
    array = np.frombuffer(buffer, dtype=kind).reshape(shape)
    array.flags.writeable = False
    return array


class Result:
    """Values of one call. Arrays are read-only views of the library's memory; they stay valid as long as they live.

    ao:          float32, 0 .. 1, NaN = no surface: (H, W), (N, H, W), or (N,) for points
    confidence:  the same shape: how far each value can be believed, 0 .. 1 (1 - expected error / 0.3); None where not asked for
    normals:     the same shape and 3: unit normals in the space of the points, NaN = none; None where not asked for
    """

    def __init__(self, handle: _c.Handle, shape: Optional[tuple[int, ...]] = None) -> None:
        self._handle = handle
        arrays = _c.Arrays()
        _c.call("result_arrays", handle.value, c.byref(arrays))
        if shape is None:  # of a frame: its own
            shape = (arrays.width,) if arrays.height == 1 else (arrays.height, arrays.width)
        ao = _view(arrays.visibility, shape, np.float32, handle)
        assert ao is not None
        self.ao: np.ndarray = ao
        self.confidence = _view(arrays.confidence, shape, np.float32, handle)
        self.normals = _view(arrays.normals, (*shape, 3), np.float32, handle)

    @functools.cached_property
    def info(self) -> dict[str, Any]:
        """Settings as used, device, depth_noise, radius, warnings; of each frame name, notes, warnings, doubts, coverage,
        mean_visibility, expected_error and ms."""
        return json.loads(_c.text("result_info", self._handle.value))

    @property
    def settings(self) -> dict[str, Any]:
        """Every setting that shaped the values, as used."""
        return self.info["settings"]

    @property
    def doubts(self) -> list[str]:
        """Why values may be wrong, as sentences, of all images; empty = no reason known."""
        return [doubt for frame in self.info["frames"] for doubt in frame["doubts"]]

    def __repr__(self) -> str:
        told = f", {len(self.doubts)} doubts" if self.doubts else ""
        return f"<scanshade.Result: ao {self.ao.shape}, mean {np.nanmean(self.ao) if np.isfinite(self.ao).any() else np.nan:.3f}{told}>"


def _outputs(confidence: bool, normals: bool) -> int:
    return _c.CONFIDENCE * bool(confidence) | _c.NORMALS * bool(normals)


def _rows(values: Any, name: str, count: Optional[int] = None) -> tuple[np.ndarray, int]:
    """(N, 3) floats whose rows may lie apart, and their type in C."""
    array = _array(values)
    if array.ndim != 2 or array.shape[1] != 3 or (count is not None and len(array) != count):
        raise Error(f"{name}: shape {array.shape} given, expected ({'N' if count is None else count}, 3)")
    if array.dtype not in (np.float32, np.float64):
        array = array.astype(np.float64)
    if array.strides[1] != array.itemsize or array.strides[0] <= 0:
        array = np.ascontiguousarray(array)
    return array, _c.FLOAT32 if array.dtype == np.float32 else _c.FLOAT64


class Session:
    """Settings, a device, and a method's compiled pipelines, kept between calls. Threads may share it.

    A process that was forked cannot use its parent's session: it makes its own.
    """

    def __init__(self, **settings: Optional[Value]) -> None:
        given = _settings(settings)
        self._handle = _c.Handle("session_close", "session_open", given, len(given))

    def __enter__(self) -> Session:
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()

    def close(self) -> None:
        """Gives device and memory back; no call may be under way."""
        self._handle.close()

    def _open(self) -> c.c_void_p:
        if not self._handle.value:
            raise Error("the session is closed")
        if self._handle.process != os.getpid():
            raise Error("the session belongs to another process: after a fork, make a new one, or use 'spawn'")
        return self._handle.value

    def __repr__(self) -> str:
        if not self._handle.value:
            return "<scanshade.Session: closed>"
        return f"<scanshade.Session: {self.settings.get('method', '')}>"

    @property
    def settings(self) -> dict[str, Any]:
        """All settings that shape results, as used."""
        return json.loads(_c.text("session_settings", self._open()))

    def ambient_occlusion(
        self,
        depth: Union[np.ndarray, Frame],
        K: Any = None,
        *,
        depth_scale: Optional[Value] = None,
        poses: Any = None,
        distortion: Optional[Sequence[float]] = None,
        fisheye: bool = False,
        confidence: bool = True,
        normals: bool = False,
    ) -> Result:
        """Ambient occlusion of depth images of one camera, or of a frame of a capture.

        depth:       (H, W) or (N, H, W), maybe with a last axis of 1: integers of 16 bits (0 and 65535 = hole), also in wider
                     types, or floats (0 and not finite = hole); an array, a tensor on the processor, or cap[i]
        K:           (3, 3) intrinsics, or fx, fy, cx, cy, or a dict of these; None for a frame
        depth_scale: units per metre, or mm, tum, sun, nyu, m; default millimetres of uint16, metres of float32
        poses:       (N, 4, 4) world_from_camera, for the setting sequence="on"; a pose with a NaN is none
        distortion:  k1, k2, p1, p2, k3, maybe k4, k5, k6; of a fisheye k1, k2, k3, k4
        """
        outputs, out = _outputs(confidence, normals), ("result_free",)
        if isinstance(depth, Frame):
            if any(given is not None for given in (K, depth_scale, poses, distortion)):
                raise Error("a frame of a capture has its own camera, scale and pose: give these to open()")
            result = Result(_c.Handle(*out, "compute_frame", self._open(), depth._handle.value, outputs))
            _warn_of_doubts(result)
            return result
        images = _depth_images(depth)
        if K is None:
            raise Error("K: the depth image has no camera: fx, fy, cx and cy are needed")
        if images.strides[-1] != images.itemsize or min(images.strides) <= 0:
            images = np.ascontiguousarray(images)
        count = images.shape[0] if images.ndim == 3 else 1
        camera = _camera(K, distortion, fisheye)
        given = _c.Depth(
            values=images.ctypes.data,
            type=_c.UINT16 if images.dtype == np.uint16 else _c.FLOAT32,
            width=images.shape[-1],
            height=images.shape[-2],
            count=count,
            row_bytes=images.strides[-2],
            image_bytes=images.strides[0] if images.ndim == 3 else 0,
            depth_scale=None if depth_scale is None else _setting_text(depth_scale).encode(),
            camera=c.pointer(camera),
        )
        matrices = None
        if poses is not None:
            matrices = np.ascontiguousarray(poses, dtype=np.float64)
            if matrices.shape != (count, 4, 4):
                raise Error(f"poses: shape {matrices.shape} given, expected ({count}, 4, 4)")
            given.world_from_camera = matrices.ctypes.data
        handle = _c.Handle(*out, "compute_depth", self._open(), c.byref(given), outputs)
        result = Result(handle, images.shape)
        _warn_of_doubts(result)
        return result

    def point_ambient_occlusion(
        self,
        points: Any,
        normals: Any = None,
        *,
        triangles: Any = None,
        scanner: Any = None,
        z_up: bool = False,
        confidence: bool = False,
        with_normals: bool = False,
    ) -> Result:
        """Ambient occlusion of every point, by rays from it; of a mesh with triangles, of its vertices.

        points, normals: (N, 3) float32 or float64; normals are estimated where there are none
        triangles:       (M, 3) indices of points
        scanner:         x, y, z of where the cloud was seen from
        z_up:            z is known to point to the sky
        """
        array, kind = _rows(points, "points")
        given = _c.Points(
            points=array.ctypes.data, points_type=kind, count=len(array), points_bytes=array.strides[0], z_up=int(z_up)
        )
        kept: list[np.ndarray] = [array]
        if normals is not None:
            directions, given.normals_type = _rows(normals, "normals", len(array))
            given.normals, given.normals_bytes = directions.ctypes.data, directions.strides[0]
            kept.append(directions)
        if triangles is not None:
            faces = np.ascontiguousarray(triangles, dtype=np.int32)
            if faces.ndim != 2 or faces.shape[1] != 3:
                raise Error(f"triangles: shape {faces.shape} given, expected (M, 3)")
            given.triangles, given.triangle_count = faces.ctypes.data, len(faces)
            kept.append(faces)
        if scanner is not None:
            place = np.ascontiguousarray(scanner, dtype=np.float64)
            if place.shape != (3,):
                raise Error(f"scanner: shape {place.shape} given, expected (3,)")
            given.scanner = place.ctypes.data
            kept.append(place)
        outputs = _outputs(confidence, with_normals)
        handle = _c.Handle("result_free", "compute_points", self._open(), c.byref(given), outputs)
        result = Result(handle, (len(array),))
        _warn_of_doubts(result)
        return result


@functools.lru_cache(maxsize=4)
def _kept_session(process: int, given: tuple[tuple[str, Value], ...]) -> Session:
    return Session(**dict(given))


def _session(given: Mapping[str, Optional[Value]]) -> Session:
    """A session of these settings; the last four are kept."""
    return _kept_session(os.getpid(), tuple(sorted((k, _setting_text(v)) for k, v in given.items() if v is not None)))


def ambient_occlusion(
    depth: Union[np.ndarray, Frame],
    K: Any = None,
    *,
    depth_scale: Optional[Value] = None,
    poses: Any = None,
    distortion: Optional[Sequence[float]] = None,
    fisheye: bool = False,
    confidence: bool = True,
    normals: bool = False,
    **settings: Optional[Value],
) -> Result:
    """Ambient occlusion of depth images: a Result with `ao`, float32 of the images' shape, 1 = open, 0 = closed, NaN = no surface.

    depth:       (H, W) or (N, H, W) images along z: integers of 16 bits, in mm unless depth_scale says otherwise, or floats
                 in m; 0 = hole. Or a frame of a capture, cap[i], which has its own camera.
    K:           (3, 3) intrinsics in pixels, or fx, fy, cx, cy
    depth_scale, poses, distortion, fisheye, confidence, normals: as of Session.ambient_occlusion
    settings:    of `scanshade run`, by name: radius=0.5 (m), method="surfel"; scanshade.settings() lists them

    Raises Error for wrong shapes, types and settings. Warns (Doubt) where values may be wrong. The sessions of the last four
    settings are kept.

    >>> result = scanshade.ambient_occlusion(depth_mm, [525, 525, 319.5, 239.5], radius=0.5)
    >>> shaded = colour * result.ao[..., None]
    """
    return _session(settings).ambient_occlusion(
        depth, K, depth_scale=depth_scale, poses=poses, distortion=distortion, fisheye=fisheye, confidence=confidence,
        normals=normals,
    )  # fmt: skip


def point_ambient_occlusion(
    points: Any,
    normals: Any = None,
    radius: Optional[float] = None,
    sky: bool = False,
    *,
    triangles: Any = None,
    scanner: Any = None,
    z_up: bool = False,
    **settings: Optional[Value],
) -> np.ndarray:
    """Visibility of every point, float32 (N,), 1 = open, 0 = closed, NaN = no valid point.

    points:    (N, 3) floats; rows with NaN are no points
    normals:   (N, 3), or None: estimated
    radius:    in the unit of the points; None = from their extent and spacing
    sky:       the share of the sky that a point sees, at any distance
    triangles, scanner, z_up: as of Session.point_ambient_occlusion

    Raises Error for wrong shapes and settings. Warns (Doubt) where values may be wrong.

    >>> visibility = scanshade.point_ambient_occlusion(points, radius=0.2)
    """
    given = {"cloud.radius": radius, "cloud.sky": sky or None, **settings}
    return _session(given).point_ambient_occlusion(points, normals, triangles=triangles, scanner=scanner, z_up=z_up).ao


class Frame:
    """One frame of a capture, decoded. Arrays are read-only views of the library's memory; None = there is none.

    depth:             (H, W) float32 metres, 0 = hole
    points:            (N, 3), or (H, W, 3) of an organised cloud, float64, NaN = invalid
    colour:            (H, W, 3) uint8 red, green, blue, or one per point
    K, distortion:     (3, 3) intrinsics and the lens: k1, k2, p1, p2, k3, maybe k4, k5, k6, or four of a fisheye
    world_from_camera: (4, 4) float64
    """

    def __init__(self, handle: _c.Handle) -> None:
        self._handle = handle
        data = _c.FrameData()
        _c.call("frame_get", handle.value, c.byref(data))
        height, width = data.height, data.width
        grid = (width,) if height == 1 and data.points else (height, width)
        self.name: str = data.name.decode(errors="replace")
        self.depth = _view(data.depth_m, (height, width), np.float32, handle)
        self.points = _view(data.points, (*grid, 3), np.float64, handle)
        of_colour = grid if data.points else (data.colour_height, data.colour_width)
        stored = _view(data.colour, (*of_colour, 3), np.uint8, handle)
        self.colour = None if stored is None else stored[..., ::-1]
        self.colour_registered: Optional[bool] = {0: False, 1: True}.get(data.colour_registered)
        self.K: Optional[np.ndarray] = None
        self.distortion: Optional[np.ndarray] = None
        self.fisheye = False
        if data.camera:
            camera = data.camera.contents
            self.K, self.fisheye = _matrix(camera), camera.lens == 1
            denominator = camera.denominator[:] if camera.lens == 2 else []
            self.distortion = np.array(camera.distortion[: 4 if self.fisheye else 5] + denominator)
        self.world_from_camera = _view(data.world_from_camera, (4, 4), np.float64, handle)

    def __repr__(self) -> str:
        what = f"depth {self.depth.shape}" if self.depth is not None else f"points {self.points.shape}"
        return f"<scanshade.Frame {self.name!r}: {what}>"


class Capture(Sequence[Frame]):
    """A recording: a folder, a depth image or a cloud file. `len()` and `[]` make it a torch Dataset.

    Settings: camera, depth_scale, poses, colour, registered, association_limit, topic, confidence_min. Nothing is decoded until a frame is
    taken. It can be pickled, so that worker processes open it again.
    """

    def __init__(self, path: Union[str, os.PathLike[str]], **settings: Optional[Value]) -> None:
        self.path, self._given = os.fspath(path), settings
        given = _settings(settings)
        self._handle = _c.Handle("capture_close", "capture_open", os.fsencode(self.path), given, len(given))

    def __repr__(self) -> str:
        return f"<scanshade.Capture {self.path!r}: {self.info['kind']}, {len(self)} frames>"

    def __reduce__(self) -> Any:
        return functools.partial(Capture, self.path, **self._given), ()

    def __len__(self) -> int:
        return _c.library.scanshade_capture_count(self._handle.value)

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        place = int(index) + (len(self) if index < 0 else 0)
        if not 0 <= place < len(self):
            raise IndexError(f"frame {index} of {len(self)}")
        return Frame(_c.Handle("frame_free", "capture_load", self._handle.value, place))

    def __iter__(self) -> Iterator[Frame]:
        return (self[i] for i in range(len(self)))

    @functools.cached_property
    def info(self) -> dict[str, Any]:
        """kind, camera, depth_scale, registered, warnings, and the name and stamp_s of every frame."""
        return json.loads(_c.text("capture_info", self._handle.value))


def open(path: Union[str, os.PathLike[str]], **settings: Optional[Value]) -> Capture:
    """Opens a capture in any of the program's formats."""
    return Capture(path, **settings)


def refine_camera(
    path: Union[str, os.PathLike[str]], **settings: Optional[Value]
) -> tuple[np.ndarray, dict[str, Any]]:
    """What the program's `refine` does: K (3, 3), and the report.

    path: a capture, or a folder of pictures with the setting board="9x6". The report is what `refine` writes as
    camera.json, and "summary" (text) and "trajectory" (refined poses, TUM's format) besides.
    """
    given = _settings(settings)
    handle = _c.Handle("refinement_free", "refine", os.fsencode(os.fspath(path)), given, len(given))
    camera = _c.Camera()
    _c.call("refinement_camera", handle.value, c.byref(camera))
    report = json.loads(_c.text("refinement_report", handle.value))
    report["summary"] = _c.text("refinement_summary", handle.value)
    report["trajectory"] = _c.text("refinement_trajectory", handle.value)
    return _matrix(camera), report


class ReliefMaps(dict[str, np.ndarray]):
    """Maps by name, read-only float32 (H, W), NaN = no data, and `info`: cell, x0, y0 (north-west corner), unit_m, epsg, notes."""

    def __init__(self, handle: _c.Handle) -> None:
        self.info: dict[str, Any] = json.loads(_c.text("relief_info", handle.value))
        shape = (self.info["height"], self.info["width"])
        for name in self.info["maps"]:
            address = _c.library.scanshade_relief_map(handle.value, name.encode())
            values = _view(address, shape, np.float32, handle)
            assert values is not None
            self[name] = values


def relief(
    dem: Union[np.ndarray, str, os.PathLike[str]],
    cell: Optional[float] = None,
    *,
    write: Union[str, Sequence[str]] = "svf",
    **settings: Optional[Value],
) -> ReliefMaps:
    """Sky view, openness, dominance and AO of heights seen from above: a dict of float32 (H, W) by the names in `write`.

    dem:      (H, W) heights in metres, rows from north to south, columns from west to east, not finite = no data; integers, too.
              Or the path of a GeoTIFF or .vrt, which has its own units and place
    cell:     side of a cell in metres; None for a path
    write:    names of maps, in a list or between commas: svf and asvf (0 .. 1), openness and openness-neg (degrees, 90 on a
              plane), dominance (1 on a level plane), ao (visibility, 1 = open), error (expected RMSE of svf), dtm
              (heights), source (0 = no data, 1 = measured)
    settings: of `scanshade relief`, by name: radius=10 (m; 0 = 10 cells), directions=16, definition="horizontal", profile="rvt"

    Values have the bits that the program writes. Raises Error for wrong shapes, types, files and settings. Warns (Doubt) of what
    a file leaves open.

    >>> maps = scanshade.relief(heights, cell=0.5, write=["svf", "openness"], radius=10)
    >>> maps["svf"]
    """
    names = write if isinstance(write, str) else ",".join(write)
    given = _settings({"write": names, **settings})
    if isinstance(dem, (str, os.PathLike)):
        if cell is not None:
            raise Error(f"cell: {cell} given, but {os.fspath(dem)} has its own")
        asked = _c.Heights(path=os.fsencode(dem))
    else:
        heights = _array(dem)
        if heights.ndim != 2 or 0 in heights.shape:
            raise Error(f"dem: shape {heights.shape} given, expected (H, W)")
        if heights.dtype.kind not in "iuf":
            raise Error(f"dem: {heights.dtype} given, expected numbers")
        if cell is None:
            raise Error("cell: the side of a cell in metres is needed")
        if heights.dtype not in (np.float32, np.float64):
            heights = heights.astype(np.float32 if heights.dtype == np.float16 else np.float64)
        if heights.strides[1] != heights.itemsize or heights.strides[0] <= 0:
            heights = np.ascontiguousarray(heights)
        asked = _c.Heights(
            values=heights.ctypes.data,
            type=_c.FLOAT32 if heights.dtype == np.float32 else _c.FLOAT64,
            width=heights.shape[1],
            height=heights.shape[0],
            row_bytes=heights.strides[0],
            cell=float(cell),
        )
    maps = ReliefMaps(_c.Handle("relief_free", "relief", c.byref(asked), given, len(given)))
    for note in maps.info["notes"]:
        warnings.warn(note, Doubt, stacklevel=_callers_level())
    return maps


def settings() -> list[dict[str, Any]]:
    """Every setting of sessions, captures, refine_camera and relief: for, name, help, default, unit, low, high, choices."""
    return json.loads(_c.text("settings"))


def devices() -> list[dict[str, Any]]:
    """The Vulkan devices: index, name, kind, driver, api, and why one is unusable."""
    return json.loads(_c.text("devices"))
