# Most of what a file takes to compile are headers and templates that its neighbours read, too, Eigen's above all. The files of a room are
# therefore compiled together, a few at a time: in about half the time of one by one. What a file borrows of a neighbour (a header,
# a name) is then not missed: `-DPALPATE_JOIN_FILES=OFF` (the debug preset) shows it.
option(PALPATE_JOIN_FILES "Compile neighbouring files together" ON)
set(PALPATE_FILES_AT_ONCE 8)

# palpate_joined(<target>): its neighbouring files are compiled together.
function(palpate_joined target)
  set_target_properties(${target} PROPERTIES UNITY_BUILD ${PALPATE_JOIN_FILES} UNITY_BUILD_MODE GROUP)
endfunction()

# palpate_join(<name> <source>...): these files are neighbours, wherever their target is joined.
function(palpate_join name)
  set(at 0)
  foreach(source IN LISTS ARGN)
    math(EXPR group "${at} / ${PALPATE_FILES_AT_ONCE}")
    set_source_files_properties(${source} PROPERTIES UNITY_GROUP ${name}_${group})
    math(EXPR at "${at} + 1")
  endforeach()
endfunction()

# The largest of them take 2 GB: on a machine of many cores and little memory not as many at a time as there are cores.
if(PALPATE_JOIN_FILES AND PALPATE_IS_TOP_LEVEL AND NOT CMAKE_JOB_POOL_COMPILE)
  cmake_host_system_information(RESULT memory_mb QUERY TOTAL_PHYSICAL_MEMORY)
  math(EXPR jobs "${memory_mb} / 2000 + 1")
  set_property(GLOBAL APPEND PROPERTY JOB_POOLS palpate_compile=${jobs})
  set(CMAKE_JOB_POOL_COMPILE palpate_compile)
endif()
