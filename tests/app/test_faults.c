// Claims, through the real program: whatever is taken away while it works - memory, the disk, its
// life, or the cache by a second bake of the same scene - it ends with one message and a documented
// exit code (or was killed), what stood in the results before is still there, and nothing half
// written is ever taken as whole: the next run bakes the same bytes as one nobody disturbed.
//
// EP_FAULTS_THOROUGH=1 fails every allocation instead of a sample and kills 60 times.
#include <poll.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>
// clang-format off
#include <cmocka.h>
// clang-format on

#include "base/files.h"
#include "base/random.h"
#include "box.h"
#include "program.h"

static const char scene_text[] =
    "schema: 1\nname: beam\nobject: {mesh: beam.veg}\n"
    "fixed: [{box: {low: [-1, -1, -1], high: [0.01, 1, 1]}}]\n"
    "families: [{poses: [beam-bent.veg]}]\n"
    "reduction: {eigenfunctions: 4, modes: 6, linear_modes: 4, path_samples: 1, elements: 10,\n"
    "  training_poses: 10, amplitude: 0.1}\n"
    "simulation: {dt: 0.02, steps: 10, damping: {mass: 0.5, stiffness: 0.05}}\n"
    "loads: [{push: {box: {low: [0.9, -1, -1], high: [2, 2, 2]}, force: [0, 6, 0]}}]\n"
    "output: {every: 5}\n";

static const char run_line[] = "run beam.yaml --json --out %s --cache %s";

static bool thorough(void) {
  return getenv("EP_FAULTS_THOROUGH") != NULL;
}

// The JSON object on stdout carries the error, stderr the same sentence once.
static void assert_one_message(const char *what) {
  char *said = text_of("err.txt");
  json_t *root = report();
  const char *message =
      json_string_value(json_object_get(json_object_get(root, "error"), "message"));
  if (!message) fail_msg("%s: no error in the JSON object", what);
  const char *first = strstr(said, message);
  if (!first || strstr(first + 1, message)) fail_msg("%s: not one message:\n%s", what, said);
  json_decref(root);
  free(said);
}

// A run in a cache that was disturbed gives what the undisturbed one gave.
static void assert_recovers(const char *cache, const char *what) {
  int count;
  if (program("", run_line, "after", cache) != 0)
    fail_msg("%s: the next run fails: %s", what, text_of("err.txt"));
  if (!same_files("cache-whole", cache, ".ept", &count) || count < 5)
    fail_msg("%s: stages differ from an undisturbed bake (%d)", what, count);
  if (!same_files("cache-whole", cache, ".epm", &count) || count != 1)
    fail_msg("%s: the model differs from an undisturbed bake", what);
  if (!same_files("whole", "after", "trajectory.csv", &count) || count != 1)
    fail_msg("%s: the trajectory differs", what);
}

static void assert_no_leftovers(const char *folder, const char *what) {
  if (shell("! find %s -name '*.tmp' 2>/dev/null | grep .", folder) != 0)
    fail_msg("%s: temporary files are left in %s: %s", what, folder, text_of("out.txt"));
}

#ifdef EP_FAILING_MALLOC // not under the sanitizers, which have an allocator of their own
// ---- memory ------------------------------------------------------------------------------------

static long allocations_of(const char *name, const char *format, const char *out,
                           const char *cache) {
  char before[512];
  snprintf(before, sizeof before,
           "EP_FAIL_PROGRAM=%s EP_FAIL_COUNT=$PWD/count.txt LD_PRELOAD=" EP_FAILING_MALLOC, name);
  shell("rm -rf %s count.txt", cache);
  if (program(before, format, out, cache) != 0) fail_msg("%s", text_of("err.txt"));
  char *text = text_of("count.txt");
  const long count = strtol(text, NULL, 10);
  free(text);
  return count;
}

