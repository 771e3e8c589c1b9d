# libscanshade.so: the C interface over the rooms' objects, with C++ headers on it; how both are installed.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)
set(library_dir ${PROJECT_SOURCE_DIR}/apps/library)

file(GLOB library_sources CONFIGURE_DEPENDS ${library_dir}/*.cpp)
add_library(library SHARED ${library_sources})
target_link_libraries(library PRIVATE apps_session apps_refine apps_relief)
target_precompile_headers(library REUSE_FROM precompiled)
target_include_directories(library INTERFACE $<BUILD_INTERFACE:${library_dir}/include>
                                             $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
set_target_properties(library PROPERTIES OUTPUT_NAME scanshade VERSION ${PROJECT_VERSION} SOVERSION ${PROJECT_VERSION_MAJOR}
                                         EXPORT_NAME scanshade LINK_DEPENDS ${library_dir}/symbols.map)
target_link_options(library PRIVATE -Wl,--version-script=${library_dir}/symbols.map -Wl,--gc-sections -Wl,--no-undefined)

# Where an unpacked archive has what it carries; of that, too, others are needed in turn (DT_RPATH, not RUNPATH).
set_target_properties(scanshade library PROPERTIES INSTALL_RPATH "$ORIGIN/../lib/scanshade;$ORIGIN/../scanshade")
target_link_options(scanshade PRIVATE -Wl,--disable-new-dtags)
target_link_options(library PRIVATE -Wl,--disable-new-dtags)
install(TARGETS scanshade RUNTIME COMPONENT program)
install(TARGETS library EXPORT scanshade LIBRARY COMPONENT library NAMELINK_COMPONENT development)
install(DIRECTORY ${library_dir}/include/scanshade DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT development)
set(config_dir ${CMAKE_INSTALL_LIBDIR}/cmake/scanshade)
install(EXPORT scanshade NAMESPACE scanshade:: FILE scanshadeConfig.cmake DESTINATION ${config_dir} COMPONENT development)
write_basic_package_version_file(scanshadeConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/scanshadeConfigVersion.cmake DESTINATION ${config_dir}
        COMPONENT development)
file(RELATIVE_PATH prefix_from_pc /${CMAKE_INSTALL_LIBDIR}/pkgconfig /)
configure_file(${library_dir}/scanshade.pc.in scanshade.pc @ONLY)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/scanshade.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig
        COMPONENT development)
