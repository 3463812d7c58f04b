# `cmake --build build --target docs`: pages of the contracts in include/limn, in build/docs/html.
# Needs doxygen; without it there is no such target.
find_package(Doxygen QUIET)
if(NOT DOXYGEN_FOUND)
  return()
endif()
set(DOXYGEN_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/docs)
set(DOXYGEN_USE_MDFILE_AS_MAINPAGE include/README.md)
set(DOXYGEN_STRIP_FROM_PATH ${CMAKE_SOURCE_DIR} ${CMAKE_SOURCE_DIR}/include)
# Comments here are plain `//`: the filter marks those that belong to a declaration.
set(DOXYGEN_INPUT_FILTER "awk -f ${CMAKE_SOURCE_DIR}/tools/package/doxygen_filter.awk")
set(DOXYGEN_JAVADOC_AUTOBRIEF YES)
set(DOXYGEN_EXTRACT_ALL NO)
set(DOXYGEN_SORT_MEMBER_DOCS NO)
set(DOXYGEN_MACRO_EXPANSION NO)
set(DOXYGEN_HAVE_DOT NO)
set(DOXYGEN_GENERATE_LATEX NO)
set(DOXYGEN_QUIET YES)
# What has no comment is told, and is no error.
set(DOXYGEN_WARN_AS_ERROR NO)
doxygen_add_docs(docs include/limn include/README.md
  COMMENT "Pages of the contracts: build/docs/html")
