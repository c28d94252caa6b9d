// Claim: kernels made for older processors are replaced by what the processor can do, good kernels
// are left alone (app/blas_core.h).
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
// clang-format off
#include <cmocka.h>
// clang-format on

#include "app/blas_core.h"

static void old_kernels_are_replaced(void **state) {
  (void)state;
  assert_string_equal(ep_blas_core_better("Prescott", 1, 1), "SkylakeX");
  assert_string_equal(ep_blas_core_better("Prescott", 1, 0), "Haswell");
  assert_string_equal(ep_blas_core_better("prescott", 1, 0), "Haswell");
  assert_string_equal(ep_blas_core_better("Sandybridge", 1, 0), "Haswell");
  assert_null(ep_blas_core_better("Prescott", 0, 0));
}

static void good_kernels_are_kept(void **state) {
  (void)state;
  assert_null(ep_blas_core_better("SkylakeX", 1, 1));
  assert_null(ep_blas_core_better("Haswell", 1, 0));
  assert_null(ep_blas_core_better("Zen", 1, 0));
  assert_null(ep_blas_core_better("ARMV8", 0, 0));
  assert_null(ep_blas_core_better(NULL, 1, 1));
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(old_kernels_are_replaced),
      cmocka_unit_test(good_kernels_are_kept),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
