# What every SmartMill package shares: the language level, the warnings, and the lines of a library,
# a program and a test.

include(GNUInstallDirs)

# Whether messages, nodes and what else needs ROS are built. Only the root's CMakeLists.txt sets it to OFF.
if(NOT DEFINED SMARTMILL_ROS)
  set(SMARTMILL_ROS ON)
endif()

# A test's own code need not be fast; what it does wrong with the standard library's containers ends it with a line
# that says so.
set(SMARTMILL_TEST_OPTIONS $<$<CONFIG:Release>:-O1> -D_GLIBCXX_ASSERTIONS)

# Nor need a program's: it reads options and turns messages, the thinking is in the libraries.
set(SMARTMILL_PROGRAM_OPTIONS $<$<CONFIG:Release>:-O1>)

# What the libraries alone are compiled with, say a sanitizer: the tests' own code stays as it is.
set(SMARTMILL_LIBRARY_OPTIONS "" CACHE STRING "Compiler options of the libraries")

# smartmill_language(TARGET): C++17, the project's warnings, no dependency on a library that is linked and not used (in a
# catkin build every package links what its nodes need), and a compiler that does not collect garbage below 0.5 GB (by
# itself it does from 0.13 GB, a fourteenth of its time).
function(smartmill_language target)
  target_compile_features(${target} PUBLIC cxx_std_17)
  set_target_properties(${target} PROPERTIES CXX_EXTENSIONS OFF)
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wshadow -Wnon-virtual-dtor -Woverloaded-virtual
    $<$<CXX_COMPILER_ID:GNU>:--param=ggc-min-heapsize=500000>)
  target_link_options(${target} PRIVATE LINKER:--as-needed)
endfunction()

# smartmill_compile_options(TARGET): the language, headers in include/ and (private ones) in src/.
function(smartmill_compile_options target)
  smartmill_language(${target})
  target_include_directories(${target} PRIVATE ${CMAKE_CURRENT_SOURCE_DIR}/include ${CMAKE_CURRENT_SOURCE_DIR}/src)
  target_include_directories(${target} SYSTEM PRIVATE ${catkin_INCLUDE_DIRS})
  if(catkin_EXPORTED_TARGETS)
    add_dependencies(${target} ${catkin_EXPORTED_TARGETS})
  endif()
endfunction()

# smartmill_install_rpath(TARGET FOLDER): installed into FOLDER, it finds the project's libraries, wherever the install prefix is.
function(smartmill_install_rpath target folder)
  if(NOT CMAKE_INSTALL_PREFIX STREQUAL /usr)
    file(RELATIVE_PATH path /${folder} /${CATKIN_PACKAGE_LIB_DESTINATION})
    set_target_properties(${target} PROPERTIES INSTALL_RPATH $ORIGIN/${path})
  endif()
endfunction()

# What nearly every source reads, and no header of ROS or of the project. It is read once for all libraries and once
# for all tests, in the first package of the build that has some.
set(SMARTMILL_LIBRARY_HEADERS <algorithm> <array> <cmath> <complex> <cstdint> <fstream> <functional> <iomanip> <map> <memory>
  <optional> <set> <sstream> <stdexcept> <string> <utility> <variant> <vector> <Eigen/Cholesky> <Eigen/Core> <Eigen/LU>)
set(SMARTMILL_TEST_HEADERS ${SMARTMILL_LIBRARY_HEADERS} <filesystem> <random> <gmock/gmock.h> <gtest/gtest.h>)

# smartmill_precompiled_headers(TARGET library|test [OPTION...]): OPTIONs and all else that changes how a source is read must
# be those of TARGET, or the compiler leaves the precompiled headers aside.
function(smartmill_precompiled_headers target kind)
  if(NOT smartmill_core_FOUND AND NOT PROJECT_NAME STREQUAL smartmill_core)
    return()  # nothing of Eigen there
  endif()
  set(shared smartmill_${kind}_headers)
  if(NOT TARGET ${shared})
    find_package(Eigen3 REQUIRED NO_MODULE)
    file(GENERATE OUTPUT ${CMAKE_CURRENT_BINARY_DIR}/${shared}.cpp CONTENT "")
    add_library(${shared} OBJECT EXCLUDE_FROM_ALL ${CMAKE_CURRENT_BINARY_DIR}/${shared}.cpp)
    smartmill_language(${shared})
    target_compile_options(${shared} PRIVATE ${ARGN})
    target_link_libraries(${shared} Eigen3::Eigen)
    string(TOUPPER SMARTMILL_${kind}_HEADERS headers)
    target_precompile_headers(${shared} PRIVATE ${${headers}})
    if(kind STREQUAL library)
      set_target_properties(${shared} PROPERTIES POSITION_INDEPENDENT_CODE ON)
    else()
      target_link_libraries(${shared} GTest::gtest)
    endif()
  endif()
  target_precompile_headers(${target} REUSE_FROM ${shared})
