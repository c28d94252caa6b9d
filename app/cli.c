#include "app/cli.h"

#include <argp.h>
#include <errno.h>
#include <fcntl.h>
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/report.h"

static const char general_help[] =
    "Usage: eigenpose COMMAND [OPTION...] FILE\n"
    "Elastic objects that deform the way example poses suggest, even poses of other meshes.\n"
    "\n"
    "  run      simulate a scene (baking first what is not baked yet) and write the animation\n"
    "  bake     prepare a scene: poses, basis, cubature, model; kept in the cache\n"
    "  check    find what is wrong with meshes or scenes, say where and what to do; repair meshes\n"
    "  plan     say which stages a scene needs, and why the others are left out\n"
    "  align    map the examples of a scene to its object and judge the maps\n"
    "  compare  measure methods and settings of a scene against the full space\n"
    "  stress   push a scene far beyond what it was made for, and report what stays sound\n"
    "  report   one page of the runs of many scenes, figure by figure\n"
    "  eigen    Laplace-Beltrami eigenvalues and eigenfunctions of a tet mesh\n"
    "\n"
    "  eigenpose COMMAND --help   the options of a command\n"
    "  eigenpose --version\n"
    "\n"
    "A first try: eigenpose run data/scenes/bar.yaml\n"
    "Exit codes: 0 done, 1 wrong use, 2 file not readable or writable, 3 file format,\n"
    "4 unusable mesh, 5 scene, 6 bad map, 7 solver, 8 memory, 9 not supported,\n"
    "10 check found errors.\n";

enum { COUNT_MAX = 100000 };
enum {
  KEY_COUNT = 'n',
  KEY_OUT = 'o',
  KEY_QUIET = 'q',
  KEY_JSON = 'j',
  KEY_SET = 'S',
  KEY_CACHE = 'c',
  KEY_REPAIR = 'r',
  KEY_LARGEST = 'l',
  KEY_SERVED = 0x100,
  KEY_QUICK,
  KEY_REPLAY,
  KEY_KERNELS
};

#define OPTION_JSON                                                                                \
  { "json", KEY_JSON, 0, 0, "One JSON object on stdout, all else on stderr", 0 }
#define OPTION_QUIET                                                                               \
  { "quiet", KEY_QUIET, 0, 0, "No notices and no progress", 0 }
#define OPTION_SET                                                                                 \
  {                                                                                                \
    "set", KEY_SET, "KEY=VALUE", 0,                                                                \
        "Override a value of the scene; lists by number: families.0.map.accept=true", 0            \
  }
#define OPTION_CACHE                                                                               \
  {                                                                                                \
    "cache", KEY_CACHE, "DIR", 0,                                                                  \
        "Baked results are kept here (default: $EIGENPOSE_CACHE, $XDG_CACHE_HOME/eigenpose, "      \
        "~/.cache/eigenpose)",                                                                     \
        0                                                                                          \
  }

static const struct argp_option eigen_options[] = {
    {"count", KEY_COUNT, "M", 0, "Number of eigenpairs (default 10)", 0},
    {"out", KEY_OUT, "FILE", 0,
     "Write the eigenfunctions as a .vtu file, and a .png picture of them beside it", 0},
    OPTION_JSON,
    OPTION_QUIET,
    {0}};
static const struct argp_option align_options[] = {
    {"out", KEY_OUT, "DIR", 0,
     "Leave pictures (.png) and fields (.vtu) of every map and transferred pose", 0},
    OPTION_JSON,
    OPTION_QUIET,
    OPTION_SET,
    OPTION_CACHE,
    {0}};
static const struct argp_option report_options[] = {
    {"out", KEY_OUT, "DIR", 0,
     "Folder that holds the runs' folders, and gets the page (default: out)", 0},
    OPTION_JSON,
    OPTION_QUIET,
    {0}};
static const struct argp_option plan_options[] = {
    OPTION_JSON, OPTION_QUIET, OPTION_SET, OPTION_CACHE, {0}};
static const struct argp_option bake_options[] = {
    {"out", KEY_OUT, "FILE", 0,
     "Copy the model there (.epm), for an engine that embeds the run time", 0},
    OPTION_JSON,
    OPTION_QUIET,
    OPTION_SET,
    OPTION_CACHE,
    {"served", KEY_SERVED, 0, OPTION_HIDDEN, NULL, 0},
    {0}};
