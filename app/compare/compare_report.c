// What comes of a comparison in words and numbers: recommendation, crossover, JSON, text.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "app/compare/compare.h"
#include "app/report.h"

const char *ep_precision_name(ep_precision precision) {
  return precision == EP_FLOAT ? "float" : "double";
}

// ---- recommendation ----------------------------------------------------------------------------

static bool fits(const ep_sweep *s, const ep_point *p) {
  return !p->failed && (s->budget_seconds == 0 || 1e-6 * p->step_median_us <= s->budget_seconds) &&
         (s->budget_error == 0 || p->position_error <= s->budget_error);
}

// Errors this close count as equal: then the time decides.
static const double SAME_ERROR = 1.02;

// With an error given the fastest that fits, else the most exact that fits the time.
static bool better(const ep_sweep *s, const ep_point *a, const ep_point *b) {
  if (s->budget_error > 0 || (a->position_error <= SAME_ERROR * b->position_error &&
                              b->position_error <= SAME_ERROR * a->position_error))
    return a->step_median_us < b->step_median_us;
  return a->position_error < b->position_error;
}

static void budget_text(const ep_sweep *s, char text[96]) {
  char time[48] = "", error[48] = "";
  if (s->budget_seconds > 0)
    snprintf(time, sizeof time, "a step of at most %g ms", 1e3 * s->budget_seconds);
  if (s->budget_error > 0)
    snprintf(error, sizeof error, "%sa position error of at most %g %%",
             s->budget_seconds > 0 ? " and " : "", 100 * s->budget_error);
  snprintf(text, 96, "%.47s%.47s", time, error);
}

int ep_compare_recommend(const ep_comparison *c, char *why) {
  const ep_sweep *s = &c->scene->sweep;
  char budget[96];
  int best = -1;
  *why = '\0';
  if (s->budget_seconds == 0 && s->budget_error == 0) return -1;
  budget_text(s, budget);
  for (int i = 0; i < c->count; i++)
    if (fits(s, &c->point[i]) && (best < 0 || better(s, &c->point[i], &c->point[best]))) best = i;
  if (best >= 0)
    snprintf(why, 256, "the %s setting with %s", s->budget_error > 0 ? "fastest" : "most exact",
             budget);
  else
    snprintf(why, 256, "no setting of this sweep has %s; sweep %s", budget,
             s->budget_error > 0 ? "more modes or elements" : "fewer modes or elements");
  return best;
}

// ---- crossover ---------------------------------------------------------------------------------

static const ep_point *find(const ep_comparison *c, ep_method method, int r, int s,
                            const ep_point *like) {
  for (int i = 0; i < c->count; i++) {
    const ep_point *p = &c->point[i];
    if (p->method == method && p->r == r && (method != EP_METHOD_CUBATURE || p->s == s) &&
        p->dt == like->dt && strcmp(p->solver, like->solver) == 0 &&
        p->material == like->material && p->path == like->path && p->precision == like->precision &&
        !p->failed)
      return p;
  }
  return NULL;
}

// The step without the interpolation, which is the same for both.
static double elastic_part(const ep_point *p) {
  return p->step_median_us - p->target_median_us;
}

// Of the first time step, material and solver of each path.
static ep_crossover crossover(const ep_comparison *c, int s, const ep_point *like) {
  const ep_sweep *sweep = &c->scene->sweep;
  ep_crossover x = {.path = like->path, .precision = like->precision, .r = NAN};
  double r_before = 0, before = NAN;
  for (int i = 0; i < sweep->nmodes; i++) {
    const int r = sweep->modes[i];
    const ep_point *a = find(c, EP_METHOD_CUBATURE, r, s, like);
    const ep_point *b = find(c, EP_METHOD_CUBIC, r, 0, like);
    if (!a || !b) continue;
    const double ratio = log(elastic_part(a) / elastic_part(b));
    if (x.compared++ == 0) {
      x.low = r;
      x.low_ratio = exp(ratio);
      if (ratio <= 0) x.r = r;
    } else if (!(ratio <= 0)) { // slower here: what was found at smaller r does not hold
      x.r = NAN;
    } else if (isnan(x.r)) {
      x.r = r_before * pow(r / r_before, before / (before - ratio));
    }
    x.high = r;
    x.high_ratio = exp(ratio);
    r_before = r;
    before = ratio;
  }
  return x;
}

