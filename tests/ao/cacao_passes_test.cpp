// CACAO's tables of passes: sound in every configuration, at odd and tiny sizes, and with either storage the same map.
#include "tests/support/cacao_runs.h"
#include "tests/support/scenes.h"

#include <gtest/gtest.h>

namespace scanshade {
namespace {

using namespace tests;
using cacao_passes = CacaoTest;

TEST_F(cacao_passes, every_configuration_is_sound) {
    // Twenty configurations, two profiles, zero to eight blur passes. Passes read only buffers already written, and the
    // last one writes the map.
    for (const auto& [profile_word, profile] : cacao_profile_words)
        for (const auto& [quality_word, quality] : quality_words)
            for (const bool downsampled : {false, true})
                for (const bool supplied : {false, true})
                    for (int blur = 0; blur <= 8; ++blur)
                        for (const cv::Size size : {cv::Size(1, 1), cv::Size(641, 479)}) {
                            CacaoOptions o = options(quality, downsampled, profile);
                            o.blur_passes = blur;
                            const CacaoTables tables =
                                cacao_tables(o, constants_from(o, camera_of(500, size)), supplied);
                            const CacaoTables in_images = cacao_tables(o, constants_from(o, camera_of(500, size)),
                                                                       supplied, CacaoStorage::images);
                            for (const CacaoTables* each : {&tables, &in_images}) {
                                if (each == &in_images && !o.scan())
                                    continue;
                                const auto wrong = gpu::problems(each->buffers, each->passes);
                                EXPECT_TRUE(wrong.empty())
                                    << profile_word << " " << quality_word << ": " << wrong.front();
                                EXPECT_EQ(each->passes.back().writes.front(), cacao_out);
                                EXPECT_EQ(each->buffers.size(), static_cast<std::size_t>(cacao_buffer_count));
                            }
                        }
}

TEST_F(cacao_passes, odd_and_tiny_images_run_without_a_word_of_validation) {
    // Out-of-range accesses and missing barriers show at sizes that no tile divides. TearDown reads the messages.
    if (!device().validating())
        GTEST_SKIP() << "the validation layer is not there; tests/run installs it";
    const std::vector<std::pair<Quality, bool>> modes{
        {Quality::highest, true},  {Quality::lowest, true}, {Quality::high, false},   {Quality::medium, true},
        {Quality::highest, false}, {Quality::low, true},    {Quality::lowest, false}, {Quality::high, true}};
    std::size_t next = 0;
    for (const cv::Size size : {cv::Size(1, 1), cv::Size(1, 9), cv::Size(3, 2), cv::Size(641, 479)})
        for (const CacaoProfile profile : {CacaoProfile::scan, CacaoProfile::reference}) {
            const auto& [quality, downsampled] = modes[next++];
            for (const CacaoStorage storage : {CacaoStorage::buffers, CacaoStorage::images}) {
                CacaoOptions o = options(quality, downsampled, profile);
                o.storage = storage;
                Cacao cacao(device(), o);
                const DepthImage depth = flat(camera_of(500, size), 2);
                const cv::Mat1f v = cacao.compute({depth}).visibility;
                EXPECT_EQ(v.size(), size);
                if (o.scan()) {
                    EXPECT_GE(lowest(v), 0.999)
                        << size << " " << name_of(quality) << " in " << name_of(storage) << ": a plane is open";
                }
                silent();
            }
        }
}

TEST_F(cacao_passes, both_storages_make_the_same_map) {
    // Buffers are faster on CPUs, images and fused passes on GPUs, and both run one algorithm. The runs cover holes,
    // odd sizes, and zero to seven blur steps, fused or not.
    const DepthImage depth = with_holes(ball_on_floor(camera_of(125, {161, 119})), 0.05);
    const std::vector<std::pair<Quality, bool>> modes{
        {Quality::lowest, true}, {Quality::lowest, false}, {Quality::low, true},     {Quality::medium, false},
        {Quality::high, true},   {Quality::high, false},   {Quality::highest, true}, {Quality::highest, false}};
    for (std::size_t blur = 0; blur < modes.size(); ++blur) {
        const auto& [quality, downsampled] = modes[blur];
        CacaoOptions o = options(quality, downsampled);
        o.blur_passes = static_cast<int>(blur);
        o.storage = CacaoStorage::buffers;
        const cv::Mat1f expected = Cacao(device(), o).compute({depth}).visibility;
        o.storage = CacaoStorage::images;
        const cv::Mat1f ours = Cacao(device(), o).compute({depth}).visibility;
        EXPECT_EQ(cv::countNonZero((expected == expected) != (ours == ours)), 0)
            << name_of(quality) << ": the same holes";
        const cv::Mat1f apart = difference(ours, expected);
        EXPECT_LE(average(apart), 0.1 / 255) << name_of(quality) << " " << downsampled;
        EXPECT_LE(cv::countNonZero(apart > 2.0 / 255), static_cast<int>(apart.total()) / 500)
            << name_of(quality) << " " << downsampled;
        silent();
    }
}

} // namespace
} // namespace scanshade
