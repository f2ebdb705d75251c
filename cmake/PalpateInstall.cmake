include(CMakePackageConfigHelpers)
install(TARGETS palpate EXPORT palpate-targets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR}
        LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(DIRECTORY palpate DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} FILES_MATCHING PATTERN "*.hpp" PATTERN "driver.h")
install(EXPORT palpate-targets NAMESPACE palpate:: DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/palpate)
configure_package_config_file(cmake/palpate-config.cmake.in palpate-config.cmake
                              INSTALL_DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/palpate)
write_basic_package_version_file(palpate-config-version.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/palpate-config.cmake ${CMAKE_CURRENT_BINARY_DIR}/palpate-config-version.cmake
        DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/palpate)
