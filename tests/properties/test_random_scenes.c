// Claims, on random scenes run by the real program: it ends, with
//   exit code 0, every step done and every number of the trajectory finite, nothing half-written
//   beside the results; or
//   one of the documented codes, one message, said once, and no summary that claims a run.
// Scenes without anything extreme end with 0. A second run, with nothing cached, leaves the same
// bytes. What fails is made smaller: pieces of the scene are left out as long as it still fails;
// its folder stays (scene-SEED; run it with EP_PROPERTY_SEED=SEED EP_PROPERTY_COUNT=1).
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
// clang-format off
#include <cmocka.h>
// clang-format on

#include "tests/app/program.h"
#include "tests/properties/random_scene.h"

// A case that takes longer hangs: the largest take a second or two, under sanitizers twenty times.
enum { SECONDS_MOST = 180, CODES = EP_STATUS_COUNT };

static int how_often[CODES]; // exit codes of the scenes so far

// Is the table of the run complete, and every number finite?
static bool table_is_sound(const char *folder, int rows, char *why) {
  char path[200];
  snprintf(path, sizeof path, "%s/out/trajectory.csv", folder);
  char *text = text_of(path), *rest = text;
  int lines = 0, columns = 0;
  bool good = true;
  for (char *line; good && (line = strsep(&rest, "\n")) && *line; lines++) {
    int fields = 0;
    for (char *field; good && (field = strsep(&line, ",")); fields++) {
      if (lines == 0) continue;
      char *after;
      const double value = strtod(field, &after);
      if (after == field || *after || !isfinite(value))
        good = breaks(why, "%s: row %d, column %d: '%s'", path, lines, fields, field);
    }
    if (lines == 0) columns = fields;
    if (good && fields != columns)
      good = breaks(why, "%s: row %d has %d of %d columns", path, lines, fields, columns);
  }
  free(text);
  if (good && lines != rows + 1) good = breaks(why, "%d rows of %d", lines - 1, rows);
  return good;
}

static bool ran_well(const random_scene *s, const char *folder, char *why) {
  static const char *const finite[] = {"steps_done", "r", "t_step_ms", "newton_iterations",
                                       "inverted_tets"};
  static const char *const files[] = {"animation.pvd", "animation.glb", "strip.png"};
  json_t *root = report();
  bool good = true;
  for (size_t i = 0; i < sizeof finite / sizeof *finite && good; i++)
    if (!json_is_number(json_object_get(root, finite[i])))
      good = breaks(why, "summary: %s is no number", finite[i]);
  const int steps = (int)json_integer_value(json_object_get(root, "steps"));
  if (good && number(root, "steps_done") != steps) good = breaks(why, "not all steps were done");
  json_decref(root);
  for (int i = 0; i < 3 && good; i++)
    if ((s->formats >> i & 1) && shell("test -s %s/out/%s", folder, files[i]) != 0)
      good = breaks(why, "%s is missing", files[i]);
  return good && table_is_sound(folder, steps + 1, why);
}

static int count_lines(const char *text, const char *beginning) {
  int count = 0;
  for (const char *line = text; line; line = strchr(line, '\n')) {
    line += *line == '\n';
    count += strncmp(line, beginning, strlen(beginning)) == 0;
  }
  return count;
}

static bool failed_well(const char *folder, int code, char *said, char *why) {
  json_t *root = report();
  const json_t *error = json_object_get(root, "error");
  const char *message = json_string_value(json_object_get(error, "message"));
  bool good = true;
  if (code < EP_ERR_IO || code > EP_ERR_UNSUPPORTED)
    good = breaks(why, "exit code %d is for other things", code);
  else if (!message || strlen(message) < 10 || !strstr(said, message))
    good = breaks(why, "the message is not in both places");
  else if (strstr(message, "the baker was ended") || strstr(message, "the baker failed"))
    good = breaks(why, "the baker fell over");
  else if (count_lines(said, "eigenpose: ") != 1)
    good = breaks(why, "not said once");
  else if (shell("test -e %s/out/summary.json", folder) == 0)
    good = breaks(why, "a summary of a run that failed");
  json_decref(root);
  return good;
}

static bool run_once(const random_scene *s, const char *folder, char *why, int *code) {
  char command[60];
  ep_random rng = ep_random_seed(s->seed, 6);
  const placement at = draw_scene_placement(s, &rng);
  if (shell("rm -rf %s", folder) != 0) return breaks(why, "%s cannot be removed", folder);
  write_scene(s, &at, folder, NULL);
  snprintf(command, sizeof command, "timeout %d", SECONDS_MOST);
  *code = program(command, "run %s/scene.yaml --json --cache %s/cache --out %s/out", folder, folder,
                  folder);
  if (*code < 0 || *code >= CODES)
    return breaks(why, *code == 124 ? "it hangs" : "it ends with %d", *code);
  char *said = text_of("err.txt"), inner[WHY] = "";
  bool good = !strstr(said, "runtime error") && !strstr(said, "Sanitizer");
  if (!good) snprintf(inner, sizeof inner, "a sanitizer spoke");
  good =
      good && (*code == 0 ? ran_well(s, folder, inner) : failed_well(folder, *code, said, inner));
  if (good && *code != 0 && s->tame) good = breaks(inner, "nothing in it is extreme");
  if (good && shell("find %s -name '*.tmp' | grep -q .", folder) == 0)
    good = breaks(inner, "something half-written is left");
  if (!good) breaks(why, "exit code %d: %.250s\n%.300s", *code, inner, said);
  free(said);
  return good;
}

static bool same_again(const random_scene *s, const char *folder, char *why) {
  char again[80];
  int code, count;
  snprintf(again, sizeof again, "%s-again", folder);
  if (!run_once(s, again, why, &code)) return false;
  char one[100], two[100];
  snprintf(one, sizeof one, "%s/out", folder);
  snprintf(two, sizeof two, "%s/out", again);
  const bool same = code != 0 || (same_files(one, two, ".csv", &count) && count == 1);
  if (same) shell("rm -rf %s", again);
  return same || breaks(why, "a second run leaves other bytes in %s", two);
}

static bool fails(const random_scene *s, const char *folder, char *why) {
  int code;
  return !run_once(s, folder, why, &code);
}

static void scenes_end_well(void **state) {
  (void)state;
  seeds all = seeds_begin(8);
  while (seeds_next(&all)) {
    random_scene s = draw_scene(all.now, 0.25);
    char folder[40], why[WHY] = "";
    int code;
    snprintf(folder, sizeof folder, "scene-%llu", (unsigned long long)all.now);
    if (!run_once(&s, folder, why, &code)) {
      make_scene_smaller(&s, folder, fails, why);
      seed_fails("test_random_scenes", all.now, why);
    }
    how_often[code]++;
    if (all.now % 4 == 0 && code == 0 && !same_again(&s, folder, why))
      seed_fails("test_random_scenes", all.now, why);
    shell("rm -rf %s", folder);
  }
  for (int i = 0; i < CODES; i++)
    if (how_often[i]) print_message("exit code %d: %d scenes\n", i, how_often[i]);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(scenes_end_well)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
