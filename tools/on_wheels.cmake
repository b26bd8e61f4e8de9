# Included right after project() when messages are built against the ROS wheels (build_msgs.py passes it).
#
# Only Python speaks to these: no wheel holds rclcpp. So C++ headers and type supports, half of what there is to compile,
# are neither generated nor built.

find_package(rosidl_default_generators REQUIRED)
list(FILTER AMENT_EXTENSIONS_rosidl_generate_idl_interfaces EXCLUDE REGEX "_cpp:")

# The imported targets of the wheels name the Python headers of the machine that built the wheels, a path that exists
# nowhere else, and cmake refuses to generate with it. Once all packages are found, every include path that does not
# exist is dropped from every imported target; the headers of this Python come from Python3_INCLUDE_DIRS all the same.

function(drop_missing_includes)
  get_property(targets DIRECTORY PROPERTY IMPORTED_TARGETS)
  foreach(target IN LISTS targets)
    get_target_property(includes ${target} INTERFACE_INCLUDE_DIRECTORIES)
    if(NOT includes)
      continue()
    endif()
    set(kept "")
    foreach(include IN LISTS includes)
      if(include MATCHES "\\$<" OR EXISTS "${include}")
        list(APPEND kept "${include}")
      endif()
    endforeach()
    set_target_properties(${target} PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "${kept}")
  endforeach()
endfunction()

cmake_language(DEFER CALL drop_missing_includes)
