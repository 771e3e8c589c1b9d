# Documents made by the program.
if(TARGET documents)
  add_test(NAME documents COMMAND ${PROJECT_SOURCE_DIR}/tests/package/documents ${PROJECT_BINARY_DIR}/documents)
  set_tests_properties(documents PROPERTIES SKIP_RETURN_CODE 77)
endif()
