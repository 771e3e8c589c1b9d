# Read by CPack for each kind of package: one archive has everything, with the libraries that it carries.
if(CPACK_GENERATOR STREQUAL "TGZ")
  set(CPACK_COMPONENTS_ALL program library development python carried)
  set(CPACK_ARCHIVE_COMPONENT_INSTALL ON)
  set(CPACK_COMPONENTS_GROUPING ALL_COMPONENTS_IN_ONE)
  set(CPACK_COMPONENT_INCLUDE_TOPLEVEL_DIRECTORY ON)
  set(CPACK_PACKAGE_FILE_NAME scanshade-${CPACK_PACKAGE_VERSION}-${CPACK_SYSTEM_NAME})
endif()
