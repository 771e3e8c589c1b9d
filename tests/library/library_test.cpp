// The library as its users see it: public headers alone, against what the program writes for the same input.
#include "tests/support/says.h"
#include "tests/support/small_capture.h"

#include "io/images/image_file.h"

#include <scanshade/capture.h>

#include <cstring>
#include <gtest/gtest.h>
#include <limits>
#include <thread>

extern "C" int one_image_in_c(void);

namespace {

namespace fs = std::filesystem;