int ep_compare_crossovers(const ep_comparison *c, int s, ep_crossover list[EP_CROSSOVERS]) {
  const ep_point *seen[EP_CROSSOVERS];
  int count = 0;
  for (int i = 0; i < c->count && count < EP_CROSSOVERS; i++) {
    const ep_point *p = &c->point[i];
    int known = 0;
    for (int j = 0; j < count; j++)
      known |= seen[j]->path == p->path && seen[j]->precision == p->precision;
    if (p->method != EP_METHOD_CUBATURE || p->s != s || known) continue;
    list[count] = crossover(c, s, p);
    if (list[count].compared > 0) seen[count++] = p;
  }
  return count;
}

void ep_compare_crossover_text(const ep_comparison *c, int s, const ep_crossover *x, char *text) {
  char who[96];
  snprintf(who, sizeof who, "Cubature with %d elements%s%s%s", s,
           x->precision == EP_FLOAT ? " in floats" : "", c->paths > 1 ? " on path " : "",
           c->paths > 1 ? ep_path_name(x->path) : "");
  if (isnan(x->r))
    snprintf(text, EP_CROSSOVER_TEXT,
             "%s does not overtake the cubic polynomials within the sweep (r = %d to %d): at r = "
             "%d its step takes %.2g times theirs, without interpolation",
             who, x->low, x->high, x->high, x->high_ratio);
  else if (x->r <= x->low)
    snprintf(text, EP_CROSSOVER_TEXT,
             "%s is faster than the cubic polynomials from the smallest r of the sweep on (%d: "
             "%.2g times their step, without interpolation); the crossover lies below",
             who, x->low, x->low_ratio);
  else
    snprintf(text, EP_CROSSOVER_TEXT,
             "%s overtakes the cubic polynomials at r = %.0f (step without interpolation)", who,
             x->r);
}

// ---- JSON --------------------------------------------------------------------------------------

static json_t *point_json(const ep_point *p, int frames) {
  json_t *o = json_pack("{s:s, s:s, s:s, s:s, s:i, s:i, s:f, s:s, s:b, s:b}", "method",
                        ep_method_name(p->method), "precision", ep_precision_name(p->precision),
                        "material", ep_material_name(p->material), "path", ep_path_name(p->path),
                        "r", p->r, "s", p->s, "dt", p->dt, "solver", p->solver, "cached",
                        (int)p->cached, "failed", (int)p->failed);
  if (!o) return NULL;
  if (p->failed) {
    json_object_set_new(o, "why", ep_json_text(p->why));
    return o;
  }
#define X(name, text) json_object_set_new(o, #name, ep_json_number(p->name));
  EP_POINT_NUMBERS(X)
#undef X
  if (p->error_at)
    json_object_set_new(o, "position_error_at", ep_json_numbers(frames, p->error_at));
  return o;
}

static json_t *crossovers_json(const ep_comparison *c) {
  const ep_sweep *sweep = &c->scene->sweep;
  json_t *out = json_array();
  for (int i = 0; out && i < sweep->nelements; i++) {
    ep_crossover list[EP_CROSSOVERS];
    char text[EP_CROSSOVER_TEXT];
    const int count = ep_compare_crossovers(c, sweep->elements[i], list);
    for (int j = 0; j < count; j++) {
      ep_compare_crossover_text(c, sweep->elements[i], &list[j], text);
      json_array_append_new(out, json_pack("{s:i, s:s, s:s, s:o, s:s}", "s", sweep->elements[i],
                                           "path", ep_path_name(list[j].path), "precision",
                                           ep_precision_name(list[j].precision), "r",
                                           ep_json_number(list[j].r), "says", text));
    }
  }
  return out;
}

