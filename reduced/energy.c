#include <math.h>
#include <string.h>

#include "reduced/reference.h"
#include "reduced/state.h"

double ep_evaluate(ep_state *state, int terms, const double *q, double *f, double *k, int project) {
  return ep_evaluate_law(state, state->model->material, terms, q, f, k, project);
}

// Into padded_f and padded_k.
static void run_kernel(ep_state *state, ep_material material, int terms, const double *q,
                       int want_f, int want_k, int project) {
  const ep_model *m = state->model;
  const int r = m->size.r;
  memcpy(state->padded_q, q, (size_t)r * sizeof *q); // its tail stays zero
  const int in_floats = m->evaluator == EP_EVALUATE_CUBATURE_FLOAT;
  ep_kernel_task task = {.r = r,
                         .s = m->size.s,
                         .blocks = m->size.blocks,
                         .material = material,
                         .g = m->cubature_g,
                         .lambda = m->cubature_lambda,
                         .mu = m->cubature_mu,
                         .terms = terms,
                         .term = state->term,
                         .q = state->padded_q,
                         .f = want_f ? state->padded_f : NULL,
                         .k = want_k ? state->padded_k : NULL,
                         .project = project,
                         .scratch = state->kernel_scratch,
                         .g_float = in_floats ? m->cubature_g_float : NULL};
  state->kernel(&task);
}

double ep_evaluate_law(ep_state *state, ep_material material, int terms, const double *q, double *f,
                       double *k, int project) {
  const ep_model *m = state->model;
  const int r = m->size.r;
  run_kernel(state, material, terms, q, f != NULL, k != NULL, project);
  if (f) memcpy(f, state->padded_f, (size_t)r * sizeof *f);
  for (int i = 0; k && i < r; i++)
    memcpy(k + (size_t)i * (size_t)r, state->padded_k + (size_t)i * 8 * (size_t)m->size.blocks,
           (size_t)r * sizeof *k);
  double energy = 0;
  for (int i = 0; i < terms; i++) energy += state->term[i].energy;
  return energy;
}

// At the last point the Hessian is there already (the gradient was wanted before).
static double evaluate_cubic(ep_state *state, const double *q) {
  const size_t bytes = (size_t)state->model->size.r * sizeof *q;
  if (state->cubic_known && memcmp(q, state->cubic_at, bytes) == 0) return state->cubic_energy;
  memcpy(state->cubic_at, q, bytes);
  state->cubic_energy =
      ep_cubic_evaluate(&state->cubic, q, state->cubic_f, state->cubic_k, state->cubic_scratch);
  state->cubic_known = 1;
  return state->cubic_energy;
}

static double add_penalty(ep_state *state, double scale, const double *q, double *f, double *h,
                          int project) {
  const ep_model *m = state->model;
  const int r = m->size.r, width = 8 * m->size.blocks;
  state->term[0] = (ep_kernel_term){.scale = scale, .weight = m->cubature_w};
  run_kernel(state, EP_VOLUME_PENALTY, 1, q, f != NULL, h != NULL, project);
  if (state->term[0].energy == 0) return 0;
  for (int a = 0; f && a < r; a++) f[a] += state->padded_f[a];
  for (int a = 0; h && a < r; a++)
    for (int b = 0; b < r; b++) h[a * r + b] += state->padded_k[a * width + b];
  return state->term[0].energy;
}

double ep_cubic_add(ep_state *state, double scale, const double *q, double *f, double *h,
                    int project) {
  const int r = state->model->size.r;
  const double energy = scale * evaluate_cubic(state, q);
  for (int a = 0; f && a < r; a++) f[a] += scale * state->cubic_f[a];
  for (int i = 0; h && i < r * r; i++) h[i] += scale * state->cubic_k[i];
  if (state->model->material != EP_STVK_VOLUME) return energy;
  return energy + add_penalty(state, scale, q, f, h, project);
}

double ep_elastic_energy(ep_state *state, const double *q, double *f, double *k, int project) {
  const size_t r = (size_t)state->model->size.r;
  double energy;
  if (ep_is_cubature(state->model->evaluator)) {
    state->term[0] = (ep_kernel_term){.scale = 1, .weight = state->model->cubature_w};
    energy = ep_evaluate(state, 1, q, f, k, project);
  } else {
    if (f) memset(f, 0, r * sizeof *f);
    if (k) memset(k, 0, r * r * sizeof *k);
    energy = ep_cubic_add(state, 1, q, f, k, project);
  }
  return energy + ep_guard_add(state, q, f, k, project);
}