endfunction()

# smartmill_library(NAME SOURCES a.cpp ... LIBRARIES x ...): a library, installed with its headers. Of LIBRARIES, those of the
# project and Eigen are passed on to the targets that link it; the public headers include no other.
function(smartmill_library name)
  cmake_parse_arguments(arg "" "" "SOURCES;LIBRARIES" ${ARGN})
  add_library(${name} ${arg_SOURCES})
  smartmill_compile_options(${name})
  smartmill_precompiled_headers(${name} library ${SMARTMILL_LIBRARY_OPTIONS})
  target_compile_options(${name} PRIVATE ${SMARTMILL_LIBRARY_OPTIONS})
  set(private_libraries ${arg_LIBRARIES})
  list(FILTER private_libraries EXCLUDE REGEX "^(smartmill_|Eigen3::)")
  list(FILTER arg_LIBRARIES INCLUDE REGEX "^(smartmill_|Eigen3::)")
  target_link_libraries(${name} PUBLIC ${catkin_LIBRARIES} ${arg_LIBRARIES} PRIVATE ${private_libraries})

  # Below version 1 every minor version may change the binary interface.
  string(REGEX REPLACE "^(0\\.[0-9]+|[0-9]+).*" "\\1" soversion "${${PROJECT_NAME}_VERSION}")
  set_target_properties(${name} PROPERTIES VERSION "${${PROJECT_NAME}_VERSION}" SOVERSION "${soversion}")
  set(export)
  if(BUILD_SHARED_LIBS AND NOT SMARTMILL_ROS)
    # For find_package(smartmill) of plain CMake.
    set(export EXPORT smartmill)
    string(REGEX REPLACE "^smartmill_" "" export_name ${name})
    set_target_properties(${name} PROPERTIES EXPORT_NAME ${export_name})
    target_include_directories(${name} INTERFACE $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
    smartmill_install_rpath(${name} ${CATKIN_PACKAGE_LIB_DESTINATION})
  endif()
  set_property(GLOBAL APPEND PROPERTY SMARTMILL_INSTALLED ${name})
  install(TARGETS ${name} ${export} LIBRARY DESTINATION ${CATKIN_PACKAGE_LIB_DESTINATION}
    ARCHIVE DESTINATION ${CATKIN_PACKAGE_LIB_DESTINATION})
  if(EXISTS ${CMAKE_CURRENT_SOURCE_DIR}/include/${PROJECT_NAME})
    install(DIRECTORY include/${PROJECT_NAME}/ DESTINATION ${CATKIN_PACKAGE_INCLUDE_DESTINATION})
  endif()
endfunction()

# smartmill_executable(NAME [TARGET target] SOURCES a.cpp ... LIBRARIES x ...): a program that rosrun finds as NAME.
# Its main is apps/NAME.cpp; SOURCES are the others.
# TARGET names the cmake target where NAME would collide with another package's (default PACKAGE_NAME).
function(smartmill_executable name)
  cmake_parse_arguments(arg "" "TARGET" "SOURCES;LIBRARIES" ${ARGN})
  if(EXISTS ${CMAKE_CURRENT_SOURCE_DIR}/apps/${name}.cpp)
    list(PREPEND arg_SOURCES apps/${name}.cpp)
  endif()
  if(NOT arg_TARGET)
    set(arg_TARGET ${PROJECT_NAME}_${name})
  endif()
  add_executable(${arg_TARGET} ${arg_SOURCES})
  set_target_properties(${arg_TARGET} PROPERTIES OUTPUT_NAME ${name})
  smartmill_compile_options(${arg_TARGET})
  target_compile_options(${arg_TARGET} PRIVATE ${SMARTMILL_PROGRAM_OPTIONS})
  target_link_libraries(${arg_TARGET} ${catkin_LIBRARIES} ${arg_LIBRARIES})
  if(NOT SMARTMILL_ROS)
    smartmill_install_rpath(${arg_TARGET} ${CATKIN_PACKAGE_BIN_DESTINATION})
  endif()
  set_property(GLOBAL APPEND PROPERTY SMARTMILL_INSTALLED ${arg_TARGET})
  install(TARGETS ${arg_TARGET} RUNTIME DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION})
endfunction()

# smartmill_ros_library, smartmill_ros_executable, smartmill_ros_gtest: the same for sources that include ROS headers; nothing
# with SMARTMILL_ROS=OFF.
function(smartmill_ros_library)
  if(SMARTMILL_ROS)
    smartmill_library(${ARGN})
  endif()
