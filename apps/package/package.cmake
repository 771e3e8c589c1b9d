# Man pages, completions and packages: .deb files by component, and an archive that runs wherever it is unpacked.
set(package_dir ${PROJECT_SOURCE_DIR}/apps/package)
set(documents ${PROJECT_BINARY_DIR}/documents)

# What is made by the program itself needs Python, which a Debian that builds packages has.
find_package(Python3 COMPONENTS Interpreter)
if(Python3_FOUND AND NOT SANITIZE)
  add_custom_command(
    OUTPUT ${documents}/bash/scanshade
    COMMAND scanshade help --json > ${PROJECT_BINARY_DIR}/help.json
    COMMAND ${Python3_EXECUTABLE} ${package_dir}/documents.py ${documents} < ${PROJECT_BINARY_DIR}/help.json
    DEPENDS scanshade ${package_dir}/documents.py
    COMMENT "man pages and completions"
    VERBATIM)
  add_custom_target(documents ALL DEPENDS ${documents}/bash/scanshade)
  install(DIRECTORY ${documents}/man/ DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT program)
  install(FILES ${documents}/bash/scanshade DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions
          COMPONENT program)
  install(FILES ${documents}/zsh/_scanshade DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/vendor-completions
          COMPONENT program)
endif()
install(DIRECTORY ${PROJECT_SOURCE_DIR}/apps/python/scanshade DESTINATION lib/python3/dist-packages COMPONENT python
        PATTERN __pycache__ EXCLUDE)

# Each package has its changes and its terms, where Debian looks for them.
find_program(GZIP gzip)
set(changes ${PROJECT_BINARY_DIR}/changelog.Debian.gz)
add_custom_command(
  OUTPUT ${changes}
  COMMAND ${GZIP} -9nc ${package_dir}/changelog > ${changes}
  DEPENDS ${package_dir}/changelog
  VERBATIM)
add_custom_target(changes ALL DEPENDS ${changes})
set(package_of_program scanshade)
set(package_of_library libscanshade${PROJECT_VERSION_MAJOR})
set(package_of_development libscanshade-dev)
set(package_of_python python3-scanshade)
foreach(component program library development python)
  install(FILES ${changes} ${package_dir}/copyright DESTINATION share/doc/${package_of_${component}}
          COMPONENT ${component})
endforeach()

# The archive carries the libraries that a cluster may lack, Vulkan's loader among them. The C and C++ runtimes are the
# system's: its Vulkan drivers may need newer ones than ours.
install(CODE [[
  if(CMAKE_INSTALL_COMPONENT STREQUAL "carried")
    file(GET_RUNTIME_DEPENDENCIES EXECUTABLES $<TARGET_FILE:scanshade> LIBRARIES $<TARGET_FILE:library>
         RESOLVED_DEPENDENCIES_VAR needed POST_EXCLUDE_REGEXES
         "/(ld-linux[^/]*|libc|libm|libdl|libpthread|librt|libstdc\\+\\+|libgcc_s|libscanshade)\\.so[^/]*$")
    list(APPEND needed $<TARGET_FILE:Vulkan::Vulkan>)
    file(INSTALL ${needed} DESTINATION $ENV{DESTDIR}${CMAKE_INSTALL_PREFIX}/lib/scanshade FOLLOW_SYMLINK_CHAIN)
    # With the terms of each, as its Debian package states them.
    set(terms $ENV{DESTDIR}${CMAKE_INSTALL_PREFIX}/share/doc/scanshade/libraries)
    file(MAKE_DIRECTORY ${terms})
    foreach(library ${needed})
      file(REAL_PATH ${library} file)
      get_filename_component(name ${file} NAME)
      execute_process(COMMAND dpkg -S */${name} OUTPUT_VARIABLE owner ERROR_QUIET)
      string(REGEX REPLACE "[:,].*" "" owner "${owner}")
      if(NOT owner OR NOT EXISTS /usr/share/doc/${owner}/copyright)
        message(FATAL_ERROR "no terms found of ${library}")
      endif()
      file(COPY_FILE /usr/share/doc/${owner}/copyright ${terms}/${owner}.txt)
    endforeach()
  endif()
]] COMPONENT carried)

set(CPACK_PACKAGE_NAME scanshade)
set(CPACK_PACKAGE_VENDOR scanshade)
set(CPACK_PACKAGE_CONTACT "scanshade developers <developers@scanshade.invalid>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "ambient occlusion for recorded depth images and point clouds")
set(CPACK_PACKAGE_VERSION ${PROJECT_VERSION})
set(CPACK_STRIP_FILES ON)
set(CPACK_PACKAGE_DIRECTORY ${PROJECT_BINARY_DIR}/packages)
set(CPACK_PROJECT_CONFIG_FILE ${package_dir}/generators.cmake)
set(CPACK_COMPONENTS_ALL program library development python)

set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_PACKAGE_RELEASE 1)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_DEBIAN_ENABLE_COMPONENT_DEPENDS OFF)
set(about "Recorded RGB-D frames or point clouds get ambient occlusion: how much of the
 sky over each point is open, as maps, on clouds and in shaded pictures.")
function(debian_package component section text)
  string(TOUPPER ${component} upper)
  set(CPACK_DEBIAN_${upper}_PACKAGE_NAME ${package_of_${component}} PARENT_SCOPE)
  set(CPACK_DEBIAN_${upper}_PACKAGE_SECTION ${section} PARENT_SCOPE)
  set(CPACK_COMPONENT_${upper}_DESCRIPTION "${CPACK_PACKAGE_DESCRIPTION_SUMMARY}, ${text}\n${about}" PARENT_SCOPE)
endfunction()
set(exactly "(= ${PROJECT_VERSION}-${CPACK_DEBIAN_PACKAGE_RELEASE})")
debian_package(program graphics "the program")
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_DEPENDS libvulkan1) # opened when it runs, so not seen in the file
set(CPACK_DEBIAN_PROGRAM_PACKAGE_RECOMMENDS "mesa-vulkan-drivers, libproj25") # opened likewise
debian_package(library libs "the library")
set(CPACK_DEBIAN_LIBRARY_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_LIBRARY_PACKAGE_DEPENDS libvulkan1)
set(CPACK_DEBIAN_LIBRARY_PACKAGE_RECOMMENDS "mesa-vulkan-drivers, libproj25")
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS ON)
set(CPACK_DEBIAN_LIBRARY_PACKAGE_CONTROL_EXTRA ${package_dir}/triggers)
debian_package(development libdevel "headers")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS "${package_of_library} ${exactly}, libopencv-dev, libeigen3-dev")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SUGGESTS libpcl-dev)
debian_package(python python "the Python module")
set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS "${package_of_library} ${exactly}, python3 (>= 3.9), python3-numpy")
set(CPACK_DEBIAN_PYTHON_PACKAGE_ARCHITECTURE all)
include(CPack)