// Terms of the examples with weight; w (k). Returns the number of terms after these.
static int add_examples(ep_state *state, const double *w, int terms) {
  const ep_model *m = state->model;
  const size_t s = (size_t)m->size.s;
  for (int i = 0; i < m->size.k; i++) {
    if (w[i] == 0) continue;
    state->term[terms++] = (ep_kernel_term){.scale = w[i],
                                            .inverse = m->example_finv + (size_t)i * s * 9,
                                            .weight = m->example_w + (size_t)i * s};
  }
  return terms;
}

double ep_example_energy(ep_state *state, const double *w, const double *q, double *f, double *h,
                         int project) {
  return ep_evaluate(state, add_examples(state, w, 0), q, f, h, project);
}

// How much the energy outside counts in the target of a region: enough to make the target unique
// (nothing else tells how it goes on there), too little to pull at the region.
static const double outside_share = 0.01;

// Rest shapes of the regions with weight, and what lies outside of them. Returns the terms.
static int add_rest_of_regions(ep_state *state, const double *w) {
  const ep_model *m = state->model;
  const int regions = m->size.regions;
  int terms = 0;
  for (int g = 0; g < regions; g++) {
    int used = w[g] != 0;
    for (int i = 0; i < m->size.k && !used; i++)
      used = m->example_region[i] == g && w[regions + i] != 0;
    if (!used) continue;
    const size_t at = (size_t)g * (size_t)m->size.s;
    if (w[g] != 0)
      state->term[terms++] = (ep_kernel_term){.scale = w[g], .weight = m->region_inside + at};
    state->term[terms++] =
        (ep_kernel_term){.scale = outside_share, .weight = m->region_outside + at};
  }
  return terms;
}

double ep_target_energy(ep_state *state, const double *w, const double *q, double *f, double *h,
                        int project) {
  const ep_model *m = state->model;
  int terms = 0;
  if (m->size.regions)
    terms = add_rest_of_regions(state, w);
  else if (w[0] != 0)
    state->term[terms++] = (ep_kernel_term){.scale = w[0], .weight = m->cubature_w};
  return ep_evaluate(state, add_examples(state, w + ep_model_regions(m), terms), q, f, h, project);
}

int ep_force_terms(ep_state *state, const ep_step_def *def, int terms) {
  const size_t s = (size_t)state->model->size.s;
  for (int g = 0; g < ep_model_regions(state->model); g++) {
    const double factor = def->region_strength ? def->region_strength[g] : 1;
    if (factor == 0) continue;
    state->term[terms++] = (ep_kernel_term){.scale = def->strength * factor,
                                            .inverse = state->target_inverse + (size_t)g * s * 9,
                                            .weight = state->target_weight + (size_t)g * s};
  }
  return terms;
}

// F of one element, in the layout's own lanes (padded_q holds q and zeros).
static void element_gradient(const ep_state *state, int e, double f[9]) {
  const int blocks = state->model->size.blocks;
  const double *g = state->model->cubature_g + (size_t)e * (size_t)blocks * 72;
  for (int c = 0; c < 9; c++) {
    double sum[EP_LANES] = {0};
    for (int b = 0; b < blocks; b++)
      for (int i = 0; i < EP_LANES; i++)
        sum[i] += g[(9 * b + c) * EP_LANES + i] * state->padded_q[EP_LANES * b + i];
    f[c] = (c % 4 == 0) +
           (((sum[0] + sum[1]) + (sum[2] + sum[3])) + ((sum[4] + sum[5]) + (sum[6] + sum[7])));
  }
}

static void freeze(ep_state *state, int set, const double *weight) {
  const ep_model *m = state->model;
  const size_t s = (size_t)m->size.s, r = (size_t)m->size.r;
  double *inverse = state->target_inverse + (size_t)set * s * 9;
  memcpy(state->padded_q, state->next_target + (size_t)set * r, r * sizeof(double));
  for (int e = 0; e < m->size.s; e++) {
    double f[9];
    if (weight[e] == 0) { // outside of the region: target_weight stays zero
      for (int c = 0; c < 9; c++) inverse[9 * e + c] = c % 4 == 0;
      continue;
    }
    element_gradient(state, e, f);
    state->target_weight[(size_t)set * s + (size_t)e] =
        weight[e] * ep_reference_element(f, inverse + 9 * e);
  }
}

void ep_freeze_target(ep_state *state) {
  const ep_model *m = state->model;
  for (int g = 0; g < m->size.regions; g++)
    freeze(state, g, m->region_inside + (size_t)g * (size_t)m->size.s);
  if (!m->size.regions) freeze(state, 0, m->cubature_w);
}
