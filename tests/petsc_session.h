// Group fixtures of tests that need PETSc: started once for all tests of a program. To be included
// after cmocka.h.
#ifndef EP_TESTS_PETSC_SESSION_H
#define EP_TESTS_PETSC_SESSION_H

#include "linalg/petsc.h"

static int session_start(void **state) {
  (void)state;
  ep_error err = {0};
  if (ep_petsc_start(&err) == EP_OK) return 0;
  print_message("%s\n", err.text);
  return -1;
}

static int session_stop(void **state) {
  (void)state;
  ep_petsc_stop();
  return 0;
}

#endif
