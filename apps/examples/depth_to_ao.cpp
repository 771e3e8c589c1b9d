// A depth image of 16 bits to a float TIFF of visibility: depth_to_ao IN.png SCALE FX FY CX CY OUT.tiff, SCALE like mm
// or tum
#include <scanshade/session.h>

#include <iostream>
#include <opencv2/imgcodecs.hpp>

int main(int count, char** words) try {
    if (count != 8) {
        std::cerr << "depth_to_ao IN.png SCALE FX FY CX CY OUT.tiff\n";
        return 1;
    }
    const cv::Mat depth = cv::imread(words[1], cv::IMREAD_UNCHANGED);
    const scanshade::Camera camera{std::stod(words[3]), std::stod(words[4]), std::stod(words[5]), std::stod(words[6])};
    const scanshade::Session session({{"method", "surfel"}, {"radius", "0.5"}});
    const scanshade::Result result = session.compute(depth, camera, words[2]);
    for (const std::string& doubt : result.doubts())
        std::cerr << "doubtful: " << doubt << "\n";
    return cv::imwrite(words[7], result.visibility()) ? 0 : 1;
} catch (const std::exception& error) {
    std::cerr << error.what() << "\n";
    return 1;
}
