// How many tets of the whole mesh are inverted while a scene is pushed far beyond its loads, and
// after it was let go: inversions SCENE [--starts] [--set key=value ...]. One row a case: material,
// held or free, the path of the examples, the share alpha, the loads times value (60 steps, then 60
// without loads and example force) or the start state (60 steps, then 300 without example force);
// the inverted at the start, the most at any time, those at the end, the steps that unfolded.
// --starts: starts only, but in both materials that keep elements from turning over, held and free.
#include <stdio.h>
#include <string.h>

#include "app/stress/stress.h"
#include "linalg/petsc.h"

static const double alphas[] = {0, 0.5, 1}, powers[] = {1, 10, 100, 1e3, 1e4};

static bool starts_only(const char *word) {
  return word && strcmp(word, "--starts") == 0;
}

static ep_status one(const ep_session *session, const char *path, double alpha,
                     const ep_stress_case *c, ep_error *err) {
  ep_stress_result result;
  char text[32];
  EP_TRY(ep_stress_run(session, c, &result, err));
  ep_stress_value_text(c, text);
  printf("%-12s %-4s %-6s %5.2f %-6s %-9s %6d %6d %6d %6d %7.3g %6d %9.2g %8.1f  %s %s\n",
         ep_material_name(session->scene.model), session->scene.nfixed ? "held" : "free", path,
         alpha, ep_stress_axis_name(c->axis), text, result.inverted_start, result.inverted_most,
         result.inverted_end, result.unfolded, result.newton_median, result.halvings, result.growth,
         result.step_us, ep_stress_outcome_name(result.outcome), result.why);
  fflush(stdout);
  ep_stress_result_free(&result);
  return EP_OK;
}

static ep_status cases(ep_session *session, const char *path, bool pushes, ep_error *err) {
  const double alpha = session->scene.green.alpha;
  for (size_t i = 0; i < sizeof powers / sizeof *powers && session->scene.nloads && pushes; i++) {
    const ep_stress_case c = {.axis = EP_STRESS_LOAD, .value = powers[i]};
    EP_TRY(one(session, path, alpha, &c, err));
  }
  for (int start = 0; start < EP_STRESS_STARTS; start++) {
    const ep_stress_case c = {.axis = EP_STRESS_START, .value = start};
    EP_TRY(one(session, path, alpha, &c, err));
  }
  return EP_OK;
}

static ep_status sweep(ep_session *session, bool pushes, ep_error *err) {
  if (session->shapes.examples == 0) return cases(session, "none", pushes, err);
  const int methods = session->scene.methods;
  const double alpha = session->scene.green.alpha;
  ep_status status = EP_OK;
  session->scene.methods = EP_METHOD_GREEN;
  for (size_t i = 0; i < sizeof alphas / sizeof *alphas && status == EP_OK; i++) {
    session->scene.green.alpha = alphas[i];
    status = cases(session, "green", pushes, err);
  }
  session->scene.methods = EP_METHOD_LB;
  session->scene.green.alpha = 0;
  if (status == EP_OK && (methods & EP_METHOD_LB)) status = cases(session, "lb", pushes, err);
  session->scene.methods = methods;
  session->scene.green.alpha = alpha;
  return status;
}

static ep_status all_starts(ep_session *session, ep_error *err) {
  static const ep_material material[] = {EP_STVK_VOLUME, EP_STABLE_NEOHOOKEAN};
  const int fixed = session->scene.nfixed;
  for (size_t i = 0; i < sizeof material / sizeof *material; i++)
    for (int free = 0; free < 2; free++) {
      if (free && fixed == 0) continue;
      session->scene.model = material[i];
      session->scene.nfixed = free ? 0 : fixed;
      EP_TRY(sweep(session, false, err));
    }
  session->scene.nfixed = fixed;
  return EP_OK;
}

static ep_status tables(ep_session *session, bool starts, ep_error *err) {
  printf("%-12s %-4s %-6s %5s %-6s %-9s %6s %6s %6s %6s %7s %6s %9s %8s\n", "material", "", "path",
         "alpha", "axis", "value", "start", "most", "end", "unfold", "Newton", "halved", "growth",
         "us");
  return starts ? all_starts(session, err) : sweep(session, true, err);
}

int main(int argc, char **argv) {
  ep_cli cli = {.command = EP_COMMAND_STRESS, .quiet = true};
  ep_error err = {0};
  ep_session session;
  if (argc > 1) cli.input = argv[1];
  const int starts = argc > 2 && starts_only(argv[2]);
  for (int i = 2 + starts; i + 1 < argc && cli.nsets < EP_SETS_MAX && strcmp(argv[i], "--set") == 0;
       i += 2)
    cli.set[cli.nsets++] = argv[i + 1];
  if (!cli.input || argc != 2 + starts + 2 * cli.nsets) {
    fprintf(stderr, "usage: inversions SCENE [--starts] [--set key=value ...]\n");
    return EP_ERR_ARGUMENT;
  }
  ep_status status = ep_session_open(&cli, &session, &err);
  if (status != EP_OK) return ep_cli_fail(&cli, &err);
  status = ep_petsc_start(&err);
  if (status == EP_OK) {
    status = tables(&session, starts, &err);
    ep_petsc_stop();
  }
  ep_session_close(&session);
  return status == EP_OK ? 0 : ep_cli_fail(&cli, &err);
}
