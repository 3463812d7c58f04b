# Writes FILE, a header that names the commit of SOURCE: at every build, and only if it has changed.
# "unknown" outside a git checkout; "-dirty" where tracked files differ from the commit.
cmake_minimum_required(VERSION 3.22)
execute_process(COMMAND git -C ${SOURCE} describe --always --dirty --abbrev=12 "--exclude=*"
  OUTPUT_VARIABLE commit OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET RESULT_VARIABLE failed)
if(failed)
  set(commit unknown)
endif()
file(CONFIGURE OUTPUT ${FILE} CONTENT "#define LIMN_COMMIT \"@commit@\"\n" @ONLY)
