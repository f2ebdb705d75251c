# What nearly every file of the program or of the tests reads (CLI11 and JSON, the tests' framework, Eigen) is parsed once for all of them;
# in a small test that is half of its compiling. A header that one of them forgets is then not missed: `-DPALPATE_PRECOMPILE_HEADERS=OFF`
# (the debug preset) shows it. The library, whose files spend their time elsewhere, is built without.
option(PALPATE_PRECOMPILE_HEADERS "Parse common headers of program and tests once" ${PALPATE_IS_TOP_LEVEL})
set(PALPATE_COMMON_HEADERS <algorithm> <array> <cmath> <cstdint> <filesystem> <functional> <limits> <map> <memory> <numeric> <optional>
                           <span> <string> <string_view> <utility> <vector>)
# Without the first ccache takes none of it. GCC 12 sees strings of size -1 copied in the precompiled <string>, and in it alone.
set(PALPATE_PRECOMPILED_FLAGS $<$<CXX_COMPILER_ID:GNU>:-fpch-preprocess> $<$<CXX_COMPILER_ID:GNU>:-Wno-stringop-overflow>
                              $<$<CXX_COMPILER_ID:GNU>:-Wno-array-bounds>)

function(palpate_precompile target)
  if(PALPATE_PRECOMPILE_HEADERS)
    target_precompile_headers(${target} PRIVATE ${PALPATE_COMMON_HEADERS} ${ARGN})
    target_compile_options(${target} PRIVATE ${PALPATE_PRECOMPILED_FLAGS})
  endif()
endfunction()

# What another target of the same kind and options has had parsed.
function(palpate_precompile_as target other)
  if(PALPATE_PRECOMPILE_HEADERS)
    target_precompile_headers(${target} REUSE_FROM ${other})
    target_compile_options(${target} PRIVATE ${PALPATE_PRECOMPILED_FLAGS})
  endif()
endfunction()
