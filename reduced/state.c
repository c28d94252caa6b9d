#include "reduced/state.h"

#include <math.h>
#include <string.h>

#include "reduced/cubic_kernel.h"

enum { ALIGNMENT = 64 };

static size_t rounded(size_t bytes) {
  return (bytes + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT;
}

static ep_precision precision_of(const ep_model *model) {
  return model->evaluator == EP_EVALUATE_CUBIC_FLOAT ? EP_FLOAT : EP_DOUBLE;
}

// Set the pointers into memory (NULL: only count). Returns the bytes used.
static size_t lay_out(const ep_model *model, char *memory, ep_state *state) {
  const size_t r = (size_t)model->size.r, m = (size_t)model->size.m, k = (size_t)model->size.k;
  const size_t s = (size_t)model->size.s, width = 8 * (size_t)model->size.blocks;
  const int floats = model->evaluator == EP_EVALUATE_CUBATURE_FLOAT;
  const size_t greens = (size_t)model->size.greens, contacts = (size_t)model->size.contacts;
  const size_t guard_groups = ((size_t)model->size.guards + EP_LANES - 1) / EP_LANES;
  const size_t regions = (size_t)model->size.regions, sets = (size_t)ep_model_regions(model);
  const size_t free = model->size.rigid ? r : 0, n = model->size.rigid ? r + 6 : r;
  const size_t examples = k > 0 && m > 0; // without descriptors their scratch is left out
  const size_t cubic_words =
      ep_is_cubature(model->evaluator)
          ? 0
          : ep_cubic_scratch(model->size.r, precision_of(model)) / sizeof(double);
  size_t scratch = (size_t)ep_kernel_scratch(model->size.blocks, floats);
  if (model->size.guards > 0) { // always in doubles
    const size_t wide = (size_t)ep_kernel_scratch(model->size.blocks, 0);
    scratch = scratch > wide ? scratch : wide;
  }
  size_t used = rounded(sizeof *state);
  if (memory) state->term = (ep_kernel_term *)(memory + used);
  used += rounded((k + 2 * sets) * sizeof *state->term);
#define X(name, count)                                                                             \
  if (memory) state->name = (double *)(memory + used);                                             \
  used += rounded((size_t)(count) * sizeof(double));
  EP_STATE_ARRAYS(X)
#undef X
  return used;
}

size_t ep_state_bytes(const ep_model *model) {
  return lay_out(model, NULL, NULL);
}

static void measure_scales(ep_state *state) {
  const ep_model *m = state->model;
  const size_t each = (size_t)m->size.blocks * 72;
  for (int e = 0; e < m->size.s; e++) {
    const double *g = m->cubature_g + (size_t)e * each;
    double square = 0;
    for (size_t i = 0; i < each; i++) square += g[i] * g[i];
    double norm = sqrt(square);
    state->strain_scale = fmax(state->strain_scale, norm);
    double stiffness = m->cubature_w[e] * (m->cubature_lambda[e] + 2 * m->cubature_mu[e]);
    state->energy_scale += stiffness;
    state->force_scale += stiffness * norm;
  }
  if (!m->cubic_scales) return; // of all elements, where they are known
  state->strain_scale = m->cubic_scales[0];
  state->energy_scale = m->cubic_scales[1];
  state->force_scale = m->cubic_scales[2];
}

// After the polynomials are open.
static void use_isa(ep_state *state, ep_isa isa) {
  state->isa = ep_isa_name(isa);
  state->kernel = ep_kernel_of(isa);
  state->green_kernel = ep_green_of(isa);
  state->guard_kernel = ep_guard_of(isa);
  if (!state->cubic.stream) return;
  state->cubic.isa = state->isa;
  state->cubic.kernel = ep_cubic_kernel_of(isa, state->cubic.precision);
}

static int isa_named(const char *name) {
  int isa = 0;
  while (isa < EP_ISAS && strcmp(name, ep_isa_name((ep_isa)isa)) != 0) isa++;
  return isa;
}

ep_status ep_isa_check(const char *name) {
  const int isa = isa_named(name);
  if (isa == EP_ISAS) return EP_ERR_ARGUMENT;
  return isa <= (int)ep_isa_here() ? EP_OK : EP_ERR_UNSUPPORTED;
}

ep_status ep_state_use_isa(ep_state *state, const char *name) {
  const ep_status status = ep_isa_check(name);
  if (status == EP_OK) use_isa(state, (ep_isa)isa_named(name));
  return status;
}

ep_status ep_state_init(const ep_model *model, void *memory, size_t bytes, ep_state **out) {
  *out = NULL;
  if (ep_model_check_evaluator(model, NULL) != EP_OK) return EP_ERR_ARGUMENT;
  if (!memory || (uintptr_t)memory % ALIGNMENT || bytes < ep_state_bytes(model))
    return EP_ERR_ARGUMENT;
  memset(memory, 0, ep_state_bytes(model));
  ep_state *state = memory;
  lay_out(model, memory, state);
  state->model = model;
  for (int g = 0; g < ep_model_regions(model); g++) state->w[g] = 1;
  ep_state_rest_frame(state);
  state->energy_noise = 1e-13;
  const int narrow = model->evaluator == EP_EVALUATE_CUBIC_FLOAT;
  if (narrow) state->energy_noise = 2e-6, state->force_noise = 1e-5;
  const void *stream = narrow ? (const void *)model->cubic_stream_float : model->cubic_stream;
  if (!ep_is_cubature(model->evaluator) &&
      ep_cubic_open(model->size.r, precision_of(model), stream, &state->cubic) != EP_OK)
    return EP_ERR_ARGUMENT;
  use_isa(state, ep_isa_here());
  measure_scales(state);
  ep_guard_init(state);
  if (!ep_cholesky(model->size.r, model->k0, state->k0_factor)) return EP_ERR_NUMERIC;
  *out = state;
  return EP_OK;
}

const ep_model *ep_state_model(const ep_state *state) {
  return state->model;
}
const double *ep_state_k0_factor(const ep_state *state) {
  return state->k0_factor;
}
void ep_state_solve_k0(const ep_state *state, double *x) {
  ep_solve_lower(state->model->size.r, state->k0_factor, x);
  ep_solve_lower_transposed(state->model->size.r, state->k0_factor, x);
}
const char *ep_state_isa(const ep_state *state) {
  return state->isa;
}
double *ep_state_q(ep_state *state) {
  return state->q;
}
double *ep_state_velocity(ep_state *state) {
  return state->v;
}
const double *ep_state_weights(const ep_state *state) {
  return state->w + ep_model_regions(state->model);
}
const double *ep_state_target(const ep_state *state) {
  return state->target;
}
