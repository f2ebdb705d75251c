# One library; every room is a folder whose files are found by themselves. tests/architecture guards the arrows.
set(PALPATE_ROOMS core geometry fem registration sensing reconstruction estimation prediction acquisition lab io report)
set(palpate_sources)
foreach(room IN LISTS PALPATE_ROOMS)
  file(GLOB room_sources CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/palpate/${room}/*.cpp
       ${CMAKE_CURRENT_SOURCE_DIR}/palpate/${room}/*/*.cpp)
  list(APPEND palpate_sources ${room_sources})
  palpate_join(${room} ${room_sources})
endforeach()
file(GLOB door_sources CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/palpate/*.cpp)
list(APPEND palpate_sources ${door_sources})
palpate_join(door ${door_sources})

add_library(palpate ${palpate_sources})
palpate_joined(palpate)
add_library(palpate::palpate ALIAS palpate)
target_compile_features(palpate PUBLIC cxx_std_20)
target_compile_definitions(palpate PUBLIC EIGEN_MPL2_ONLY)
target_include_directories(palpate PUBLIC $<BUILD_INTERFACE:${CMAKE_CURRENT_SOURCE_DIR}>
                                          $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
target_include_directories(palpate PRIVATE ${METIS_INCLUDE_DIR} ${NANOFLANN_INCLUDE_DIR} ${ZSTD_INCLUDE_DIR} ${LZ4_INCLUDE_DIR})
target_link_libraries(palpate PUBLIC Eigen3::Eigen Threads::Threads nlohmann_json::nlohmann_json
                              PRIVATE yaml-cpp PNG::PNG ZLIB::ZLIB BZip2::BZip2 SQLite::SQLite3 fmt::fmt ${ZSTD_LIBRARY} ${LZ4_LIBRARY} ${METIS_LIBRARY})

if(PALPATE_WITH_CHOLMOD)
  set_source_files_properties(palpate/fem/sparse_factor.cpp palpate/fem/linear_solver/cholmod_factor.cpp PROPERTIES
                              COMPILE_DEFINITIONS PALPATE_WITH_CHOLMOD INCLUDE_DIRECTORIES ${CHOLMOD_INCLUDE_DIR})
  target_link_libraries(palpate PRIVATE ${CHOLMOD_LIBRARY})
endif()

# Flags of our own code only, never exported to guests.
add_library(palpate_flags INTERFACE)
target_compile_options(palpate_flags INTERFACE -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor
                       # GCC 12 sees uninitialised members in moved std::variants and overlaps in string + string where there are
                       # none (GCC bugs 105562, 105651).
                       $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized -Wno-restrict>
                       $<$<BOOL:${PALPATE_WARNINGS_AS_ERRORS}>:-Werror>)
if(PALPATE_SANITIZE_ADDRESS)
  target_compile_options(palpate_flags INTERFACE -fsanitize=address,undefined -fno-omit-frame-pointer)
  target_link_options(palpate_flags INTERFACE -fsanitize=address,undefined)
endif()
if(PALPATE_SANITIZE_THREAD)
  target_compile_options(palpate_flags INTERFACE -fsanitize=thread)
  target_link_options(palpate_flags INTERFACE -fsanitize=thread)
endif()
target_link_libraries(palpate PRIVATE $<BUILD_INTERFACE:palpate_flags>)
set_target_properties(palpate PROPERTIES VERSION ${PROJECT_VERSION} SOVERSION ${PROJECT_VERSION_MAJOR})
