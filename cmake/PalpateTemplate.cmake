# Embeds palpate/report/template.html (built by viewer/build, kept in the tree) into the library as string literals.
# Run as a script: cmake -D INPUT=... -D OUTPUT=... -P PalpateTemplate.cmake
if(CMAKE_SCRIPT_MODE_FILE)
  file(READ ${INPUT} text HEX)
  string(LENGTH "${text}" digits)
  set(chunk 32768)  # compilers must take literals of 65536 characters
  set(literals "")
  set(at 0)
  # As hexadecimal bytes: no character of the page can be taken for a CMake or C++ delimiter.
  while(at LESS digits)
    string(SUBSTRING "${text}" ${at} ${chunk} part)
    string(REGEX REPLACE "(..)" "\\\\x\\1" part "${part}")
    string(APPEND literals "    \"${part}\",\n")
    math(EXPR at "${at} + ${chunk}")
  endwhile()
  math(EXPR bytes "${digits} / 2")
  file(WRITE ${OUTPUT}
"// Generated from palpate/report/template.html.
#include \"palpate/report/template.hpp\"

namespace palpate::report {

std::string page_template() {
  static constexpr const char* chunks[] = {
${literals}  };
  std::string page;
  page.reserve(${bytes});
  for (const char* chunk : chunks) page += chunk;
  return page;
}

}  // namespace palpate::report
")
  return()
endif()

set(template_page ${CMAKE_CURRENT_SOURCE_DIR}/palpate/report/template.html)
set(template_source ${CMAKE_CURRENT_BINARY_DIR}/generated/report_template.cpp)
add_custom_command(OUTPUT ${template_source} DEPENDS ${template_page} ${CMAKE_CURRENT_LIST_FILE}
                   COMMAND ${CMAKE_COMMAND} -D INPUT=${template_page} -D OUTPUT=${template_source}
                           -P ${CMAKE_CURRENT_LIST_FILE} COMMENT "Embedding the report's template" VERBATIM)
target_sources(palpate PRIVATE ${template_source})
