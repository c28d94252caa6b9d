# Flags every target shares. -ffp-contract=off: results must not depend on whether a compiler
# fuses a multiply and an add on its own: all builds give the same bits.
add_compile_options(-Wall -Wextra -Wshadow
                    $<$<COMPILE_LANGUAGE:C>:-Wstrict-prototypes> # the examples are C++ too
                    $<$<COMPILE_LANGUAGE:C>:-Wmissing-prototypes>
                    -Wpointer-arith -Wvla -Wundef -fno-math-errno -ffp-contract=off)
if(EP_WERROR)
  add_compile_options(-Werror)
endif()
if(EP_SANITIZE)
  add_compile_options(-fsanitize=address,undefined -fno-sanitize-recover=undefined
                      -fno-omit-frame-pointer -g)
  add_link_options(-fsanitize=address,undefined)
endif()
if(EP_FUZZ)
  add_compile_options(-fsanitize=fuzzer-no-link) # coverage of every library for the targets
endif()
if(EP_SANITIZE_THREAD)
  add_compile_options(-fsanitize=thread -fno-omit-frame-pointer -g)
  add_link_options(-fsanitize=thread)
endif()
include_directories(${PROJECT_SOURCE_DIR})

# A static library of one folder; headers are included as "folder/name.h".
function(ep_library name)
  add_library(${name} STATIC ${ARGN})
endfunction()

# A cmocka test program: ep_test(test_name SOURCES a.c LIBS ep_mesh ...). It runs in a directory
# of its own and learns the source tree and the optional data folder from the environment.
function(ep_test name)
  cmake_parse_arguments(T "" "TIMEOUT" "SOURCES;LIBS" ${ARGN})
  set(dir ${CMAKE_BINARY_DIR}/test-work/${name})
  file(MAKE_DIRECTORY ${dir})
  add_executable(${name} ${T_SOURCES} ${CMAKE_SOURCE_DIR}/tests/own_folder.c)
  target_link_libraries(${name} PRIVATE ${T_LIBS} ${EP_CMOCKA_LIBS} m)
  target_compile_definitions(${name} PRIVATE EP_SOURCE_DIR="${CMAKE_SOURCE_DIR}"
    EP_TEST_FOLDER="${dir}")
  add_test(NAME ${name} COMMAND ${name})
  if(NOT T_TIMEOUT)
    set(T_TIMEOUT 300)
  endif()
  if(EP_SANITIZE OR EP_SANITIZE_THREAD) # three to five times as slow, and the machine may be busy
    math(EXPR T_TIMEOUT "4 * ${T_TIMEOUT}")
  endif()
  set_tests_properties(${name} PROPERTIES TIMEOUT ${T_TIMEOUT}
    ENVIRONMENT "ASAN_OPTIONS=detect_leaks=0;OPENBLAS_NUM_THREADS=1;OMP_NUM_THREADS=1")
endfunction()
