// Claims: the page of many runs shows what each run left and nothing else: its pictures named
// relative to the page, its numbers beside the paper's, what the plan used apart from what it left
// out; a run that left no summary is counted and its last words are said; text is escaped; a list
// that is none is refused with its place. Every scene of the project's own list exists, and every
// paper scene is in the list.
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
#include <dirent.h>

#include "app/figures/figures.h"
#include "base/files.h"

static void put(const char *path, const char *text) {
  FILE *file = fopen(path, "w");
  assert_non_null(file);
  assert_true(fputs(text, file) >= 0);
  assert_int_equal(fclose(file), 0);
}

static char *get(const char *path) {
  FILE *file = fopen(path, "r");
  assert_non_null(file);
  char *text = calloc(1, 1 << 20);
  assert_non_null(text);
  assert_true(fread(text, 1, (1 << 20) - 1, file) > 0);
  fclose(file);
  return text;
}

static const char list[] =
    "{\"title\": \"A & B\", \"figures\": [{\"name\": \"one\", \"text\": \"a < b\","
    " \"runs\": [{\"scene\": \"p/good\", \"label\": \"good one\"},"
    "            {\"scene\": \"p/bad\", \"label\": \"bad one\"}],"
    " \"paper\": [{\"model\": \"theirs\", \"tets\": 4321, \"t_total\": 41.5}]}]}";

static void make_runs(void) {
  ep_error err = {0};
  assert_int_equal(ep_make_folders("figures/p/good/full", &err), EP_OK);
  assert_int_equal(ep_make_folders("figures/p/bad", &err), EP_OK);
  put("figures/list.json", list);
  put("figures/p/good/summary.json",
      "{\"vertices\": 77, \"tets\": 123, \"examples\": 2, \"m\": 10, \"r\": 30, \"s\": 60,"
      " \"dt\": 0.01, \"steps_done\": 50, \"newton_iterations\": 125, \"t_step_ms\": 0.125,"
      " \"t_interp_ms\": 0.0625, \"example_fraction\": 0.5,\"example_fraction_most\": 0.875, "
      "\"inverted_tets\": 0,"
      " \"contact\": {\"penetration_share\": 0.0042}}");
  put("figures/p/good/plan.json",
      "{\"stages\": [{\"name\": \"modes\", \"runs\": true, \"reason\": \"15 modes\"},"
      " {\"name\": \"contact\", \"runs\": false, \"reason\": \"no obstacles\"}]}");
  put("figures/p/good/strip.png", "x");
  put("figures/p/good/full/results.json",
      "{\"vertices\": 77, \"tets\": 123, \"points\": [{\"method\": \"cubature\","
      " \"position_error\": 0.03}, {\"method\": \"full\", \"step_median_us\": 98000}]}");
  put("figures/p/bad/run.log", "warning: first\nsaid at <last>\n\n");
}

static void the_page_shows_what_the_runs_left(void **state) {
  (void)state;
  ep_figures figures;
  ep_error err = {0};
  make_runs();
  if (ep_figures_read("figures/list.json", "figures", &figures, &err) != EP_OK)
    fail_msg("%s", err.text);
  assert_int_equal(figures.runs, 2);
  assert_int_equal(figures.failed, 1);
  assert_string_equal(figures.figure[0].run[1].why, "said at <last>");
  assert_int_equal(ep_figures_write("figures", &figures, &err), EP_OK);
  ep_figures_free(&figures);
  char *page = get("figures/index.html");
  static const char *const wanted[] = {"A &amp; B",
                                       "a &lt; b",
                                       "1 of 2 runs",
                                       "src=\"p/good/strip.png\"",
                                       "<td>123</td>",
                                       "<td>0.125</td>",
                                       "<td>2.50</td>" /* 125 iterations in 50 steps */,
                                       "<td>0.42</td>",
                                       "<td>87.5</td><td>50.0</td>",
                                       "<td>4321</td>",
                                       "<td>41.5</td>",
                                       "<td>98</td>" /* the full space, ms */,
                                       "within 3 %",
                                       "said at &lt;last&gt;"};
  for (size_t i = 0; i < sizeof wanted / sizeof *wanted; i++)
    if (!strstr(page, wanted[i])) fail_msg("the page lacks %s", wanted[i]);
  assert_null(strstr(page, "p/bad/strip.png"));
  assert_null(strstr(page, "final.png")); // no run has one
  const char *used = strstr(page, "<b>Used</b>"), *left = strstr(page, "<b>Left out</b>");
  assert_non_null(used);
  assert_non_null(left);
  const char *modes = strstr(page, "<li>modes: 15 modes"), *contact = strstr(page, "<li>contact");
  assert_true(used < modes && modes < left && left < contact);
  free(page);
}

static void a_list_that_is_none_is_refused(void **state) {
  (void)state;
  static const struct {
    const char *text, *said;
  } bad[] = {{"{\"title\": \"x\",\n \"figures\": [}", "bad.json:2:"},
             {"{\"figures\": []}", "'title' is missing"},
             {"{\"title\": \"x\", \"figures\": []}", "'figures' must be a list"},
             {"{\"title\": \"x\", \"figures\": [{\"name\": \"n\"}]}", "figures.0: 'text'"},
             {"{\"title\": \"x\", \"figures\": [{\"name\": \"n\", \"text\": \"t\"}]}",
              "figures.0: 'runs' must"},
             {"{\"title\": \"x\", \"figures\": [{\"name\": 7, \"text\": \"t\"}]}", "figures.0"}};
  for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
    ep_figures figures;
    ep_error err = {0};
    put("bad.json", bad[i].text);
    assert_int_equal(ep_figures_read("bad.json", ".", &figures, &err), EP_ERR_FORMAT);
    if (!strstr(err.text, bad[i].said)) fail_msg("'%s' does not say %s", err.text, bad[i].said);
  }
  ep_figures figures;
  ep_error err = {0};
  assert_int_equal(ep_figures_read("nowhere.json", ".", &figures, &err), EP_ERR_IO);
}

// ---- the project's own list --------------------------------------------------------------------

static int scenes_in(const char *folder) {
  int count = 0;
  DIR *dir = opendir(folder);
  assert_non_null(dir);
  for (struct dirent *entry; (entry = readdir(dir)) != NULL;) {
    const char *dot = strrchr(entry->d_name, '.');
    count += dot && strcmp(dot, ".yaml") == 0;
  }
  closedir(dir);
  return count;
}

static void every_paper_scene_is_in_the_list(void **state) {
  (void)state;
  ep_figures figures;
  ep_error err = {0};
  if (ep_figures_read(EP_SOURCE_DIR "/data/figures.json", "nowhere", &figures, &err) != EP_OK)
    fail_msg("%s", err.text);
  for (int i = 0; i < figures.count; i++)
    for (int k = 0; k < figures.figure[i].nruns; k++) {
      char path[EP_PATH_MAX];
      snprintf(path, sizeof path, EP_SOURCE_DIR "/data/scenes/%s.yaml",
               figures.figure[i].run[k].scene);
      if (!ep_path_exists(path)) fail_msg("%s is in the list and nowhere else", path);
    }
  assert_int_equal(figures.failed, figures.runs); // none was run in that folder
  assert_int_equal(figures.runs, scenes_in(EP_SOURCE_DIR "/data/scenes/zhao2018") +
                                     scenes_in(EP_SOURCE_DIR "/data/scenes/zhang2015"));
  ep_figures_free(&figures);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(the_page_shows_what_the_runs_left),
      cmocka_unit_test(a_list_that_is_none_is_refused),
      cmocka_unit_test(every_paper_scene_is_in_the_list),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