endfunction()
function(smartmill_ros_executable)
  if(SMARTMILL_ROS)
    smartmill_executable(${ARGN})
  endif()
endfunction()
function(smartmill_ros_gtest)
  if(SMARTMILL_ROS)
    smartmill_gtest(${ARGN})
  endif()
endfunction()

# smartmill_testing_library(NAME [INCLUDE folder] SOURCES a.cpp ... LIBRARIES x ...): what tests and studies of several
# packages share. Its headers are below INCLUDE (default test); it is not installed and not built by itself.
function(smartmill_testing_library name)
  if(NOT CATKIN_ENABLE_TESTING)
    return()
  endif()
  cmake_parse_arguments(arg "" "INCLUDE" "SOURCES;LIBRARIES" ${ARGN})
  if(NOT arg_INCLUDE)
    set(arg_INCLUDE test)
  endif()
  add_library(${name} STATIC EXCLUDE_FROM_ALL ${arg_SOURCES})
  smartmill_compile_options(${name})
  target_include_directories(${name} PUBLIC ${arg_INCLUDE})
  target_link_libraries(${name} ${arg_LIBRARIES})
endfunction()

# smartmill_test_options(TARGET): what the programs of all tests share.
function(smartmill_test_options target)
  smartmill_compile_options(${target})
  target_compile_options(${target} PRIVATE ${SMARTMILL_TEST_OPTIONS})
  smartmill_precompiled_headers(${target} test ${SMARTMILL_TEST_OPTIONS})
  if(smartmill_core_FOUND OR PROJECT_NAME STREQUAL smartmill_core)
    target_link_libraries(${target} smartmill_core_testing)
  endif()
endfunction()

# smartmill_gtest(NAME SOURCES a.cpp ... LIBRARIES x ...): a unit test without ROS master.
function(smartmill_gtest name)
  if(NOT CATKIN_ENABLE_TESTING)
    return()
  endif()
  cmake_parse_arguments(arg "" "" "SOURCES;LIBRARIES" ${ARGN})
  find_package(GTest REQUIRED)
  catkin_add_gtest(${PROJECT_NAME}_${name} ${arg_SOURCES} WORKING_DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR})
  smartmill_test_options(${PROJECT_NAME}_${name})
  target_link_libraries(${PROJECT_NAME}_${name} ${catkin_LIBRARIES} ${arg_LIBRARIES} GTest::gtest_main)
  if(NOT TARGET ${PROJECT_NAME}_gtests)
    add_custom_target(${PROJECT_NAME}_gtests)  # the package's tests that need no ROS master
  endif()
  add_dependencies(${PROJECT_NAME}_gtests ${PROJECT_NAME}_${name})
endfunction()

# smartmill_gtest_properties(NAME PROPERTY VALUE ...): of a gtest of this package for ctest; without tests nothing.
function(smartmill_gtest_properties name)
  if(TARGET ${PROJECT_NAME}_${name})
    set_tests_properties(_ctest_${PROJECT_NAME}_gtest_${PROJECT_NAME}_${name} PROPERTIES ${ARGN})
  endif()
endfunction()

# smartmill_run_alone(NAME): a gtest of this package that runs while no other does, as it has a real-time thread.
function(smartmill_run_alone name)
  smartmill_gtest_properties(${name} RUN_SERIAL TRUE)
endfunction()

# smartmill_start_early(NAME): a long gtest of this package that starts before shorter ones, as a processor would be idle
# at the end of all tests otherwise.
function(smartmill_start_early name)
  smartmill_gtest_properties(${name} COST 100)
endfunction()

# smartmill_rostest(LAUNCH_FILE NAME SOURCES a.cpp ... LIBRARIES x ... NODES t ...): a gtest node run by rostest.
# NODES are targets that the launch file starts.
function(smartmill_rostest launch name)
  if(NOT CATKIN_ENABLE_TESTING OR NOT SMARTMILL_ROS)
    return()
  endif()
  cmake_parse_arguments(arg "" "" "SOURCES;LIBRARIES;NODES" ${ARGN})
  find_package(rostest REQUIRED)
  find_package(GTest REQUIRED)
  add_rostest_gtest(${PROJECT_NAME}_${name} ${launch} ${arg_SOURCES})
  smartmill_test_options(${PROJECT_NAME}_${name})
  target_link_libraries(${PROJECT_NAME}_${name} ${catkin_LIBRARIES} ${arg_LIBRARIES} GTest::gtest)
  add_dependencies(tests ${PROJECT_NAME}_${name})
  if(arg_NODES)
    add_dependencies(${PROJECT_NAME}_${name} ${arg_NODES})
  endif()
endfunction()
