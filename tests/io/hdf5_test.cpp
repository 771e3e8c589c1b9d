// HDF5 files as libhdf5 writes them, read by our own reader: the same numbers. Hypersim's scenes made of them.
#include "io/captures/capture.h"
#include "io/hdf5/hdf5.h"
#include "tests/support/files.h"
#include "tests/support/says.h"
#include "tests/support/small_capture.h"

#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <hdf5.h>
#include <opencv2/imgcodecs.hpp>

namespace scanshade {
namespace {

namespace fs = std::filesystem;
using tests::refusal, tests::says, tests::warned;

/// How libhdf5 is to write a data set.
struct Writing {
    std::vector<hsize_t> chunk = {}; ///< empty: contiguous
    bool deflated = false, shuffled = false, summed = false, compact = false, latest = false;
    hsize_t user_block = 0;
    bool write = true; ///< the elements, too
};

hid_t half_type(bool big_endian) {
    const hid_t type = H5Tcopy(big_endian ? H5T_IEEE_F32BE : H5T_IEEE_F32LE);
    H5Tset_fields(type, 15, 10, 5, 0, 10);
    H5Tset_size(type, 2);
    H5Tset_ebias(type, 15);
    return type;
}

/// Appends a data set to the file, which is made where there is none.
void write_set(const fs::path& file, const char* name, hid_t type, const std::vector<hsize_t>& shape,
               const std::vector<double>& numbers, const Writing& how = {}) {
    fs::create_directories(file.parent_path());
    const hid_t making = H5Pcreate(H5P_FILE_CREATE), access = H5Pcreate(H5P_FILE_ACCESS),
                set_making = H5Pcreate(H5P_DATASET_CREATE);
    H5Pset_userblock(making, how.user_block);
    if (how.latest)
        H5Pset_libver_bounds(access, H5F_LIBVER_LATEST, H5F_LIBVER_LATEST);
    if (!how.chunk.empty())
        H5Pset_chunk(set_making, static_cast<int>(how.chunk.size()), how.chunk.data());
    if (how.compact)
        H5Pset_layout(set_making, H5D_COMPACT);
    if (how.shuffled)
        H5Pset_shuffle(set_making);
    if (how.deflated)
        H5Pset_deflate(set_making, 4);
    if (how.summed)
        H5Pset_fletcher32(set_making);
    const hid_t opened = fs::exists(file) ? H5Fopen(file.c_str(), H5F_ACC_RDWR, access)
                                          : H5Fcreate(file.c_str(), H5F_ACC_EXCL, making, access);
    const hid_t space = H5Screate_simple(static_cast<int>(shape.size()), shape.data(), nullptr);
    const hid_t set = H5Dcreate2(opened, name, type, space, H5P_DEFAULT, set_making, H5P_DEFAULT);
    ASSERT_GE(set, 0);
    if (how.write) {
        ASSERT_GE(H5Dwrite(set, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, numbers.data()), 0);
    }
    H5Dclose(set);
    H5Sclose(space);
    for (const hid_t list : {making, access, set_making})
        H5Pclose(list);
    ASSERT_GE(H5Fclose(opened), 0);
}

std::vector<double> counting(std::size_t count) {
    std::vector<double> numbers(count);
    for (std::size_t i = 0; i < count; ++i)
        numbers[i] = static_cast<double>(i % 120);
    return numbers;
}

class Hdf5 : public testing::Test {
  protected:
    tests::TemporaryFolder folder;
};

TEST_F(Hdf5, numbers_are_those_that_libhdf5_wrote) {
    const std::vector<hid_t> types{half_type(false), half_type(true), H5T_IEEE_F32LE, H5T_IEEE_F32BE,
                                   H5T_IEEE_F64LE,   H5T_STD_U8LE,    H5T_STD_I8LE,   H5T_STD_I16BE,
                                   H5T_STD_U32LE,    H5T_STD_I64LE,   H5T_STD_U64BE};
    const std::vector<std::pair<const char*, Writing>> ways{
        {"contiguous", {}},
        {"compact", {.compact = true}},
        {"chunks that do not fit", {.chunk = {3, 4, 5}}},
        {"deflated", {.chunk = {2, 7, 11}, .deflated = true}},
        {"shuffled, deflated, summed", {.chunk = {5, 3, 4}, .deflated = true, .shuffled = true, .summed = true}},
        {"one chunk", {.chunk = {5, 7, 11}, .deflated = true, .latest = true}},
        {"one chunk as it is", {.chunk = {5, 7, 11}, .latest = true}},
        {"links", {.latest = true}},
        {"a block of the user's", {.chunk = {1, 7, 11}, .deflated = true, .user_block = 512}}};
    const std::vector<double> numbers = counting(5 * 7 * 11);
    for (const auto& [name, how] : ways)
        for (std::size_t i = 0; i < types.size(); ++i) {
            SCOPED_TRACE(fmt::format("{}, type {}", name, i));
            const fs::path file = folder / fmt::format("{}{}.h5", name, i);
            write_set(file, "other", H5T_STD_U8LE, {1}, {7},
                      how.chunk.empty() ? how : Writing{.latest = how.latest, .user_block = how.user_block});
            write_set(file, "dataset", types[i], {5, 7, 11}, numbers, how);
            const Hdf5File opened(file);
            EXPECT_TRUE(opened.has("other"));
            const Hdf5Dataset set = opened.dataset("dataset");
            EXPECT_EQ(set.shape(), (std::vector<std::uint64_t>{5, 7, 11}));
            EXPECT_EQ(set.numbers(1000), numbers);
            const std::string part = set.elements(2, 2); // slices of the outermost dimension
            ASSERT_EQ(part.size(), 2 * 77 * set.number().bytes);
            for (std::size_t k = 0; k < 2 * 77; ++k)
                ASSERT_EQ(set.number().at(part.data() + k * set.number().bytes), numbers[2 * 77 + k]) << k;
        }
}

TEST_F(Hdf5, halves_keep_their_range_and_nan) {
    const std::vector<double> numbers{0, 65504, std::ldexp(1, -24), -std::ldexp(3, -16), INFINITY, -INFINITY, NAN, 1.5};
    write_set(folder / "a.h5", "dataset", half_type(false), {8}, numbers);
    const std::vector<double> found = Hdf5File(folder / "a.h5").dataset("dataset").numbers(8);
    for (std::size_t i = 0; i < numbers.size(); ++i)
        EXPECT_TRUE(found[i] == numbers[i] || (std::isnan(found[i]) && std::isnan(numbers[i]))) << i;
}

TEST_F(Hdf5, many_names_and_many_chunks_are_found_in_trees) {
    for (int i = 0; i < 40; ++i)
        write_set(folder / "names.h5", fmt::format("set{}", i).c_str(), H5T_STD_U8LE, {1}, {double(i)});
    const Hdf5File names(folder / "names.h5");
    EXPECT_EQ(names.names().size(), 40U);
    EXPECT_EQ(names.dataset("set37").numbers(1), std::vector<double>{37});
    const std::vector<double> numbers = counting(3000);
    write_set(folder / "chunks.h5", "dataset", H5T_IEEE_F32LE, {3000}, numbers, {.chunk = {2}});
    EXPECT_EQ(Hdf5File(folder / "chunks.h5").dataset("dataset").numbers(3000), numbers);
}

TEST_F(Hdf5, what_is_not_read_is_named) {
    const auto opened = [&](const char* name) {
        return [&, name] { (void)Hdf5File(folder / name).dataset("dataset"); };
    };
    write_set(folder / "latest.h5", "dataset", H5T_IEEE_F32LE, {6, 6}, counting(36), {.chunk = {2, 2}, .latest = true});
    EXPECT_TRUE(says(refusal(opened("latest.h5")), "index of chunks of kind"));
    write_set(folder / "unwritten.h5", "dataset", H5T_IEEE_F32LE, {6, 6}, {}, {.chunk = {2, 2}, .write = false});
    EXPECT_TRUE(says(refusal(opened("unwritten.h5")), "unwritten.h5: dataset"));
    write_set(folder / "unwritten2.h5", "dataset", H5T_IEEE_F32LE, {6, 6}, {}, {.write = false});
    EXPECT_TRUE(says(refusal(opened("unwritten2.h5")), "never written"));
    write_set(folder / "other.h5", "depth", H5T_IEEE_F32LE, {6}, counting(6));
    EXPECT_TRUE(says(refusal(opened("other.h5")), "no data set \"dataset\", found \"depth\""));
    const hid_t text = H5Tcopy(H5T_C_S1);
    H5Tset_size(text, 8);
    const hid_t file = H5Fcreate((folder / "text.h5").c_str(), H5F_ACC_EXCL, H5P_DEFAULT, H5P_DEFAULT),
                space = H5Screate(H5S_SCALAR);
    H5Dclose(H5Dcreate2(file, "dataset", text, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT));
    H5Fclose(file);
    EXPECT_FALSE(refusal(opened("text.h5")).empty());
    tests::write_file(folder / "no.h5", "text");
    EXPECT_TRUE(says(refusal(opened("no.h5")), "signature"));
}

TEST_F(Hdf5, damage_anywhere_is_an_error_or_other_numbers_but_no_crash) {
    const Writing how{.chunk = {8, 8}, .deflated = true, .shuffled = true, .summed = true};
    for (const Writing& way : {how, Writing{}, Writing{.latest = true}}) {
        const fs::path file = folder / "a.h5", damaged = folder / "b.h5";
        fs::remove(file);
        write_set(file, "dataset", half_type(false), {16, 20}, counting(320), way);
        const std::string bytes = tests::file_bytes(file);
        const auto read = [&] {
            try {
                (void)Hdf5File(damaged).dataset("dataset").numbers(320);
            } catch (const Error& failure) {
                EXPECT_TRUE(says(failure.what(), "b.h5"));
            }
        };
        for (std::size_t i = 0; i < bytes.size(); ++i) {
            if (bytes[i] == 0 && i % 16 != 0) // most of a small file is padding
                continue;
            std::string changed = bytes;
            changed[i] = static_cast<char>(~changed[i]);
            tests::write_file(damaged, changed);
            read();
        }
        for (std::size_t size = 0; size < bytes.size(); size += 97) {
            tests::write_file(damaged, bytes.substr(0, size));
            EXPECT_THROW((void)Hdf5File(damaged).dataset("dataset").numbers(320), Error) << size;
        }
    }
}

// ------------------------------------------------------------------------------------------------- Hypersim

/// Two frames of 8x6 pixels, all of the distance 2 m but for pixel (0, 0), which is a hole.
class Scene : public Hdf5 {
  protected:
    void images(const std::string& camera, std::initializer_list<int> frames) {
        std::vector<double> distances(48, 2);
        distances[0] = NAN;
        for (const int frame : frames)
            write_set(scene / fmt::format("images/scene_{}_geometry_hdf5/frame.{:04}.depth_meters.hdf5", camera, frame),
                      "dataset", half_type(false), {6, 8}, distances, {.chunk = {3, 8}, .deflated = true});
    }
    void colour(const std::string& name) {
        const fs::path file = scene / "images/scene_cam_00_final_preview" / name;
        fs::create_directories(file.parent_path());
        ASSERT_TRUE(cv::imwrite(file.string(), cv::Mat3b(6, 8, {9, 99, 199})));
    }
    void poses(const std::string& camera, std::vector<double> indices) {
        const fs::path detail = scene / "_detail" / camera;
        const hsize_t count = indices.size();
        std::vector<double> turns, places;
        for (hsize_t i = 0; i < count; ++i) {
            // A quarter turn about z, then OpenGL's axes: y and z change sign.
            for (const double value : {0., 1., 0., 1., 0., 0., 0., 0., -1.})
                turns.push_back(value);
            for (const double value : {10., 20., 30. + double(i)})
                places.push_back(value);
        }
        write_set(detail / "camera_keyframe_frame_indices.hdf5", "dataset", H5T_STD_I64LE, {count}, indices);
        write_set(detail / "camera_keyframe_orientations.hdf5", "dataset", H5T_IEEE_F64LE, {count, 3, 3}, turns);
        write_set(detail / "camera_keyframe_positions.hdf5", "dataset", H5T_IEEE_F64LE, {count, 3}, places);
        tests::write_file(scene / "_detail/metadata_scene.csv",
                          "parameter_name,parameter_value\nmeters_per_asset_unit,0.1\n");
    }
    void parameters(const std::string& matrix) {
        std::string header = "scene_name,\"a, b\"";
        for (int y = 0; y < 4; ++y)
            for (int x = 0; x < 4; ++x)
                header += fmt::format(",M_proj_{}{}", y, x);
        tests::write_file(folder / "metadata_camera_parameters.csv",
                          header + "\nai_001_001,x" +
                              ",1,0,0,0,0,1,0,0,0,0,-1,-2,0,0,-1,0\nai_001_002,\"Color(1, 1)\"," + matrix + "\n");
    }
    fs::path scene = folder / "scenes/ai_001_002";
};

TEST_F(Scene, distances_become_z_and_poses_metres) {
    images("cam_00", {0, 2});
    colour("frame.0000.tonemap.jpg");
    colour("frame.0002.color.jpg");
    poses("cam_00", {0, 1, 2});
    const Capture capture = open_capture(scene);
    EXPECT_EQ(capture.kind, "Hypersim");
    ASSERT_EQ(capture.entries.size(), 2U);
    EXPECT_EQ(capture.entries[1].name, "cam_00.frame.0002");
    EXPECT_TRUE(warned(capture.warnings, "1 of the trajectory's 3 frames are not here"));
    EXPECT_TRUE(warned(capture.warnings, "60 degrees"));
    const Frame frame = capture.load(1);
    const Pinhole& k = frame.camera.pinhole;
    EXPECT_NEAR(k.fx, 4 / std::tan(CV_PI / 6), 1e-9);
    EXPECT_EQ(k.fx, k.fy);
    EXPECT_EQ(k.cx, 3.5);
    EXPECT_EQ(k.cy, 2.5);
    EXPECT_EQ(frame.depth_m(0, 0), 0);
    for (const auto& [u, v] : {std::pair(7, 0), {4, 3}, {0, 5}})
        EXPECT_NEAR(frame.depth_m(v, u) * k.ray(u, v).norm(), 2, 1e-6);
    EXPECT_FALSE(frame.colour.empty());
    EXPECT_EQ(frame.registration, Registration::yes);
    ASSERT_TRUE(frame.world_from_camera);
    EXPECT_LT((*frame.world_from_camera * Eigen::Vector3d(1, 0, 0) - Eigen::Vector3d(1, 3, 3.2)).norm(), 1e-6);
    EXPECT_LT((*frame.world_from_camera * Eigen::Vector3d(0, 0, 1) - Eigen::Vector3d(1, 2, 4.2)).norm(), 1e-6);
}

TEST_F(Scene, the_camera_is_that_of_its_row_or_the_users) {
    images("cam_00", {0});
    poses("cam_00", {0});
    parameters("1.5,0,0.25,0,0,2,-0.5,0,0,0,-1,-2,0,0,-1,0");
    const Capture capture = open_capture(scene);
    const Frame frame = capture.load(0);
    const Pinhole& k = frame.camera.pinhole;
    EXPECT_NEAR(k.fx, 6, 1e-9);
    EXPECT_NEAR(k.fy, 6, 1e-9);
    EXPECT_NEAR(k.cx, 4 * (1 - 0.25) - 0.5, 1e-9);
    EXPECT_NEAR(k.cy, 3 * (1 - 0.5) - 0.5, 1e-9);
    EXPECT_NEAR(frame.depth_m(5, 7) * k.ray(7, 5).norm(), 2, 1e-6);
    EXPECT_TRUE(warned(capture.warnings, "no .tonemap.jpg or .color.jpg of 1 frame"));
    CaptureOptions options;
    options.camera = "20,20,3.5,2.5";
    const Frame asked = open_capture(scene, options).load(0);
    EXPECT_NEAR(asked.depth_m(5, 7) * asked.camera.pinhole.ray(7, 5).norm(), 2, 1e-6)
        << "z is that of the camera that is used";
}

TEST_F(Scene, tilted_image_planes_are_refused_by_name) {
    images("cam_00", {0});
    poses("cam_00", {0});
    parameters("1.73,0,0,0,0,2.3,0.03,0,0,0.03,-1,-2,0,0.0299,-0.9995,0");
    const std::string said = refusal([&] { (void)open_capture(scene); });
    EXPECT_TRUE(says(said, "metadata_camera_parameters.csv line 3 (ai_001_002)"));
    EXPECT_TRUE(says(said, "tilted (M_proj_31 is 0.0299)"));
}

TEST_F(Scene, each_camera_is_a_capture) {
    images("cam_00", {0});
    images("cam_01", {5});
    poses("cam_00", {0});
    poses("cam_01", {5});
    const std::string said = refusal([&] { (void)open_capture_at_or_below(scene); });
    EXPECT_TRUE(says(said, "2 cameras, each a capture: open images/scene_cam_00_geometry_hdf5, "
                           "images/scene_cam_01_geometry_hdf5"));
    const Capture capture = open_capture(scene / "images/scene_cam_01_geometry_hdf5/");
    ASSERT_EQ(capture.entries.size(), 1U);
    EXPECT_EQ(capture.entries[0].name, "cam_01.frame.0005");
    EXPECT_TRUE(capture.load(0).world_from_camera);
}

TEST_F(Scene, damaged_parts_cost_only_themselves) {
    images("cam_00", {0, 1});
    poses("cam_00", {0});
    const fs::path depth = scene / "images/scene_cam_00_geometry_hdf5/frame.0001.depth_meters.hdf5";
    tests::write_file(depth, tests::file_bytes(depth).substr(0, 900));
    const Capture capture = open_capture(scene);
    EXPECT_TRUE(capture.load(0).world_from_camera);
    EXPECT_TRUE(says(refusal([&] { (void)capture.load(1); }), "frame.0001.depth_meters.hdf5"));
    EXPECT_TRUE(warned(capture.entries[1].warnings, "no row for frame 1"));
    tests::write_file(scene / "_detail/cam_00/camera_keyframe_positions.hdf5", "damaged");
    const Capture without = open_capture(scene);
    EXPECT_TRUE(warned(without.warnings, "camera_keyframe_positions.hdf5"));
    EXPECT_FALSE(without.load(0).world_from_camera);
}

// ------------------------------------------------------------------------------------------------- NYU depth v2

TEST_F(Hdf5, labelled_images_of_nyu_are_turned_from_columns) {
    // Two images of 4x3 pixels.
    const fs::path file = folder / "nyu.mat";
    std::vector<double> depths, images;
    for (int i = 0; i < 2; ++i)
        for (int u = 0; u < 4; ++u)
            for (int v = 0; v < 3; ++v)
                depths.push_back(i + 1 + 0.1 * u + 0.01 * v);
    for (int i = 0; i < 2; ++i)
        for (int channel = 0; channel < 3; ++channel)
            for (int u = 0; u < 4; ++u)
                for (int v = 0; v < 3; ++v)
                    images.push_back(100 * i + 50 * channel + 10 * u + v);
    write_set(file, "depths", H5T_IEEE_F32LE, {2, 4, 3}, depths,
              {.chunk = {1, 4, 3}, .deflated = true, .user_block = 512});
    write_set(file, "images", H5T_STD_U8LE, {2, 3, 4, 3}, images, {.chunk = {1, 3, 4, 3}, .deflated = true});
    std::string bytes = tests::file_bytes(file);
    const std::string title = "MATLAB 7.3 MAT-file, Platform: GLNXA64";
    tests::write_file(file, bytes.replace(0, title.size(), title));
    const Capture capture = open_capture(file);
    EXPECT_EQ(capture.kind, "NYU depth v2 labelled");
    ASSERT_EQ(capture.entries.size(), 2U);
    const Frame frame = capture.load(1);
    EXPECT_NEAR(frame.depth_m(2, 3), 2.32, 1e-6);
    EXPECT_NEAR(frame.depth_m(1, 0), 2.01, 1e-6);
    EXPECT_EQ(frame.colour(2, 3), cv::Vec3b(232, 182, 132));
    EXPECT_NEAR(frame.camera.pinhole.fx, 518.858 * 4 / 640, 1e-9);
    EXPECT_TRUE(warned(capture.warnings, "published colour camera is assumed"));
    tests::write_file(file, bytes.substr(0, 1500));
    EXPECT_THROW((void)open_capture(file).load(1), Error);
}

} // namespace
} // namespace scanshade
