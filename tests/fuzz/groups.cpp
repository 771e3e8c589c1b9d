// Fuzz target: the recording of an earlier run, whose groups a resumed run copies.
#include "io/captures/recordings/ros/mcap_output.h"
#include "io/captures/recordings/ros/message_output.h"
#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace scanshade;
    using namespace scanshade::fuzz;
    const std::string_view bytes = text_of(data, size);
    const std::filesystem::path file = as_file(bytes, "run.mcap");
    std::vector<ros::GroupPlace> groups;
    accepted([&] { groups = ros::groups_in(file); });
    accepted([&] {
        const std::string type = "std_msgs/msg/String";
        ros::McapOutput copy(folder() / "copy.mcap", "fuzz", {{"/a", type, ros::definition_of(type)}});
        for (const ros::GroupPlace& group : groups) {
            must_hold(group.at <= bytes.size() && group.size <= bytes.size() - group.at);
            copy.add(bytes.substr(group.at, group.size));
        }
        copy.finish();
    });
    accepted([&] { // without the checksum's guard
        const std::string type = "std_msgs/msg/String";
        ros::McapOutput copy(folder() / "copy.mcap", "fuzz", {{"/a", type, ros::definition_of(type)}});
        copy.add(bytes);
        copy.finish();
    });
    return 0;
}
