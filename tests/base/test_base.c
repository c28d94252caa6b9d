// base/: the first error wins; outputs are whole or absent; random numbers repeat and are uniform;
// hashes tell contents apart; progress on a terminal stays on its line.
#define _GNU_SOURCE // posix_openpt
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/error.h"
#include "base/escape.h"
#include "base/files.h"
#include "base/forest.h"
#include "base/log.h"
#include "base/random.h"

static void first_error_is_kept(void **state) {
  (void)state;
  ep_error err = {0};
  assert_int_equal(ep_fail(&err, EP_ERR_IO, "disk %d", 1), EP_ERR_IO);
  assert_int_equal(ep_fail(&err, EP_ERR_MESH, "later"), EP_ERR_IO);
  assert_string_equal(err.text, "disk 1");
  assert_int_equal(ep_fail_context(&err, "scene %s", "a.yaml"), EP_ERR_IO);
  assert_string_equal(err.text, "scene a.yaml: disk 1");
  assert_string_equal(ep_status_name(EP_ERR_NUMERIC), "numeric");
  assert_string_equal(ep_status_name((ep_status)99), "unknown");
  assert_int_equal(ep_fail(NULL, EP_ERR_IO, "dropped"), EP_ERR_IO);
}

static void long_context_is_cut_not_overrun(void **state) {
  (void)state;
  ep_error err = {0};
  char text[2000];
  memset(text, 'x', sizeof text - 1);
  text[sizeof text - 1] = '\0';
  ep_fail(&err, EP_ERR_IO, "%s", text);
  ep_fail_context(&err, "%s", text);
  assert_int_equal(strlen(err.text), sizeof err.text - 1);
}

static void output_replaces_only_on_commit(void **state) {
  (void)state;
  ep_error err = {0};
  assert_int_equal(ep_file_write("out.txt", "old", 3, &err), EP_OK);
  ep_output out;
  assert_int_equal(ep_output_open(&out, "out.txt", &err), EP_OK);
  fputs("new", out.file);
  char *text;
  size_t size;
  assert_int_equal(ep_file_read("out.txt", &text, &size, &err), EP_OK);
  assert_string_equal(text, "old");
  free(text);
  assert_int_equal(ep_output_commit(&out, &err), EP_OK);
  assert_int_equal(ep_file_read("out.txt", &text, &size, &err), EP_OK);
  assert_string_equal(text, "new");
  free(text);
  assert_int_equal(ep_output_open(&out, "out.txt", &err), EP_OK);
  ep_output_discard(&out);
  assert_false(ep_path_exists(out.temporary));
  assert_true(ep_path_exists("out.txt"));
}

// A file-size limit stands in for a full disk: the write fails, the old file stays.
static void full_disk_loses_nothing(void **state) {
  (void)state;
  ep_error err = {0};
  assert_int_equal(ep_file_write("kept.txt", "kept", 4, &err), EP_OK);
  struct rlimit old, tiny;
  getrlimit(RLIMIT_FSIZE, &old);
  tiny = old;
  tiny.rlim_cur = 1000;
  signal(SIGXFSZ, SIG_IGN);
  setrlimit(RLIMIT_FSIZE, &tiny);
  static char big[100000];
  const ep_status status = ep_file_write("kept.txt", big, sizeof big, &err);
  setrlimit(RLIMIT_FSIZE, &old);
  assert_int_equal(status, EP_ERR_IO);
  assert_non_null(strstr(err.text, "cannot write all of kept.txt"));
  char *text;
  size_t size;
  assert_int_equal(ep_file_read("kept.txt", &text, &size, NULL), EP_OK);
  assert_string_equal(text, "kept");
  free(text);
}

static void missing_files_are_named(void **state) {
  (void)state;
  ep_error err = {0};
  char *text;
  size_t size;
  assert_int_equal(ep_file_read("nowhere/file", &text, &size, &err), EP_ERR_IO);
  assert_non_null(strstr(err.text, "nowhere/file"));
  memset(&err, 0, sizeof err);
  assert_int_equal(ep_file_read(".", &text, &size, &err), EP_ERR_IO);
  assert_non_null(strstr(err.text, "folder"));
  memset(&err, 0, sizeof err);
  assert_int_equal(ep_file_write("nowhere/file", "x", 1, &err), EP_ERR_IO);
}

static void folders_are_made_and_files_in_the_way_named(void **state) {
  (void)state;
  ep_error err = {0};
  assert_int_equal(ep_make_folders("a/b/c", &err), EP_OK);
  assert_int_equal(ep_make_folders("a/b/c", &err), EP_OK);
  assert_int_equal(ep_file_write("a/file", "x", 1, &err), EP_OK);
  assert_int_equal(ep_make_folders("a/file/d", &err), EP_ERR_IO);
}