static const struct argp_option check_options[] = {
    {"repair", KEY_REPAIR, "OUT", 0,
     "Write the mesh repaired (.veg or .vtu): tets turned round, those without volume or repeated "
     "left out, vertices in the same place joined",
     0},
    {"largest", KEY_LARGEST, 0, 0, "With --repair: keep the largest part only", 0},
    OPTION_JSON,
    OPTION_QUIET,
    OPTION_SET,
    {0}};
static const struct argp_option run_options[] = {
    {"out", KEY_OUT, "DIR", 0, "Folder of the results (default: out/NAME)", 0},
    {"kernels", KEY_KERNELS, "LEVEL", 0,
     "Instruction set of the steps: baseline, avx2 or avx512 (default: the widest this processor "
     "runs); the trajectory is the same to the bit",
     0},
    OPTION_JSON,
    OPTION_QUIET,
    OPTION_SET,
    OPTION_CACHE,
    {0}};
static const struct argp_option compare_options[] = {
    {"out", KEY_OUT, "DIR", 0, "Folder of the page and the tables (default: out/NAME-compare)", 0},
    OPTION_JSON,
    OPTION_QUIET,
    OPTION_SET,
    OPTION_CACHE,
    {0}};
static const struct argp_option stress_options[] = {
    {"out", KEY_OUT, "DIR", 0, "Folder of the report (default: out/NAME-stress)", 0},
    {"quick", KEY_QUICK, 0, 0, "Only the ends of every axis, only the scene itself", 0},
    {"replay", KEY_REPLAY, "FILE", 0, "Do the step of a failure (DIR/failures/*.json) once more",
     0},
    OPTION_JSON,
    OPTION_QUIET,
    OPTION_SET,
    OPTION_CACHE,
    {0}};

static const struct {
  const char *name, *args, *doc;
  const struct argp_option *options;
} commands[EP_COMMANDS] = {
    [EP_COMMAND_EIGEN] = {"eigen", "MESH",
                          "Laplace-Beltrami eigenvalues of a tetrahedral mesh, ascending, without "
                          "the constant.",
                          eigen_options},
    [EP_COMMAND_ALIGN] = {"align", "SCENE",
                          "Map the examples of a scene to its object and print the quality of "
                          "every map.",
                          align_options},
    [EP_COMMAND_PLAN] = {"plan", "SCENE",
                         "Print which stages a scene needs, which are left out, and why.",
                         plan_options},
    [EP_COMMAND_BAKE] = {"bake", "SCENE",
                         "Compute everything a run needs and keep it in the cache.", bake_options},
    [EP_COMMAND_COMPARE] = {"compare", "SCENE",
                            "Simulate a scene by every method and setting of its `compare` section "
                            "and report error against run time: a page, its chart, tables. "
                            "Finished points are kept in the cache: an interrupted sweep goes on "
                            "where it stopped.",
                            compare_options},
    [EP_COMMAND_STRESS] = {"stress", "SCENE",
                           "Push a scene far beyond what it was made for - stiffness, time step, "
                           "loads, start states, materials - and report what stays sound. A "
                           "failing state is kept to be done again.",
                           stress_options},
    [EP_COMMAND_REPORT] = {"report", "FIGURES",
                           "Make one page of many runs: FIGURES (JSON, as data/figures.json) lists "
                           "figures and the scenes that show them; each scene's results are looked "
                           "for in DIR/SCENE.",
                           report_options},
    [EP_COMMAND_CHECK] =
        {"check", "FILE...",
         "Find what is wrong with meshes, or with a scene and its meshes: a line for "
         "each finding with its place and what to do, and a table. Exit code 10 "
         "where errors are found; warnings do not fail.",
         check_options},
    [EP_COMMAND_RUN] = {"run", "SCENE",
                        "Simulate a scene. Leaves the animation (.vtu/.pvd, .glb), a picture, the "
                        "trajectory and a summary in the folder of the results.",
                        run_options},
};

static error_t take_set(ep_cli *cli, const char *arg, struct argp_state *state) {
  if (cli->nsets == EP_SETS_MAX) argp_error(state, "more than %d --set", EP_SETS_MAX);
  if (!strchr(arg, '=')) argp_error(state, "--set %s: expected KEY=VALUE", arg);
  cli->set[cli->nsets++] = arg;
  return 0;
}

static error_t take_count(ep_cli *cli, const char *arg, struct argp_state *state) {
  char *end;
  const long count = strtol(arg, &end, 10);
  if (*arg == '\0' || *end || count < 1 || count > COUNT_MAX)
    argp_error(state, "--count %s: expected a number from 1 to %d", arg, COUNT_MAX);
  cli->count = (int)count;
  return 0;
}

