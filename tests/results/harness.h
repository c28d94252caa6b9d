// What every test of this folder includes, in the order cmocka wants.
#ifndef EP_TESTS_RESULTS_HARNESS_H
#define EP_TESTS_RESULTS_HARNESS_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#endif