static void paths_come_apart_and_together(void **state) {
  (void)state;
  char out[EP_PATH_MAX];
  ep_path_join("dir", "x.veg", out, NULL);
  assert_string_equal(out, "dir/x.veg");
  ep_path_join("dir", "/x.veg", out, NULL);
  assert_string_equal(out, "/x.veg");
  ep_path_folder("a/b.veg", out, NULL);
  assert_string_equal(out, "a");
  ep_path_folder("b.veg", out, NULL);
  assert_string_equal(out, ".");
  ep_path_stem("a.b/c.d.veg", out, NULL);
  assert_string_equal(out, "c.d");
  assert_string_equal(ep_path_extension("a.b/c"), "");
  assert_string_equal(ep_path_extension("a.b/c.msh"), "msh");
}

static void random_numbers_repeat_and_are_uniform(void **state) {
  (void)state;
  ep_random a = ep_random_seed(7, 1), b = ep_random_seed(7, 1), c = ep_random_seed(7, 2);
  int same = 0;
  for (int i = 0; i < 100; i++) {
    const uint32_t x = ep_random_u32(&a);
    assert_int_equal(x, ep_random_u32(&b));
    same += x == ep_random_u32(&c);
  }
  assert_in_range(same, 0, 1);
  enum { COUNT = 100000 };
  double mean = 0, variance = 0;
  int bins[10] = {0};
  for (int i = 0; i < COUNT; i++) {
    const double z = ep_random_normal(&a);
    mean += z / COUNT;
    variance += z * z / COUNT;
    bins[ep_random_below(&a, 10)]++;
  }
  // Five standard errors: 5 / sqrt(1e5), 5 sqrt(2 / 1e5), 5 sqrt(1e5 * 0.09).
  assert_true(fabs(mean) < 0.016 && fabs(variance - 1) < 0.023);
  for (int i = 0; i < 10; i++) assert_in_range(bins[i], COUNT / 10 - 475, COUNT / 10 + 475);
}

// Against the transitive closure of the pairs, by brute force.
static void forests_hold_the_closure_of_their_pairs(void **state) {
  (void)state;
  enum { COUNT = 40, PAIRS = 60 };
  ep_random rng = ep_random_seed(3, 1);
  int parent[COUNT], group[COUNT], groups = COUNT;
  ep_forest_start(parent, COUNT);
  for (int i = 0; i < COUNT; i++) group[i] = i;
  for (int pair = 0; pair < PAIRS; pair++) {
    const int a = ep_random_below(&rng, COUNT), b = ep_random_below(&rng, COUNT);
    const int low = group[a] < group[b] ? group[a] : group[b], high = group[a] + group[b] - low;
    assert_int_equal(ep_forest_join(parent, a, b), low != high);
    groups -= low != high;
    for (int i = 0; i < COUNT; i++)
      if (group[i] == high) group[i] = low;
    // groups are named by their lowest member, as roots are
    for (int i = 0; i < COUNT; i++) assert_int_equal(ep_forest_root(parent, i), group[i]);
  }
  assert_in_range(groups, 2, COUNT / 2); // not all one, and not trivially apart
}

static void texts_are_fit_for_attributes(void **state) {
  (void)state;
  char *text;
  size_t size;
  ep_output out;
  assert_int_equal(ep_output_open(&out, "escaped.txt", NULL), EP_OK);
  ep_write_escaped(out.file, "<a b=\"c\"> & 'd', \xc3\xa9");
  assert_int_equal(ep_output_commit(&out, NULL), EP_OK);
  assert_int_equal(ep_file_read("escaped.txt", &text, &size, NULL), EP_OK);
  assert_string_equal(text, "&lt;a b=&quot;c&quot;&gt; &amp; &apos;d&apos;, \xc3\xa9");
  free(text);
}

// RFC 3629: shortest forms only, no surrogates, nothing above U+10FFFF.
static void any_bytes_become_utf8(void **state) {
  (void)state;
  static const struct {
    const char *text, *readable; // NULL: as it is
  } cases[] = {{"", NULL},
               {"caf\xc3\xa9 \xf0\x9f\x92\x83", NULL},
               {"\xed\x9f\xbf\xee\x80\x80\xf4\x8f\xbf\xbf", NULL},
               {"caf\xe9", "caf\xef\xbf\xbd"},
               {"\xe9.veg", "\xef\xbf\xbd.veg"},
               {"\xc0\xaf", "\xef\xbf\xbd\xef\xbf\xbd"},
               {"\xe0\x80\xaf", "\xef\xbf\xbd\xef\xbf\xbd\xef\xbf\xbd"},
               {"\xed\xa0\x80", "\xef\xbf\xbd\xef\xbf\xbd\xef\xbf\xbd"},
               {"a\xf0\x9f\x92", "a\xef\xbf\xbd\xef\xbf\xbd\xef\xbf\xbd"}};
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    char *readable = ep_text_to_utf8(cases[i].text);
    assert_int_equal(ep_text_is_utf8(cases[i].text), cases[i].readable == NULL);
    assert_string_equal(readable, cases[i].readable ? cases[i].readable : cases[i].text);
    assert_true(ep_text_is_utf8(readable));
    free(readable);
  }
}

