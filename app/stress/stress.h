// `eigenpose stress`: one scene pushed far beyond what it was made for, one value at a time -
// stiffness and time step, Poisson's ratio, density, loads, impulses, start states, shares of the
// examples - in every variant the scene allows (materials, evaluators, paths of the examples, held
// and free). Runs in the baker process (PETSc).
#ifndef EP_APP_STRESS_STRESS_H
#define EP_APP_STRESS_STRESS_H

#include <jansson.h>
#include <stdio.h>

#include "app/cli.h"
#include "app/plan/model_file.h"
#include "app/plan/session.h"
#include "app/run/stepper.h"

typedef enum ep_stress_axis {
  EP_STRESS_STIFFNESS, // Young's modulus times value; with second: dt [s], else the scene's
  EP_STRESS_POISSON,
  EP_STRESS_STIFF,    // Young's modulus times value at Poisson's ratio 0.4999
  EP_STRESS_DENSITY,  // times value
  EP_STRESS_DT,       // [s]
  EP_STRESS_LOAD,     // loads times value
  EP_STRESS_IMPULSE,  // start velocity: value tenths of the diagonal a second
  EP_STRESS_START,    // value: ep_stress_start
  EP_STRESS_ALPHA,    // share of the examples, Green-strain path
  EP_STRESS_STRENGTH, // of the example force
  EP_STRESS_AXES
} ep_stress_axis;
const char *ep_stress_axis_name(ep_stress_axis axis);

typedef enum ep_stress_start {
  EP_START_INVERTED, // mirrored along the longest axis, as far as the modes can
  EP_START_POINT,    // collapsed to a point, to a plane
  EP_START_PLANE,
  EP_START_RANDOM,
  EP_START_FAR, // three diagonals away
  EP_STRESS_STARTS
} ep_stress_start;
const char *ep_stress_start_name(ep_stress_start start);

// What the scene is turned into before an axis is swept.
typedef enum ep_stress_variant {
  EP_VARIANT_SCENE, // as it is
  EP_VARIANT_STVK,
  EP_VARIANT_STVK_VOLUME,
  EP_VARIANT_NEOHOOKEAN,
  EP_VARIANT_COROTATIONAL,
  EP_VARIANT_CUBATURE, // the other evaluator
  EP_VARIANT_CUBIC,
  EP_VARIANT_LB, // the other path
  EP_VARIANT_GREEN,
  EP_VARIANT_FREE, // nothing held
  EP_VARIANTS
} ep_stress_variant;
const char *ep_stress_variant_name(ep_stress_variant variant);

// From best to worst.
typedef enum ep_stress_outcome {
  EP_STRESS_SAFE,
  EP_STRESS_SUBDIVIDED, // some steps were done in halves
  EP_STRESS_INVERTED,   // ends with inverted tets
  EP_STRESS_GROWTH,     // energy grew in a step without load
  EP_STRESS_REFUSED,    // refused with a reason: the bake, or a step with the state unchanged
  EP_STRESS_BROKEN,     // NaN, or a failed step that changed the state
  EP_STRESS_OUTCOMES
} ep_stress_outcome;
const char *ep_stress_outcome_name(ep_stress_outcome outcome);

typedef struct ep_stress_case {
  ep_stress_variant variant;
  ep_stress_axis axis;
  double value, second; // second: 0 where the axis has none
} ep_stress_case;
// The value as it is tabulated, into text (32).
void ep_stress_value_text(const ep_stress_case *c, char *text);

typedef struct ep_stress_result {
  ep_stress_case what;
  ep_stress_outcome outcome;
  char why[200];          // of a refusal
  int steps, failed_step; // steps done; the one that failed, or -1
  double newton_median;   // iterations a step
  int newton_most;
  long line_search, projections;
  int halvings, unfolded, inverted_start, inverted_most, inverted_end;
  double growth;   // largest (E' - E) / max E of a step of implicit Euler without loads and example
                   // force; NAN where it is not measured
  double step_us;  // median
  double *history; // (numbers) of the state before the step that failed (ep_state_get_history), or
  size_t numbers;  // NULL
  double t;        // [s] of it
  bool loaded;     // the scene's loads acted
  bool coasting;   // without example force
} ep_stress_result;
void ep_stress_result_free(ep_stress_result *result);

// All cases of a scene, malloc'd; quick: only the ends of every axis, no variants.
ep_status ep_stress_list(const ep_session *base, bool quick, int *count, ep_stress_case **out,
                         ep_error *err);
// The scene of a case: `scene`, a copy with loads of its own, is changed in place.
void ep_stress_apply(const ep_stress_case *c, ep_scene *scene);

// A case under way: scene, meshes, model, stepper.
typedef struct ep_stress_bench {
  ep_scene scene; // shares all but the loads with the base
  ep_load *load;
  ep_shapes shapes;
  ep_plan plan;
  ep_model_file model;
  ep_stepper *stepper;
  double *x; // (n x 3) scratch positions
} ep_stress_bench;
// Bakes what is not in the cache; PETSc must run. Close it also after a failure.
ep_status ep_stress_open(const ep_session *base, const ep_stress_case *c, ep_stress_bench *out,
                         ep_error *err);
void ep_stress_close(ep_stress_bench *bench);
// Put the state where the case starts.
ep_status ep_stress_begin(ep_stress_bench *bench, const ep_stress_case *c, ep_error *err);
// Inverted tets of the state; -1 where a position is not finite.
int ep_stress_inverted(ep_stress_bench *bench);

// Bake and simulate one case. A refusal is a result, not an error; errors are those of the machine
// (memory, disk).
ep_status ep_stress_run(const ep_session *base, const ep_stress_case *c, ep_stress_result *out,
                        ep_error *err);
// Do the step of a stored state (failures/*.json) again and tell about it on stdout, as JSON or as
// text. Errors: EP_ERR_IO, EP_ERR_FORMAT (cut, of an older version, of another model),
// EP_ERR_NUMERIC (the step fails again).
ep_status ep_stress_replay(const ep_session *base, const char *path, bool json, ep_error *err);

enum { EP_STRESS_FORMAT = 2 }; // "format" of these files

// ---- what comes of it --------------------------------------------------------------------------
typedef struct ep_stress_report {
  const char *name; // of the scene
  int count;
  const ep_stress_result *result; // (count)
  double seconds;
} ep_stress_report;
// index.html, results.csv, results.json and a file for every failure in `folder`.
ep_status ep_stress_write(const char *folder, const ep_stress_report *report, ep_error *err);
json_t *ep_stress_json(const ep_stress_report *report);
void ep_stress_text(FILE *out, const ep_stress_report *report);

ep_status ep_command_stress(const ep_cli *cli, ep_error *err);

#endif
