#include "app/run/run.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/plan/session.h"
#include "app/process.h"
#include "app/report.h"
#include "app/run/outputs.h"

// ---- plan ------------------------------------------------------------------------------------

static bool is_cached(const ep_session *session, const ep_stage *stage) {
  char path[EP_PATH_MAX];
  if (!stage->runs || !ep_stage_is_baked(stage->kind)) return false;
  ep_cache_path(&session->cache, stage->name, &stage->key,
                stage->kind == EP_STAGE_MODEL ? "epm" : "ept", path);
  return ep_path_exists(path);
}

ep_status ep_command_plan(const ep_cli *cli, ep_error *err) {
  ep_session session;
  EP_TRY(ep_session_open(cli, &session, err));
  const ep_plan *plan = &session.plan;
  bool *in_cache = calloc((size_t)plan->count, sizeof *in_cache);
  ep_status status = in_cache ? EP_OK : ep_fail(err, EP_ERR_MEMORY, "no memory for the plan");
  for (int i = 0; i < plan->count && status == EP_OK; i++)
    in_cache[i] = is_cached(&session, &plan->stage[i]);
  if (status == EP_OK && cli->json)
    status = ep_report_print(ep_report_plan(&session.scene, &session.shapes, plan, in_cache), err);
  else if (status == EP_OK)
    ep_report_plan_text(&session.scene, &session.shapes, plan, in_cache);
  free(in_cache);
  ep_session_close(&session);
  return status;
}

// ---- run -------------------------------------------------------------------------------------

// The baked model: from the cache, or by the baker.
static ep_status get_model(const ep_cli *cli, ep_session *session, ep_model_file *model,
                           ep_error *err) {
  char path[EP_PATH_MAX];
  ep_session_model_path(session, path);
  const double started = ep_seconds();
  ep_error broken = {0};
  if (ep_path_exists(path)) {
    if (ep_model_file_open(path, model, &broken) == EP_OK) {
      for (int i = 0; i < session->plan.count; i++) session->plan.stage[i].cached = true;
      ep_plan_find(&session->plan, EP_STAGE_MODEL)->seconds = ep_seconds() - started;
      return EP_OK;
    }
    ep_notice(&session->log, "cache: %s", broken.text);
  }
  json_t *report;
  EP_TRY(ep_baker_run(cli, &report, err));
  session->log.warnings +=
      (int)json_integer_value(json_object_get(report, "warnings")); // said by the baker
  const bool good = ep_report_take_stages(&session->plan, json_object_get(report, "stages"));
  json_decref(report);
  if (!good) return ep_fail(err, EP_ERR_FORMAT, "the baker's report cannot be read");
  return ep_model_file_open(path, model, err);
}

static json_t *fractions(const ep_model *model, const double *q, double *largest) {
  json_t *list = json_array();
  *largest = NAN;
  for (int i = 0; list && i < model->size.k; i++) {
    const double fraction = ep_example_fraction(model, q, i);
    *largest = fmax(*largest, fraction); // fmax passes NaN over
    json_array_append_new(list, ep_json_number(fraction));
  }
  return list;
}

// Of the sets of examples, in the order of their rest shapes among the weights.
static json_t *region_names(const ep_session *session) {
  json_t *list = json_array();
  for (int i = 0; list && i < session->shapes.sets; i++) {
    const int region = session->shapes.set[i];
    json_array_append_new(
        list, json_string(region < 0 ? "everywhere" : session->scene.region[region].name));
  }
  return list;
}

// The farthest any moment of the run has gone towards an example.
static double farthest_fraction(const ep_model *model, const ep_record *record) {
  double most = NAN;
  for (int row = 0; row < record->rows; row++)
    for (int i = 0; i < model->size.k; i++)
      most = fmax(most,
                  ep_example_fraction(model, record->q + (size_t)row * (size_t)model->size.r, i));
  return most; // fmax passes NaN over
}