// A file or folder; an unset variable of a script gives "", which is neither.
static error_t take_path(const char **out, const char *option, const char *arg,
                         struct argp_state *state) {
  if (!*arg) argp_error(state, "--%s is empty; name a file or a folder", option);
  *out = arg;
  return 0;
}

static error_t take(int key, char *arg, struct argp_state *state) {
  ep_cli *cli = state->input;
  switch (key) {
  case KEY_COUNT:
    return take_count(cli, arg, state);
  case KEY_OUT:
    return take_path(&cli->out, "out", arg, state);
  case KEY_CACHE:
    return take_path(&cli->cache, "cache", arg, state);
  case KEY_REPAIR:
    return take_path(&cli->repair, "repair", arg, state);
  case KEY_LARGEST:
    cli->largest = true;
    return 0;
  case KEY_JSON:
    cli->json = true;
    return 0;
  case KEY_QUIET:
    cli->quiet = true;
    return 0;
  case KEY_QUICK:
    cli->quick = true;
    return 0;
  case KEY_KERNELS:
    cli->kernels = arg;
    return 0;
  case KEY_REPLAY:
    return take_path(&cli->replay, "replay", arg, state);
  case KEY_SERVED:
    cli->served = true;
    return 0;
  case KEY_SET:
    return take_set(cli, arg, state);
  case ARGP_KEY_ARG:
    if (cli->ninputs == EP_INPUTS_MAX) argp_error(state, "more than %d files", EP_INPUTS_MAX);
    cli->inputs[cli->ninputs++] = arg;
    if (cli->command == EP_COMMAND_CHECK && cli->input) return 0;
    if (cli->input) argp_error(state, "one file is enough; '%s' is too much", arg);
    cli->input = arg;
    return 0;
  case ARGP_KEY_END:
    if (!cli->input) argp_error(state, "no file given");
    return 0;
  default:
    return ARGP_ERR_UNKNOWN;
  }
}

static void wrong_command(const char *given) {
  if (given) fprintf(stderr, "eigenpose: there is no command '%s'\n\n", given);
  fputs(general_help, stderr);
  exit(EP_ERR_ARGUMENT);
}

static ep_command find_command(const char *name) {
  for (int i = 0; i < EP_COMMANDS; i++)
    if (strcmp(name, commands[i].name) == 0) return (ep_command)i;
  wrong_command(name);
  return EP_COMMANDS;
}

void ep_cli_parse(int argc, char **argv, ep_cli *out) {
  *out = (ep_cli){.count = 10};
  if (argc < 2) wrong_command(NULL);
  if (strcmp(argv[1], "--help") == 0 || strcmp(argv[1], "-h") == 0 ||
      strcmp(argv[1], "help") == 0) {
    fputs(general_help, stdout);
    exit(0);
  }
  if (strcmp(argv[1], "--version") == 0) {
    puts("eigenpose " EP_VERSION);
    exit(0);
  }
  out->command = find_command(argv[1]);
  const struct argp argp = {.options = commands[out->command].options,
                            .parser = take,
                            .args_doc = commands[out->command].args,
                            .doc = commands[out->command].doc};
  char name[64];
  snprintf(name, sizeof name, "eigenpose %s", commands[out->command].name);
  char *kept = argv[1];
  argv[1] = name; // argp shows it in its texts
  argp_err_exit_status = EP_ERR_ARGUMENT;
  argp_parse(&argp, argc - 1, argv + 1, 0, NULL, out);
  argv[1] = kept;
}

void ep_cli_guard_streams(void) {
  for (int stream = 0; stream < 3; stream++)
    if (fcntl(stream, F_GETFD) < 0) // the lowest free number is this one
      (void)!open("/dev/null", stream == 0 ? O_WRONLY : O_RDONLY);
}

ep_status ep_cli_flush(ep_error *err) {
  if (fflush(stdout) == 0 && !ferror(stdout)) return EP_OK;
  return ep_fail(err, EP_ERR_IO, "cannot write all of the report to stdout: %s",
                 strerror(errno ? errno : EIO));
}

int ep_cli_fail(const ep_cli *cli, const ep_error *err) {
  if (!cli->served) fprintf(stderr, "eigenpose: %s\n", err->text);
  if (cli->json) {
    json_t *root = json_pack("{s:{s:s, s:o}}", "error", "status", ep_status_name(err->status),
                             "message", ep_json_text(err->text));
    ep_error ignored = {0};
    if (root) ep_report_print(root, &ignored);
  }
  return (int)err->status;
}
