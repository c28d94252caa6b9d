// Claims: a CSV file holds the header promised and numbers that read back bit by bit; a failed
// write leaves no file and keeps the old one.
#include "tests/results/harness.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/files.h"
#include "results/csv.h"

static void test_csv_round_trip(void **state) {
  (void)state;
  const double t[3] = {0, 1.0 / 60, 0.1}, q[6] = {1e-300, -1.0 / 3, 5e-324, 1e22, NAN, -INFINITY};
  const double w[3] = {0.1 + 0.2, 1, 0};
  const ep_csv_group group[4] = {
      {"t", 1, t, false}, {"q", 2, q, true}, {"none", 0, NULL, false}, {"w", 1, w, true}};
  ep_error err = {0};
  assert_int_equal(ep_csv_write("a.csv", 3, 4, group, &err), EP_OK);
  char *text;
  size_t size;
  assert_int_equal(ep_file_read("a.csv", &text, &size, &err), EP_OK);
  const char *header = "t,q0,q1,w0\n";
  assert_memory_equal(text, header, strlen(header));
  char *at = text + strlen(header);
  for (int row = 0; row < 3; row++) {
    const double want[4] = {t[row], q[2 * row], q[2 * row + 1], w[row]};
    for (int i = 0; i < 4; i++) {
      const double got = strtod(at, &at);
      assert_true(isnan(want[i]) ? isnan(got) : got == want[i]);
      assert_int_equal(*at++, i < 3 ? ',' : '\n');
    }
  }
  assert_ptr_equal(at, text + size);
  assert_non_null(strstr(text, "0.30000000000000004")); // 17 digits where 15 do not suffice
  assert_non_null(strstr(text, "\n0.1,"));              // and no more than needed where they do
  free(text);
}

static void test_csv_refuses(void **state) {
  (void)state;
  const double x[1] = {1};
  const ep_csv_group comma = {"a,b", 1, x, false}, missing = {"a", 1, NULL, false};
  ep_error err = {0};
  assert_int_equal(ep_csv_write("refused.csv", 1, 1, &comma, &err), EP_ERR_ARGUMENT);
  assert_non_null(strstr(err.text, "a,b"));
  assert_int_equal(ep_csv_write("refused.csv", 1, 1, &missing, NULL), EP_ERR_ARGUMENT);
  assert_false(ep_path_exists("refused.csv"));
  const ep_csv_group good = {"a", 1, x, false};
  assert_int_equal(ep_csv_write("no/such/folder/a.csv", 1, 1, &good, NULL), EP_ERR_IO);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_csv_round_trip),
                                     cmocka_unit_test(test_csv_refuses)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