// Of every recorded state: runs of one model agree in it exactly where their trajectories do.
static ep_digest trajectory_digest(const ep_model *model, const ep_record *record) {
  const size_t count = (size_t)record->rows * (size_t)model->size.r * sizeof(double);
  const ep_digest part[3] = {
      ep_hash_bytes(record->q, count), ep_hash_bytes(record->velocity, count),
      ep_hash_bytes(record->frame, record->frame ? (size_t)record->rows * sizeof(ep_frame) : 0)};
  return ep_hash_bytes(part, sizeof part);
}

static void add_timing(json_t *report, const ep_record *record) {
  const int steps = record->rows > 0 ? record->rows - 1 : 0;
  json_object_set_new(report, "steps_done", json_integer(steps));
  json_object_set_new(report, "t_interp_ms", ep_json_number(ep_median(steps, record->target_ms)));
  json_object_set_new(report, "t_step_ms", ep_json_number(ep_median(steps, record->step_ms)));
  json_object_set_new(report, "newton_iterations", json_integer(record->newton_iterations));
  json_object_set_new(report, "target_evaluations", json_integer(record->target_evaluations));
  json_object_set_new(report, "halved_steps", json_integer(record->halvings));
  json_object_set_new(report, "unfolded_steps", json_integer(record->unfolded));
}

static json_t *contact_of(const ep_model *model, const ep_record *record) {
  return json_pack("{s:i, s:f, s:f}", "touching", record->most_touching, "penetration",
                   record->deepest, "penetration_share", record->deepest / model->rest_scale);
}

// The run's JSON object; out names the folder of the results.
static json_t *make_report(const ep_session *session, const ep_model_file *file,
                           const ep_record *record, const char *folder) {
  const ep_scene *scene = &session->scene;
  const ep_model *model = &file->model;
  json_t *report = json_object();
  if (!report) return NULL;
  json_object_set_new(report, "scene", json_string(scene->name));
  json_object_set_new(report, "vertices", json_integer(model->size.n));
  json_object_set_new(report, "tets", json_integer(model->size.nt));
  json_object_set_new(report, "examples", json_integer(model->size.k));
  json_object_set_new(report, "m", json_integer(model->size.m ? scene->eigenfunctions : 0));
  json_object_set_new(report, "r", json_integer(model->size.r));
  json_object_set_new(report, "s", json_integer(model->size.s));
  json_object_set_new(report, "dt", json_real(scene->dt));
  json_object_set_new(report, "steps", json_integer(scene->steps));
  json_object_set_new(report, "stages", ep_report_stages(&session->plan));
  add_timing(report, record);
  const int last = record->rows - 1, k = model->size.k;
  const int shapes = k + ep_model_regions(model);
  json_t *weights = last >= 0 && record->weights
                        ? ep_json_numbers(shapes, record->weights + (size_t)last * (size_t)shapes)
                        : json_array();
  json_object_set_new(report, "weights", weights);
  if (session->shapes.sets) json_object_set_new(report, "regions", region_names(session));
  if (record->green_weights && last >= 0) {
    json_object_set_new(report, "alpha", json_real(scene->green.alpha));
    json_object_set_new(report, "green_weights",
                        ep_json_numbers(k, record->green_weights + (size_t)last * (size_t)k));
  }
  if (record->frame && last >= 0) {
    const double *from = record->momentum, *to = from + 6 * (size_t)last;
    json_object_set_new(report, "center", ep_json_numbers(3, record->frame[last].c));
    json_object_set_new(
        report, "momentum",
        json_pack("{s:o, s:o}", "start", ep_json_numbers(6, from), "end", ep_json_numbers(6, to)));
  }
  json_object_set_new(report, "cubature_error",
                      json_pack("{s:o, s:o}", "train", ep_json_number(file->train_error),
                                "held_out", ep_json_number(file->held_out_error)));
  if (record->contact) json_object_set_new(report, "contact", contact_of(model, record));
  json_object_set_new(report, "kernels", json_string(record->isa));
  const ep_digest digest = trajectory_digest(model, record);
  json_object_set_new(report, "trajectory_hash", json_string(digest.hex));
  json_object_set_new(report, "inverted_tets", json_integer(record->max_inverted));
  double largest = NAN;
  if (last >= 0)
    json_object_set_new(
        report, "example_fractions",
        fractions(model, record->q + (size_t)last * (size_t)model->size.r, &largest));
  json_object_set_new(report, "example_fraction", ep_json_number(largest));
  json_object_set_new(report, "example_fraction_most",
                      ep_json_number(farthest_fraction(model, record)));
  json_object_set_new(report, "warnings", json_integer(session->log.warnings));
  json_object_set_new(report, "results", ep_json_text(folder));
  return report;
}

