# `cmake --install build --prefix PREFIX`: the program, the static libraries, the contracts
# (include/limn) and a package for find_package(limn).
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)
set(package ${CMAKE_INSTALL_LIBDIR}/cmake/limn)

# The names of the installed targets: limn::core and so on.
foreach(part core edgetree integrators)
  set_target_properties(limn_${part} PROPERTIES EXPORT_NAME ${part})
endforeach()
set_target_properties(limn_options PROPERTIES EXPORT_NAME contracts)
install(TARGETS limn_options limn_core limn_edgetree limn_integrators EXPORT limn
  ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT limn)
install(TARGETS limn RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT limn)
# What the program calls.
install(PROGRAMS tools/report.py DESTINATION ${CMAKE_INSTALL_DATADIR}/limn COMPONENT limn)
install(DIRECTORY tools/report DESTINATION ${CMAKE_INSTALL_DATADIR}/limn COMPONENT limn
  FILES_MATCHING PATTERN "*.py" PATTERN "*.css" PATTERN "__pycache__" EXCLUDE)
install(PROGRAMS tools/mitsuba/mitsuba_gradient.py
  DESTINATION ${CMAKE_INSTALL_DATADIR}/limn/mitsuba COMPONENT limn)
install(DIRECTORY include/limn DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT limn
  FILES_MATCHING PATTERN "*.h")
install(EXPORT limn FILE limnTargets.cmake NAMESPACE limn:: DESTINATION ${package} COMPONENT limn)

configure_package_config_file(tools/package/limnConfig.cmake.in ${CMAKE_BINARY_DIR}/limnConfig.cmake
  INSTALL_DESTINATION ${package} NO_SET_AND_CHECK_MACRO)
# Before 1.0 a second number that differs may break what was there.
write_basic_package_version_file(${CMAKE_BINARY_DIR}/limnConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_BINARY_DIR}/limnConfig.cmake ${CMAKE_BINARY_DIR}/limnConfigVersion.cmake
  DESTINATION ${package} COMPONENT limn)
