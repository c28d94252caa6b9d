// `eigenpose compare`: the scene simulated by every method and setting of its sweep, each measured
// against one reference trajectory. Runs in the baker process (PETSc).
#ifndef EP_APP_COMPARE_COMPARE_H
#define EP_APP_COMPARE_COMPARE_H

#include <jansson.h>
#include <stdio.h>

#include "app/bake/bake.h"
#include "app/cli.h"
#include "app/run/simulate.h"
#include "reduced/bake/model_build.h"

// What is measured of a point, in the order it is cached and tabulated:
//   X(name, what the table says)
#define EP_POINT_NUMBERS(X)                                                                        \
  X(offline_s, "offline [s]")                                                                      \
  X(memory_bytes, "memory [bytes]") /* of a step: model without what only display needs, state */  \
  X(step_min_us, "step, min [us]")                                                                 \
  X(step_median_us, "step, median [us]")                                                           \
  X(target_median_us, "of it interpolation [us]")                                                  \
  X(force_error, "force error")       /* |f - U^T f_full| / |U^T f_full|, rms on its own path */   \
  X(position_error, "position error") /* largest over vertices and time, over the diagonal */      \
  X(velocity_error, "velocity error") /* the same over the reference's largest speed */            \
  X(energy_error, "energy drift")     /* largest |E - E_ref| over the largest E_ref, E = W + T */  \
  X(weight_error, "weights") /* largest difference of an example's weight from the reference's */  \
  X(newton_per_step, "Newton per step")                                                            \
  X(halvings, "halved steps")                                                                      \
  X(inverted, "inverted tets")

typedef struct ep_point {
  ep_method method;
  ep_material material;
  int path; // of the examples: EP_METHOD bits, 0 without examples
  int r, s; // s: elements used (cubic: for examples and penalty alone), 0 for full
  ep_precision precision;
  double dt;          // [s]
  const char *solver; // of the interpolation; "" without examples. Borrowed
  bool cached, failed;
  char why[256]; // where it failed
#define X(name, text) double name;
  EP_POINT_NUMBERS(X)
#undef X
  double *error_at; // (frames) position error over time
} ep_point;

// Weights of the examples stand in sets: the interpolation's, then the Green-strain path's.
int ep_weight_sets(int path);

// Times all runs meet at, every `every`-th of the longest time step.
typedef struct ep_frames {
  int count;
  double interval; // [s]; frame i is at (i + 1) interval
  size_t n3;
  double *x, *v;  // (count x n3) displacements, velocities
  double *energy; // (count) elastic + kinetic
  int nweights;   // sets x examples
  double *weight; // (count x nweights)
} ep_frames;
ep_status ep_frames_make(int count, double interval, size_t n3, int nweights, ep_frames *out,
                         ep_error *err);
void ep_frames_free(ep_frames *frames);

// The reference run of a path, for the sweep's first material: how the paths differ.
typedef struct ep_path_run {
  int path, nweights;
  double *weight; // (frames x nweights)
  double *apart;  // (frames) largest distance from the first path's run, over the diagonal
} ep_path_run;

typedef struct ep_comparison {
  const ep_scene *scene;
  const char *name;
  int vertices, tets, examples;
  double diagonal;
  int frames;
  double frame_interval;
  int count;
  ep_point *point; // (count)
  int paths;       // 0 without examples
  ep_path_run path[EP_PATHS];
} ep_comparison;

// ---- one material, path and r: everything of the bake up to the basis -------------------------
typedef struct ep_bench {
  ep_scene scene; // the given one with this r, material and path; its pointers are borrowed
  const ep_cache *cache;
  ep_log *log;
  ep_shapes shapes;
  ep_plan plan;
  ep_bake bake;
  bool open;            // bake is open and has its basis
  double basis_seconds; // of the basis, always measured anew
} ep_bench;
// Reads the meshes and plans; ep_bench_prepare bakes (PETSc must run).
ep_status ep_bench_open(const ep_scene *scene, const ep_point *point, const ep_cache *cache,
                        ep_log *log, ep_bench *out, ep_error *err);
ep_status ep_bench_prepare(ep_bench *bench, ep_error *err);
void ep_bench_close(ep_bench *bench);
// A name for results of this bench, its scene's simulation and what `kind` says.
ep_digest ep_bench_key(const ep_bench *bench, const char *kind, const ep_frames *frames);
// A model with the cubature `c` or all elements (NULL), and the polynomials `cubic` (packed, in
// `precision`) unless NULL; free with ep_model_memory_free.
ep_status ep_bench_model(ep_bench *bench, const ep_cubature *c, const double *cubic,
                         ep_precision precision, ep_model_memory *out, ep_error *err);

// ---- points ------------------------------------------------------------------------------------
// Simulate in the full space with point->dt; fills frames and what is measured of the run itself.
ep_status ep_compare_full(ep_bench *bench, ep_point *point, ep_frames *frames, ep_error *err);
// The same for a reduced method.
ep_status ep_compare_reduced(ep_bench *bench, ep_point *point, ep_frames *frames, ep_error *err);
// Largest |a - b| over the vertices of displacements (n3); b NULL: 0.
double ep_compare_farthest(size_t n3, const double *a, const double *b);
// Errors of a run against the reference, into point.
ep_status ep_compare_errors(const ep_frames *run, const ep_frames *reference, double diagonal,
                            ep_point *point, ep_error *err);

const char *ep_precision_name(ep_precision precision); // "double", "float"

// ---- what comes of it --------------------------------------------------------------------------
// The fastest point below the scene's budgets, or -1; why (256) says how it was chosen.
int ep_compare_recommend(const ep_comparison *c, char *why);
// From which r on cubature (s elements) is faster than the polynomials of the same precision, the
// interpolation left out, for one path: at the first time step, material and solver of the sweep.
typedef struct ep_crossover {
  int path;
  ep_precision precision;
  int compared;                 // numbers of modes where both were run
  int low, high;                // the smallest and largest of them
  double low_ratio, high_ratio; // cubature's step over the polynomials' there
  double r; // between two r by interpolation of the logarithms; low: faster from there on at once;
            // NAN: not within the sweep
} ep_crossover;
enum { EP_CROSSOVERS = 2 * EP_PATHS, EP_CROSSOVER_TEXT = 320 };
// One for each path and precision that was compared; returns their number.
int ep_compare_crossovers(const ep_comparison *c, int s, ep_crossover list[EP_CROSSOVERS]);
// What it says, a sentence without its full stop; text (EP_CROSSOVER_TEXT).
void ep_compare_crossover_text(const ep_comparison *c, int s, const ep_crossover *x, char *text);

// Six moments of a run from rest to its end, as a .png.
ep_status ep_compare_picture(const char *path, const char *title, const ep_mesh *mesh,
                             const ep_frames *frames, ep_error *err);
// index.html, chart.svg, chart.png, results.csv, frames.csv, results.json in `folder`,
// which must be there.
ep_status ep_compare_write(const char *folder, const ep_comparison *c, ep_error *err);
json_t *ep_compare_json(const ep_comparison *c);
void ep_compare_text(FILE *out, const ep_comparison *c);

ep_status ep_command_compare(const ep_cli *cli, ep_error *err);

#endif