static ep_status report_run(const ep_cli *cli, ep_session *session, const ep_model_file *model,
                            const ep_record *record, const char *folder, ep_error *err) {
  if (record->max_inverted)
    ep_warn(&session->log,
            "up to %d tets are inside out after a step: weaken the loads, raise "
            "reduction.elements, or see with 'eigenpose check' whether the material is in SI units",
            record->max_inverted);
  if (record->unfolded)
    ep_warn(&session->log,
            "the object was jammed turned over and unfolded in %d steps, without its material and "
            "examples: weaken the loads or take a milder start",
            record->unfolded);
  json_t *report = make_report(session, model, record, folder);
  if (!report) return ep_fail(err, EP_ERR_MEMORY, "no memory for the report");
  ep_status status = ep_outputs_summary(folder, report, err);
  if (status == EP_OK && cli->json) status = ep_report_print(json_incref(report), err);
  if (status == EP_OK && !cli->json) {
    ep_summary_text(stdout, report);
    printf("results: %s\n", folder);
  }
  json_decref(report);
  return status;
}

static ep_status simulate(const ep_cli *cli, ep_session *session, const ep_model_file *model,
                          const char *folder, ep_error *err) {
  ep_record record;
  const ep_status simulated = ep_simulate(&session->scene, &session->shapes, &model->model,
                                          cli->kernels, &session->log, &record, err);
  if (simulated != EP_OK && record.rows < 2) {
    ep_record_free(&record);
    return simulated;
  }
  // After a failed step its error is the one to report; what was simulated is still written.
  ep_error second = {0};
  ep_error *place = simulated == EP_OK ? err : &second;
  ep_status status = ep_outputs_write(folder, &session->scene, &session->shapes, &model->model,
                                      &record, &session->log, place);
  if (status == EP_OK && simulated == EP_OK)
    status = report_run(cli, session, model, &record, folder, place);
  ep_record_free(&record);
  return simulated != EP_OK ? simulated : status;
}

// Before anything is baked.
static ep_status check_kernels(const char *name, ep_error *err) {
  const ep_status status = name ? ep_isa_check(name) : EP_OK;
  if (status == EP_OK) return EP_OK;
  return ep_fail(err, status,
                 status == EP_ERR_UNSUPPORTED
                     ? "--kernels %s: this processor does not run them; leave the option out"
                     : "--kernels %s: there are baseline, avx2 and avx512",
                 name);
}

ep_status ep_command_run(const ep_cli *cli, ep_error *err) {
  ep_session session;
  ep_model_file model = {0};
  char fallback[EP_PATH_MAX];
  EP_TRY(check_kernels(cli->kernels, err));
  EP_TRY(ep_session_open(cli, &session, err));
  ep_status status = ep_path_join("out", session.scene.name, fallback, err);
  const char *folder = cli->out ? cli->out : fallback;
  if (status == EP_OK) status = ep_outputs_begin(folder, &session.scene, err);
  if (status == EP_OK) status = get_model(cli, &session, &model, err);
  if (status == EP_OK) status = simulate(cli, &session, &model, folder, err);
  ep_model_file_close(&model);
  ep_session_close(&session);
  return status;
}