// A rename onto a device would put a file in its place, and /dev/zero never ends.
static void devices_and_inputs_are_no_results(void **state) {
  (void)state;
  ep_error err = {0};
  ep_output out;
  char *text;
  size_t size;
  const ep_status opened = ep_output_open(&out, "/dev/null", &err);
  if (opened == EP_OK) ep_output_discard(&out);
  assert_int_equal(opened, EP_ERR_IO);
  assert_non_null(strstr(err.text, "device"));
  err = (ep_error){0};
  assert_int_equal(ep_output_place("/dev/null", &err), EP_ERR_IO);
  err = (ep_error){0};
  assert_int_equal(ep_output_open(&out, ".", &err), EP_ERR_IO);
  assert_non_null(strstr(err.text, "folder"));
  err = (ep_error){0};
  assert_int_equal(ep_file_read("/dev/null", &text, &size, &err), EP_ERR_IO);
  assert_non_null(strstr(err.text, "device"));
  assert_int_equal(ep_file_write("abc", "abc", 3, NULL), EP_OK);
  ep_file_remove("def", NULL);
  assert_int_equal(symlink("abc", "def"), 0);
  err = (ep_error){0};
  assert_int_equal(ep_output_spares("def", "./abc", &err), EP_ERR_IO);
  assert_non_null(strstr(err.text, "def"));
  assert_int_equal(ep_output_spares("new", "./abc", NULL), EP_OK);
}

// What a terminal of `columns` is sent while a stage draws its progress; in a process of its own,
// whose stderr is the terminal.
static void drawn_on_terminal(unsigned short columns, char *out, size_t size) {
  const int terminal = posix_openpt(O_RDWR | O_NOCTTY);
  const struct winsize window = {.ws_row = 24, .ws_col = columns};
  assert_true(terminal >= 0 && grantpt(terminal) == 0 && unlockpt(terminal) == 0);
  const int other = open(ptsname(terminal), O_RDWR | O_NOCTTY);
  assert_true(other >= 0 && ioctl(other, TIOCSWINSZ, &window) == 0);
  const pid_t child = fork();
  if (child == 0) {
    dup2(other, STDERR_FILENO);
    ep_log log = ep_log_default(false);
    ep_progress_begin(&log, "training forces", 123456);
    for (int i = 0; i < 3; i++) {
      log.shown = 0; // draw at once
      ep_progress(&log, 61728 + i);
    }
    ep_progress_end(&log);
    _exit(log.terminal ? 0 : 1);
  }
  close(other);
  size_t used = 0;
  for (ssize_t got; used + 1 < size && (got = read(terminal, out + used, size - used - 1)) > 0;)
    used += (size_t)got;
  out[used] = '\0';
  close(terminal);
  int status;
  assert_int_equal(waitpid(child, &status, 0), child);
  assert_int_equal(status, 0);
}

// A line as long as the terminal is wide goes on below and is not drawn over any more.
static void progress_stays_on_its_line(void **state) {
  (void)state;
  static const unsigned short columns[] = {200, 80, 60, 40};
  for (size_t i = 0; i < sizeof columns / sizeof *columns; i++) {
    char text[4096];
    int bars = 0, times = 0;
    drawn_on_terminal(columns[i], text, sizeof text);
    for (char *line = strtok(text, "\r\n"); line; line = strtok(NULL, "\r\n")) {
      const char *shown = strncmp(line, "\033[K", 3) == 0 ? line + 3 : line;
      if (strlen(shown) >= columns[i]) fail_msg("%d columns: '%s'", columns[i], shown);
      bars += strstr(shown, "#.") != NULL;
      times += strstr(shown, "s left") != NULL;
    }
    assert_int_equal(bars, columns[i] >= 80 ? 3 : 0);
    if (columns[i] >= 80) assert_int_equal(times, 3);
  }
}

static void hashes_tell_contents_apart(void **state) {
  (void)state;
  const ep_digest a = ep_hash_bytes("abc", 3), b = ep_hash_bytes("abd", 3);
  assert_int_equal(strlen(a.hex), 32);
  assert_string_not_equal(a.hex, b.hex);
  ep_digest c;
  assert_int_equal(ep_file_write("abc", "abc", 3, NULL), EP_OK);
  assert_int_equal(ep_hash_file("abc", &c, NULL), EP_OK);
  assert_string_equal(a.hex, c.hex);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(first_error_is_kept),
      cmocka_unit_test(long_context_is_cut_not_overrun),
      cmocka_unit_test(output_replaces_only_on_commit),
      cmocka_unit_test(full_disk_loses_nothing),
      cmocka_unit_test(missing_files_are_named),
      cmocka_unit_test(folders_are_made_and_files_in_the_way_named),
      cmocka_unit_test(paths_come_apart_and_together),
      cmocka_unit_test(random_numbers_repeat_and_are_uniform),
      cmocka_unit_test(forests_hold_the_closure_of_their_pairs),
      cmocka_unit_test(texts_are_fit_for_attributes),
      cmocka_unit_test(any_bytes_become_utf8),
      cmocka_unit_test(devices_and_inputs_are_no_results),
      cmocka_unit_test(progress_stays_on_its_line),
      cmocka_unit_test(hashes_tell_contents_apart),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