static json_t *paths_json(const ep_comparison *c) {
  json_t *out = json_array();
  for (int i = 0; out && i < c->paths; i++) {
    const ep_path_run *run = &c->path[i];
    json_t *weights = json_array();
    for (int j = 0; weights && j < c->frames; j++)
      json_array_append_new(
          weights, ep_json_numbers(run->nweights, run->weight + (size_t)j * (size_t)run->nweights));
    json_array_append_new(out,
                          json_pack("{s:s, s:i, s:o, s:o}", "path", ep_path_name(run->path),
                                    "weight_sets", ep_weight_sets(run->path), "weights_at", weights,
                                    "apart_at", ep_json_numbers(c->frames, run->apart)));
  }
  return out;
}

json_t *ep_compare_json(const ep_comparison *c) {
  char why[256];
  const int best = ep_compare_recommend(c, why);
  json_t *points = json_array();
  for (int i = 0; points && i < c->count; i++)
    json_array_append_new(points, point_json(&c->point[i], c->frames));
  json_t *o = json_pack("{s:s, s:i, s:i, s:i, s:s, s:i, s:f, s:o, s:o, s:o}", "scene", c->name,
                        "vertices", c->vertices, "tets", c->tets, "examples", c->examples,
                        "reference", ep_method_name(c->scene->sweep.reference), "frames", c->frames,
                        "frame_interval", c->frame_interval, "crossover", crossovers_json(c),
                        "paths", paths_json(c), "points", points);
  if (o && *why)
    json_object_set_new(o, "recommendation", json_pack("{s:i, s:s}", "point", best, "why", why));
  return o;
}

// ---- text --------------------------------------------------------------------------------------

static void text_setting(FILE *out, const ep_point *p) {
  fprintf(out, "%-9s %-6s %-12s %-5s %4d %6d %9.3g %-12.26s ", ep_method_name(p->method),
          ep_precision_name(p->precision), ep_material_name(p->material), ep_path_name(p->path),
          p->method == EP_METHOD_FULL ? 0 : p->r, p->s, p->dt, p->solver);
}

void ep_compare_text(FILE *out, const ep_comparison *c) {
  char why[256];
  fprintf(out, "%s: %d vertices, %d tets, %d examples; errors against %s\n", c->name, c->vertices,
          c->tets, c->examples,
          c->scene->sweep.reference == EP_METHOD_FULL ? "the full space" : "all elements");
  fprintf(out, "%-9s %-6s %-12s %-5s %4s %6s %9s %-12s %9s %9s %10s %9s %9s %9s %9s\n", "method",
          "real", "material", "path", "r", "s", "dt", "solver", "us/step", "min", "offline s",
          "position", "velocity", "energy", "force");
  for (int i = 0; i < c->count; i++) {
    const ep_point *p = &c->point[i];
    text_setting(out, p);
    if (p->failed)
      fprintf(out, "failed: %s\n", p->why);
    else
      fprintf(out, "%9.1f %9.1f %10.2f %9.2e %9.2e %9.2e %9.2e\n", p->step_median_us,
              p->step_min_us, p->offline_s, p->position_error, p->velocity_error, p->energy_error,
              p->force_error);
  }
  for (int i = 0; i < c->scene->sweep.nelements; i++) {
    const int s = c->scene->sweep.elements[i];
    ep_crossover list[EP_CROSSOVERS];
    char text[EP_CROSSOVER_TEXT];
    const int count = ep_compare_crossovers(c, s, list);
    for (int j = 0; j < count; j++) {
      ep_compare_crossover_text(c, s, &list[j], text);
      fprintf(out, "%s\n", text);
    }
  }
  const int best = ep_compare_recommend(c, why);
  if (best >= 0) {
    fprintf(out, "recommended: ");
    text_setting(out, &c->point[best]);
    fprintf(out, "(%s)\n", why);
  } else if (*why) {
    fprintf(out, "recommended: none; %s\n", why);
  }
}
