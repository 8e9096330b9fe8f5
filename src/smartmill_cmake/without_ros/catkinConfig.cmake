# catkin's functions as far as the packages call them, for a build without ROS (SMARTMILL_ROS=OFF in the root's CMakeLists.txt).
# find_package(catkin COMPONENTS ...) gives what the project's packages among the components have declared with catkin_package();
# ROS packages are ignored.
include(GNUInstallDirs)

set(catkin_INCLUDE_DIRS)
set(catkin_LIBRARIES)
set(catkin_EXPORTED_TARGETS)
foreach(component ${catkin_FIND_COMPONENTS})
  if(component STREQUAL smartmill_cmake)
    include(${CMAKE_CURRENT_LIST_DIR}/../cmake/smartmill_cmake-extras.cmake)
  endif()
  get_property(${component}_FOUND GLOBAL PROPERTY ${component}_FOUND)
  foreach(declared INCLUDE_DIRS LIBRARIES EXPORTED_TARGETS)
    get_property(${component}_${declared} GLOBAL PROPERTY ${component}_${declared})
    list(APPEND catkin_${declared} ${${component}_${declared}})
    list(REMOVE_DUPLICATES catkin_${declared})
  endforeach()
endforeach()

set(CATKIN_ENABLE_TESTING ${BUILD_TESTING})
set(CATKIN_DEVEL_PREFIX ${CMAKE_BINARY_DIR})
set(CATKIN_TEST_RESULTS_DIR ${CMAKE_BINARY_DIR}/test_results)

set(CATKIN_GLOBAL_BIN_DESTINATION ${CMAKE_INSTALL_BINDIR})
set(CATKIN_PACKAGE_BIN_DESTINATION ${CMAKE_INSTALL_LIBEXECDIR}/${PROJECT_NAME})
set(CATKIN_PACKAGE_INCLUDE_DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/${PROJECT_NAME})
set(CATKIN_PACKAGE_LIB_DESTINATION ${CMAKE_INSTALL_LIBDIR})
set(CATKIN_PACKAGE_SHARE_DESTINATION ${CMAKE_INSTALL_DATADIR}/${PROJECT_NAME})

# catkin_package([INCLUDE_DIRS folder...] [LIBRARIES target...] [EXPORTED_TARGETS target...] [CATKIN_DEPENDS package...]):
# what the package declares to others, its version of package.xml, and output folders as in a devel space.
macro(catkin_package)
  file(STRINGS ${PROJECT_SOURCE_DIR}/package.xml ${PROJECT_NAME}_VERSION REGEX "<version>")
  string(REGEX REPLACE ".*<version>(.*)</version>.*" "\\1" ${PROJECT_NAME}_VERSION "${${PROJECT_NAME}_VERSION}")
  cmake_parse_arguments(declared "" "" "INCLUDE_DIRS;LIBRARIES;EXPORTED_TARGETS;CATKIN_DEPENDS;DEPENDS;CFG_EXTRAS" ${ARGN})
  set(relative_folders ${declared_INCLUDE_DIRS})
  set(declared_INCLUDE_DIRS)
  foreach(folder ${relative_folders})
    get_filename_component(folder ${folder} ABSOLUTE)
    list(APPEND declared_INCLUDE_DIRS ${folder})
  endforeach()
  foreach(property INCLUDE_DIRS LIBRARIES EXPORTED_TARGETS)
    foreach(depend ${declared_CATKIN_DEPENDS})
      get_property(passed_on GLOBAL PROPERTY ${depend}_${property})
      list(APPEND declared_${property} ${passed_on})
    endforeach()
    list(REMOVE_DUPLICATES declared_${property})
    set_property(GLOBAL PROPERTY ${PROJECT_NAME}_${property} ${declared_${property}})
  endforeach()
  set_property(GLOBAL PROPERTY ${PROJECT_NAME}_FOUND TRUE)
  set(CMAKE_LIBRARY_OUTPUT_DIRECTORY ${CATKIN_DEVEL_PREFIX}/lib)
  set(CMAKE_ARCHIVE_OUTPUT_DIRECTORY ${CATKIN_DEVEL_PREFIX}/lib)
  set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${CATKIN_DEVEL_PREFIX}/lib/${PROJECT_NAME})
endmacro()

# catkin_add_gtest(TARGET SOURCE... [WORKING_DIRECTORY folder]): with the name and the report's path that catkin gives them.
function(catkin_add_gtest target)
  cmake_parse_arguments(arg "" "WORKING_DIRECTORY" "" ${ARGN})
  add_executable(${target} ${arg_UNPARSED_ARGUMENTS})
  target_link_libraries(${target} GTest::gtest)
  add_test(NAME _ctest_${PROJECT_NAME}_gtest_${target}
    COMMAND ${target} --gtest_output=xml:${CATKIN_TEST_RESULTS_DIR}/${PROJECT_NAME}/gtest-${target}.xml
    WORKING_DIRECTORY ${arg_WORKING_DIRECTORY})
endfunction()
