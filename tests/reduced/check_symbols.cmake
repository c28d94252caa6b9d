cmake_policy(VERSION 3.22)
# What the run-time library calls from outside: libm and memory functions, nothing else. Symbols it
# defines itself are taken off first.
set(allowed log1p|sqrt|sin|atan2|memcpy|memset|memcmp|memchr|memmove|strcmp|strlen|fmax|fmin
    # the compilers' own: processor features, stack protector of hardened builds
    |__cpu_model|__cpu_indicator_init|__stack_chk_fail|_GLOBAL_OFFSET_TABLE_)
string(REPLACE ";" "" allowed "${allowed}")
execute_process(COMMAND ${NM} -u ${LIBRARY} OUTPUT_VARIABLE undefined RESULT_VARIABLE bad)
execute_process(COMMAND ${NM} --defined-only ${LIBRARY} OUTPUT_VARIABLE defined
                RESULT_VARIABLE worse)
if(bad OR worse)
  message(FATAL_ERROR "nm failed on ${LIBRARY}")
endif()
string(REGEX MATCHALL " [TtRrDdBb] [A-Za-z_0-9]+" own "${defined}")
string(REGEX MATCHALL "U [A-Za-z_0-9]+" wanted "${undefined}")
list(LENGTH own count)
if(count LESS 20 OR NOT wanted)
  message(FATAL_ERROR "${LIBRARY} defines only ${count} symbols: not the library")
endif()
set(failed "")
foreach(symbol ${wanted})
  string(SUBSTRING ${symbol} 2 -1 name)
  if(NOT name MATCHES "^(${allowed})$" AND NOT " T ${name}" IN_LIST own)
    list(APPEND failed ${name})
  endif()
endforeach()
# Writable data would be state shared between models.
string(REGEX MATCHALL " [DdBb] [A-Za-z_0-9]+" writable "${defined}")
if(failed OR writable)
  message(FATAL_ERROR "not on the allow-list: ${failed}; writable data: ${writable}")
endif()