// Fail one allocation of `name` while it runs into a new cache.
static void fail_one(const char *name, long at) {
  char before[512], what[96];
  snprintf(what, sizeof what, "%s, allocation %ld", name, at);
  snprintf(before, sizeof before,
           "rm -rf cache-memory memory; EP_FAIL_PROGRAM=%s EP_FAIL_AT=%ld "
           "LD_PRELOAD=" EP_FAILING_MALLOC,
           name, at);
  const int code = program(before, run_line, "memory", "cache-memory");
  if (code == 0) { // not needed after all: then the result must be whole
    assert_recovers("cache-memory", what);
    return;
  }
  if (code != EP_ERR_MEMORY) fail_msg("%s: exit code %d: %s", what, code, text_of("err.txt"));
  assert_one_message(what);
  assert_no_leftovers("cache-memory memory", what);
}

// About `samples` of the allocations, every one once where thorough.
static void fail_many(const char *name, int samples) {
  const long count = allocations_of(name, run_line, "memory", "cache-count");
  assert_true(count > 20); // it does allocate
  const long stride = thorough() || count < samples ? 1 : count / samples;
  long done = 0;
  for (long at = stride / 2; at < count; at += stride, done++) fail_one(name, at);
  print_message("%s: %ld of %ld allocations failed once\n", name, done, count);
}

static void the_command_runs_out_of_memory(void **state) {
  (void)state;
  fail_many("eigenpose", 12);
}

static void the_baker_runs_out_of_memory(void **state) {
  (void)state;
  fail_many("eigenpose-bake", 16);
}

#endif
// ---- disk --------------------------------------------------------------------------------------

// A run in a file system of its own with `free` KiB beside the results of an earlier run, in a
// mount only this process sees; what is left in it is copied to after-disk.
static const char on_small_disk[] =
    "free=$1\nshift\nmkdir -p small\n"
    "size=$(($(du -sk whole | cut -f1) + 8 + free))\n"
    "mount -t tmpfs -o size=${size}k tmpfs small || exit 77\n"
    "cp -r whole small/results || exit 77\n"
    "\"$@\"\ncode=$?\nrm -rf after-disk\ncp -r small after-disk\nexit $code\n";

static void a_full_disk_loses_nothing(void **state) {
  (void)state;
  static const int room[] = {0, 8, 24, 48, 96, 192};
  int failures = 0;
  write_text("small-disk.sh", on_small_disk);
  if (shell("unshare -rm sh -c 'mkdir -p small && mount -t tmpfs tmpfs small'") != 0) {
    print_message("file systems may not be mounted here: skipped\n");
    skip();
  }
  for (size_t i = 0; i < sizeof room / sizeof *room; i++) {
    char what[64];
    snprintf(what, sizeof what, "disk full after %d KiB", room[i]);
    const int code = shell("unshare -rm sh small-disk.sh %d %s run beam.yaml --json --out "
                           "small/results --cache small/cache",
                           room[i], EP_COMMAND);
    if (code != 0) {
      if (code != EP_ERR_IO) fail_msg("%s: exit code %d: %s", what, code, text_of("err.txt"));
      assert_one_message(what);
      failures++;
    }
    int count;
    if (!same_files("whole", "after-disk/results", "trajectory.csv", &count) || count != 1)
      fail_msg("%s: earlier results are lost", what);
    assert_no_leftovers("after-disk", what);
    assert_recovers("after-disk/cache", what);
  }
  assert_true(failures >= 3);
}

// ---- killed ------------------------------------------------------------------------------------

static void run_and_kill(double seconds) {
  const pid_t child = fork();
  if (child < 0) fail_msg("cannot fork");
  if (child == 0) {
    setpgid(0, 0); // with the baker it starts
    if (!freopen("/dev/null", "w", stdout) || !freopen("/dev/null", "w", stderr)) _exit(1);
    execl(EP_COMMAND, EP_COMMAND, "run", "beam.yaml", "--out", "killed", "--cache", "cache-killed",
          (char *)NULL);
    _exit(1);
  }
  setpgid(child, child);
  const struct timespec time = {.tv_nsec = (long)(1e9 * seconds)};
  nanosleep(&time, NULL);
  kill(-child, SIGKILL);
  waitpid(child, NULL, 0);
}

