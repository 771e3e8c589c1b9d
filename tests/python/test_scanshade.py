"""The Python module against what the program writes for the same input, bit for bit; and its refusals."""

import os
import pickle
import resource
import struct
import subprocess
import threading

import numpy as np
import pytest

import scanshade
from same_as_program import differences

K = np.array([[525.0, 0, 319.5], [0, 525.0, 239.5], [0, 0, 1]])


def corner(width=640, height=480):
    """Two walls that meet in a vertical edge, and a hole; millimetres."""
    depth = np.repeat((2000 - 2 * np.abs(np.arange(width) - width // 2))[None], height, 0).astype(np.uint16)
    depth[10:30, 10:40] = 0
    return depth


def run(*words):
    subprocess.run([os.environ["SCANSHADE_PROGRAM"], *map(str, words)], check=True, capture_output=True)


def write_pgm(path, depth):
    with open(path, "wb") as file:
        file.write(b"P5 %d %d 65535\n" % depth.shape[::-1] + depth.astype(">u2").tobytes())


def written(path):
    """A float map that the program wrote, read as a depth image in metres: NaN becomes 0, other values keep their bits."""
    return scanshade.open(path, camera="525,525,319.5,239.5", depth_scale="m")[0].depth


def assert_same_bits(values, path):
    assert np.array_equal(np.nan_to_num(values).view(np.uint32), written(path).view(np.uint32))


@pytest.mark.parametrize("method", ["cacao", "surfel"])
@pytest.mark.parametrize("noise", ["none", "kinect", "auto"])
def test_values_have_the_bits_that_the_program_writes(tmp_path, method, noise):
    write_pgm(tmp_path / "depth.pgm", corner())
    run("run", tmp_path / "depth.pgm", "-o", tmp_path / "out", "--camera", "525,525,319.5,239.5", "--depth-scale", "mm",
        "--format", "tiff", "--write", "ao,confidence", "--method", method, "--depth-noise", noise)  # fmt: skip
    r = scanshade.ambient_occlusion(corner(), K, method=method, depth_noise=noise, depth_scale="mm")
    assert_same_bits(r.ao, tmp_path / "out/ao/depth.tiff")
    assert_same_bits(r.confidence, tmp_path / "out/confidence/depth.tiff")
    assert np.isnan(r.ao[15, 15]) and r.ao.dtype == np.float32


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    folder = tmp_path_factory.mktemp("recording") / "capture"
    run("generate", "office", "-o", folder, "--frames", 4, "--size", "160x120", "--truth=false")
    return folder


@pytest.mark.parametrize("sequence", ["off", "on"])
def test_frames_and_stacks_have_the_bits_that_the_program_writes(recording, tmp_path, sequence):
    run("run", recording, "-o", tmp_path, "--format", "tiff", "--write", "ao", "--method", "surfel",
        "--sequence", sequence)  # fmt: skip
    capture = scanshade.open(recording)
    assert len(capture) == 4
    given = {"method": "surfel", "sequence": sequence}
    frames = list(capture)
    stack = scanshade.ambient_occlusion(
        np.stack([f.depth for f in frames]), frames[0].K, poses=np.stack([f.world_from_camera for f in frames]), **given)
    assert stack.ao.shape == (4, 120, 160)
    for i, frame in enumerate(frames):
        file = tmp_path / "ao" / f"{frame.name}.tiff"
        expected = scanshade.open(file, camera="100,100,79.5,59.5", depth_scale="m")[0].depth
        for values in (scanshade.ambient_occlusion(frame, **given).ao, stack.ao[i]):
            assert np.array_equal(np.nan_to_num(values).view(np.uint32), expected.view(np.uint32))


def test_a_capture_can_be_pickled_and_sliced(recording):
    capture = pickle.loads(pickle.dumps(scanshade.open(recording)))
    assert [frame.name for frame in capture[1:3]] == [entry["name"] for entry in capture.info["frames"]][1:3]
    assert capture[-1].colour.shape == (120, 160, 3)
    with pytest.raises(IndexError):
        capture[4]


def test_arrays_outlive_their_result():
    values = scanshade.ambient_occlusion(corner(), K, depth_noise="none").ao
    again = scanshade.ambient_occlusion(corner(), K, depth_noise="none").ao
    assert np.array_equal(values, again, equal_nan=True) and not values.flags.writeable


def test_images_may_be_views_of_larger_ones():
    whole = corner()
    part, camera = whole[50:290, 100:420], (525, 525, 219.5, 189.5)
    a = scanshade.ambient_occlusion(part, camera, depth_noise="none").ao
    b = scanshade.ambient_occlusion(part.copy(), camera, depth_noise="none").ao
    assert np.array_equal(a, b, equal_nan=True)
    flipped = scanshade.ambient_occlusion(whole[:, ::-1], K, depth_noise="none").ao  # negative strides are copied
    copied = scanshade.ambient_occlusion(whole[:, ::-1].copy(), K, depth_noise="none").ao
    assert np.array_equal(flipped, copied, equal_nan=True)


def test_points_are_darker_in_a_corner():
    """A floor under a wall: open far from it, darker beside it; the same from float32 rows that lie apart."""
    i, j = (axis.ravel() / 100 for axis in np.mgrid[0:100, 0:100])
    points = np.concatenate([np.stack([i, j, 0 * i], 1), np.stack([0 * i, j, i], 1)])
    given = {"radius": 0.2, "cloud.outside": "2,0.5,2"}
    values = scanshade.point_ambient_occlusion(points, **given)
    assert values.shape == (20000,) and values[6050] > 0.95 > 0.75 > values[350]
    rows = np.zeros((20000, 5), np.float32)
    rows[:, :3] = points
    apart = scanshade.point_ambient_occlusion(rows[:, :3], **given)
    packed = scanshade.point_ambient_occlusion(rows[:, :3].copy(), **given)
    assert np.array_equal(apart, packed)


@pytest.mark.parametrize(
    "call, part",
    [
        (lambda: scanshade.Session(radiu=1), "--radiu: no such flag; did you mean --radius?"),
        (lambda: scanshade.Session(method="surfels"), "method: 'surfels' given"),
        (lambda: scanshade.Session(out="x"), "--out: is a setting of the program"),
        (lambda: scanshade.ambient_occlusion(corner().astype(complex), K), "complex128 given, expected floats, or integers"),
        (lambda: scanshade.ambient_occlusion(corner(), np.eye(4)), "K: shape (4, 4) given"),
        (lambda: scanshade.ambient_occlusion(corner(), K, depth_scale="miles"), "miles"),
        (lambda: scanshade.ambient_occlusion(corner(), K, poses=np.eye(4)), "poses: shape (4, 4) given"),
        (lambda: scanshade.ambient_occlusion(corner()[None], K, poses=2 * np.eye(4)[None]), "pose 0: expected"),
        (lambda: scanshade.point_ambient_occlusion(np.zeros((3, 2))), "points: shape (3, 2) given"),
        (lambda: scanshade.open("/nowhere"), "/nowhere: no such file or folder"),
        (lambda: scanshade.refine_camera("/nowhere"), "/nowhere"),
    ],
)
def test_mistakes_get_a_sentence(call, part):
    with pytest.raises(scanshade.Error) as refused:
        call()
    assert part in str(refused.value)


def test_a_closed_session_refuses():
    with scanshade.Session() as session:
        pass
    with pytest.raises(scanshade.Error, match="closed"):
        session.ambient_occlusion(corner(), K)


def test_threads_share_a_session_and_the_gil_is_released():
    with scanshade.Session(depth_noise="none") as session:
        alone = session.ambient_occlusion(corner(), K).ao
        found, turns, done = [], 0, threading.Event()

        def work():
            found.extend(session.ambient_occlusion(corner(), K).ao for _ in range(5))
            done.set()

        thread = threading.Thread(target=work)
        thread.start()
        while not done.wait(0.001):  # turns only while the other thread's call has let go of the interpreter
            turns += 1
        thread.join()
        assert turns > 5
        assert all(np.array_equal(values, alone, equal_nan=True) for values in found)


def test_memory_is_flat():
    small, camera = corner(64, 48), (50, 50, 31.5, 23.5)
    with scanshade.Session(depth_noise="none") as session:
        for _ in range(200):
            session.ambient_occlusion(small, camera)
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        for _ in range(1000):
            session.ambient_occlusion(small, camera)
        assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 4096  # KiB; a lost image each would be 24000


def test_settings_are_listed():
    names = {row["name"] for row in scanshade.settings() if row["for"] == "session"}
    assert {"method", "radius", "surfel.radius", "cloud.rays", "sequence.fuse", "device"} <= names
    assert "out" not in names


# What `run` decides before a capture's first frame: the library decides the same.


def test_a_small_scene_gets_a_small_radius(tmp_path):
    write_pgm(tmp_path / "depth.pgm", corner())
    units = 20000  # per metre: the scene is 0.1 m away
    found, frames = differences(
        tmp_path / "depth.pgm", "--camera", "525,525,319.5,239.5", "--depth-scale", units,
        opening={"camera": "525,525,319.5,239.5", "depth_scale": units})  # fmt: skip
    assert (found, frames) == ([], 1)
    r = scanshade.ambient_occlusion(corner(), K, depth_scale=units)
    assert r.info["radius"] < 0.5 and "the scene is only" in r.info["warnings"][0]
    assert scanshade.ambient_occlusion(corner(), K, depth_scale=units, radius=0.5).info["radius"] == 0.5


def test_a_noisy_cloud_of_one_camera_is_its_image(tmp_path):
    run("generate", "office", "-o", tmp_path / "capture", "--frames", 1, "--size", "320x240", "--sensor", "kinect", "--truth=false")
    frame = scanshade.open(tmp_path / "capture")[0]
    v, u = np.nonzero(frame.depth)
    z, k = frame.depth[v, u].astype(float), frame.K
    points = np.stack([(u - k[0, 2]) / k[0, 0] * z, (v - k[1, 2]) / k[1, 1] * z, z], 1)
    points = points[np.random.default_rng(1).permutation(len(points))[: len(points) // 2]]
    np.savetxt(tmp_path / "part.xyz", points, fmt="%.6f")
    found, frames = differences(tmp_path / "part.xyz")
    assert (found, frames) == ([], 1)
    r = scanshade.Session().ambient_occlusion(scanshade.open(tmp_path / "part.xyz")[0])
    assert any("computed as its image" in warning for warning in r.info["warnings"])


def test_depths_that_contradict_the_poses_are_doubtful(tmp_path):
    run("generate", "office", "-o", tmp_path / "capture", "--frames", 4, "--size", "320x240", "--step", 10, "--truth=false")
    right = scanshade.open(tmp_path / "capture")
    wrong = {"depth_scale": 2500}  # twice as far
    found, frames = differences(tmp_path / "capture", "--depth-scale", 2500, opening=wrong)
    assert (found, frames) == ([], 4)
    session = scanshade.Session()
    doubts = session.ambient_occlusion(scanshade.open(tmp_path / "capture", **wrong)[0]).doubts
    assert any("poses" in doubt for doubt in doubts)
    assert not any("poses" in doubt for doubt in session.ambient_occlusion(right[0]).doubts)
    # and of arrays
    depths, poses = np.stack([f.depth * 2 for f in right]), np.stack([f.world_from_camera for f in right])
    assert any("poses" in doubt for doubt in session.ambient_occlusion(depths, right[0].K, poses=poses).doubts)


class OnTheProcessor:
    """A tensor of another library."""

    def __init__(self, array):
        self.array = array

    def __dlpack__(self, **_):
        return self.array.__dlpack__()

    def __dlpack_device__(self):
        return self.array.__dlpack_device__()


@pytest.mark.parametrize(
    "given",
    [
        lambda mm: mm[..., None],
        lambda mm: mm.astype(np.int32),
        lambda mm: np.where(mm == 0, -1, mm.astype(np.int64)),
        lambda mm: mm.tolist(),
        lambda mm: OnTheProcessor(mm.astype(np.int32)),
    ],
    ids=["last_axis", "int32", "negative_holes", "lists", "dlpack"],
)
def test_depth_of_other_types_is_the_same_depth(given):
    depth = corner(160, 120)
    camera = {"fx": 131.0, "fy": 131.0, "cx": 79.5, "cy": 59.5}
    expected = scanshade.ambient_occlusion(depth, [131.0, 131.0, 79.5, 59.5]).ao
    found = scanshade.ambient_occlusion(given(depth), camera).ao
    assert np.array_equal(found, expected, equal_nan=True)


@pytest.mark.parametrize("kind", [np.float64, np.float16])
def test_floats_of_other_widths_are_metres(kind):
    metres = (corner(160, 120) / 1000).astype(kind)
    expected = scanshade.ambient_occlusion(metres.astype(np.float32), [131, 131, 79.5, 59.5]).ao
    assert np.array_equal(scanshade.ambient_occlusion(metres, [131, 131, 79.5, 59.5]).ao, expected, equal_nan=True)
    four = scanshade.ambient_occlusion(metres[None, ..., None], [131, 131, 79.5, 59.5]).ao
    assert np.array_equal(four, expected[None], equal_nan=True)


@pytest.mark.parametrize(
    "depth, why",
    [
        (np.zeros((6, 8), np.uint8), "depth: uint8 given"),
        (np.full((6, 8), 70000), "depth: int64 up to 70000 given"),
        (np.zeros((6, 8), bool), "depth: bool given"),
    ],
)
def test_what_is_no_depth_is_refused_by_its_type(depth, why):
    with pytest.raises(scanshade.Error, match=why):
        scanshade.ambient_occlusion(depth, [10, 10, 3.5, 2.5])
    with pytest.raises(scanshade.Error, match="K: fy, cx, cy missing"):
        scanshade.ambient_occlusion(np.ones((6, 8), np.float32), {"fx": 10})


def test_doubts_are_warnings_at_the_callers_line():
    with pytest.warns(scanshade.Doubt, match="every pixel is a hole") as told:
        result = scanshade.ambient_occlusion(np.zeros((60, 80), np.float32), [70, 70, 39.5, 29.5])
    assert result.doubts and told[0].filename == __file__
    with pytest.warns(scanshade.Doubt, match="5 points cannot show a surface"):
        scanshade.point_ambient_occlusion(np.random.default_rng(1).random((5, 3)))


def write_dem(path, heights):
    """float32 as a TIFF of one strip, without a place on the map: cells of 1 m."""
    tags = [(256, 4, heights.shape[1]), (257, 4, heights.shape[0]), (258, 3, 32), (259, 3, 1), (262, 3, 1), (273, 4, 8 + 2 + 120 + 4),
            (277, 3, 1), (278, 4, heights.shape[0]), (279, 4, heights.nbytes), (339, 3, 3)]  # fmt: skip
    entries = b"".join(struct.pack("<HHII", tag, kind, 1, value) for tag, kind, value in tags)
    path.write_bytes(b"II*\0\x08\0\0\0" + struct.pack("<H", len(tags)) + entries + bytes(4) + heights.tobytes())


@pytest.mark.parametrize("profile", ["exact", "rvt"])
def test_relief_has_the_bits_that_the_program_writes(tmp_path, profile):
    heights = np.random.default_rng(1).uniform(300, 303, (60, 80)).astype(np.float32)
    heights[20, 30] = np.nan
    write_dem(tmp_path / "dem.tif", heights)
    run("relief", tmp_path / "dem.tif", "-o", tmp_path, "--write", "svf,openness-neg,dominance,ao", "--radius", 5,
        "--profile", profile)  # fmt: skip
    names = {"svf": "SVF_R5_D16", "openness-neg": "OPEN-NEG_R5_D16", "ao": "AO_R5", "dominance": "LD_R_M10-20_DI1_A15_OH1.7"}
    maps = scanshade.relief(heights, cell=1, write=list(names), radius=5, profile=profile)
    assert list(maps) == list(names) and maps.info["cell"] == 1
    with pytest.warns(scanshade.Doubt, match="metres are assumed"):
        of_file = scanshade.relief(tmp_path / "dem.tif", write=",".join(names), radius=5, profile=profile)
    for name, file in names.items():
        with pytest.warns(scanshade.Doubt):
            written = scanshade.relief(tmp_path / f"dem_{file}.tif", write="dtm")["dtm"]
        for values in (maps[name], of_file[name]):
            assert values.dtype == np.float32 and np.isnan(values[20, 30])
            assert np.array_equal(values.view(np.uint32), written.view(np.uint32))


def test_relief_takes_other_arrays_and_refuses_what_is_none():
    plane = 1000 + 0.25 * np.add.outer(np.arange(40), np.arange(50))
    for heights in (plane, plane[::-1].T, (4 * plane).astype(np.int32), plane.tolist()):
        maps = scanshade.relief(heights, cell=2, write=["openness"])
        assert maps["openness"].shape == np.shape(heights)
        assert np.allclose(maps["openness"], 90, atol=0.02)
    for call, part in [
        (lambda: scanshade.relief(plane), "cell: the side"),
        (lambda: scanshade.relief(plane[0], cell=1), "expected (H, W)"),
        (lambda: scanshade.relief(plane, cell=-1), "cells of -1 m"),
        (lambda: scanshade.relief(plane, cell=1, write="sfv"), "did you mean svf"),
        (lambda: scanshade.relief(plane, cell=1, write="svf,points"), "of the program"),
        (lambda: scanshade.relief("/nowhere.tif"), "/nowhere.tif"),
    ]:
        with pytest.raises(scanshade.Error) as error:
            call()
        assert part in str(error.value)


def test_names_and_help_are_for_people():
    assert dir(scanshade) == sorted([*scanshade.__all__, "__version__"])
    assert "(N, H, W)" in scanshade.ambient_occlusion.__doc__ and ">>>" in scanshade.ambient_occlusion.__doc__
    assert "(N, 3)" in scanshade.point_ambient_occlusion.__doc__
    result = scanshade.ambient_occlusion(corner(160, 120), [131, 131, 79.5, 59.5])
    assert repr(result).startswith("<scanshade.Result: ao (120, 160), mean 0.")
    assert repr(scanshade.Session()) == "<scanshade.Session: cacao>"
