# Tests of the library through its public headers, in C++ and in C, and of the Python module.
enable_language(C)
add_executable(library_test tests/library/library_test.cpp tests/library/c_interface_c.c)
target_link_libraries(library_test library Eigen3::Eigen opencv_core opencv_imgcodecs GTest::gtest_main)
target_include_directories(library_test SYSTEM PRIVATE ${OpenCV_INCLUDE_DIRS})
target_compile_options(library_test PRIVATE -Wall -Wextra $<$<BOOL:${WERROR}>:-Werror>)
target_compile_definitions(library_test PRIVATE SCANSHADE_PROGRAM="$<TARGET_FILE:scanshade>")
add_dependencies(library_test scanshade)
add_test(NAME library_test COMMAND library_test)
set_tests_properties(library_test PROPERTIES TIMEOUT 600)

look_for_needs_of(pcl_header_test)
if(missing)
  leave_out(pcl_header_test ${missing})
else()
  add_executable(pcl_header_test tests/library/pcl_header_test.cpp)
  target_link_libraries(pcl_header_test library Eigen3::Eigen opencv_core PkgConfig::pcl_io GTest::gtest_main)
  target_include_directories(pcl_header_test SYSTEM PRIVATE ${OpenCV_INCLUDE_DIRS})
  add_test(NAME pcl_header_test COMMAND pcl_header_test)
endif()

# -DPython3_EXECUTABLE= names another Python, such as that of a virtual environment with numpy and pytest.
if(NOT python_with_numpy)
  leave_out(python_test "a Python with numpy and pytest")
else()
  add_test(NAME python_test COMMAND ${python_with_numpy} ${PROJECT_SOURCE_DIR}/tests/python/run)
  set_tests_properties(python_test PROPERTIES TIMEOUT 600 ENVIRONMENT
    "SCANSHADE_LIBRARY=$<TARGET_FILE:library>;SCANSHADE_PROGRAM=$<TARGET_FILE:scanshade>;PYTHONPATH=${PROJECT_SOURCE_DIR}/apps/python")
endif()