static void killed_at_any_time_it_recovers(void **state) {
  (void)state;
  ep_random random = ep_random_seed(7, 0);
  const int times = thorough() ? 60 : 6;
  for (int i = 0; i < times; i++) {
    char what[64];
    const double seconds = 0.02 + 0.9 * ep_random_uniform(&random);
    snprintf(what, sizeof what, "killed after %.3f s", seconds);
    shell("rm -rf cache-killed killed");
    run_and_kill(seconds);
    run_and_kill(0.5 * seconds); // and once more on what the first left
    assert_recovers("cache-killed", what);
  }
}

// Whoever kills a run must not go on paying for its bake: the pipe's other end is held by the run
// and the baker it starts, and closes when both are gone.
static void a_bake_ends_with_its_run(void **state) {
  (void)state;
  int ends[2];
  write_box("large.veg", 24, 6, 6, 1, 0, 3e4); // baked in minutes
  assert_int_equal(pipe(ends), 0);
  const pid_t child = fork();
  if (child < 0) fail_msg("cannot fork");
  if (child == 0) {
    close(ends[0]);
    if (!freopen("/dev/null", "w", stdout) || !freopen("/dev/null", "w", stderr)) _exit(1);
    execl(EP_COMMAND, EP_COMMAND, "run", "beam.yaml", "--out", "orphan", "--cache", "cache-orphan",
          "--set", "object.mesh=large.veg", "--set", "families=[]", "--set",
          "reduction={modes: 40, linear_modes: 40, elements: 500, training_poses: 10000}",
          (char *)NULL);
    _exit(1);
  }
  close(ends[1]);
  const struct timespec time = {.tv_nsec = 600000000};
  nanosleep(&time, NULL);
  kill(child, SIGKILL); // not the baker
  int status;
  waitpid(child, &status, 0);
  struct pollfd end = {.fd = ends[0]};
  const int gone = poll(&end, 1, 3000);
  close(ends[0]);
  if (!WIFSIGNALED(status)) fail_msg("the bake is too fast for this test");
  if (gone != 1) fail_msg("the baker goes on without its run");
}

// ---- two at once -------------------------------------------------------------------------------

static void two_may_bake_the_same_scene(void **state) {
  (void)state;
  const int code =
      shell("rm -rf cache-two; %s run beam.yaml --quiet --out one --cache cache-two & first=$!; "
            "%s run beam.yaml --quiet --out two --cache cache-two; second=$?; "
            "wait $first && exit $second",
            EP_COMMAND, EP_COMMAND);
  if (code != 0) fail_msg("exit code %d: %s", code, text_of("err.txt"));
  int count;
  assert_true(same_files("one", "two", "trajectory.csv", &count) && count == 1);
  assert_recovers("cache-two", "two bakes at once");
  assert_no_leftovers("cache-two", "two bakes at once");
}

static int prepare(void **state) {
  (void)state;
  write_box("beam.veg", 6, 1, 1, 1, 0, 3e4);
  write_box("beam-bent.veg", 6, 1, 1, 1, 0.3, 3e4);
  write_text("beam.yaml", scene_text);
  shell("rm -rf cache-whole whole");
  if (program("", run_line, "whole", "cache-whole") != 0) {
    print_error("%s", text_of("err.txt"));
    return -1;
  }
  return 0;
}

int main(void) {
  const struct CMUnitTest tests[] = {
#ifdef EP_FAILING_MALLOC
      cmocka_unit_test(the_command_runs_out_of_memory),
      cmocka_unit_test(the_baker_runs_out_of_memory),
#endif
      cmocka_unit_test(a_full_disk_loses_nothing),
      cmocka_unit_test(killed_at_any_time_it_recovers),
      cmocka_unit_test(a_bake_ends_with_its_run),
      cmocka_unit_test(two_may_bake_the_same_scene),
  };
  return cmocka_run_group_tests(tests, prepare, NULL);
}
