#include <math.h>
#include <string.h>

#include "reduced/contact.h"
#include "reduced/eigenpose.h"
#include "reduced/state.h"
#include "reduced/tensorfile.h"
#include "reduced/text.h"

enum { SCHEMA = 3, MAX_MODES = 4096, MAX_EXAMPLES = 1024 };

// ---- metadata ----------------------------------------------------------------------------------

static ep_status read_text(const ep_tensorfile *file, const char *key, char text[64],
                           char *message) {
  if (ep_tensorfile_metadata(file, key, text, 64) == EP_OK) return EP_OK;
  ep_text_set(message, "no model: its metadata lacks \"");
  ep_text_add(message, key);
  ep_text_add(message, "\"");
  return EP_ERR_FORMAT;
}

static ep_status read_size(const ep_tensorfile *file, const char *key, int *value, char *message) {
  char text[64];
  ep_status status = read_text(file, key, text, message);
  if (status != EP_OK) return status;
  long sum = 0;
  const char *c = text;
  for (; *c >= '0' && *c <= '9' && sum < 200000000; c++) sum = 10 * sum + (*c - '0');
  *value = (int)sum;
  if (c > text && !*c) return EP_OK;
  ep_text_set(message, "metadata \"");
  ep_text_add(message, key);
  ep_text_add(message, "\" is no whole number below 2e9: ");
  ep_text_add(message, text);
  return EP_ERR_FORMAT;
}

static ep_status read_kind(const ep_tensorfile *file, char *message) {
  char text[64];
  int schema = 0;
  ep_status status = read_text(file, "format", text, message);
  if (status != EP_OK) return status;
  if (strcmp(text, "eigenpose-model") != 0)
    return ep_text_refuse(message, "a tensor file, but not an Eigenpose model");
  if ((status = read_size(file, "schema", &schema, message)) != EP_OK) return status;
  if (schema != SCHEMA) {
    ep_text_set(message, "model schema ");
    ep_text_add_number(message, schema);
    ep_text_add(message, "; this version reads schema 3: bake the scene again, or update");
    return EP_ERR_FORMAT;
  }
  if ((status = read_text(file, "real", text, message)) != EP_OK) return status;
  if (strcmp(text, "f64") != 0)
    return ep_text_refuse(message, "the model's real type is not f64, the only one this reads");
  return EP_OK;
}

static ep_status read_material(const ep_tensorfile *file, ep_material *material, char *message) {
  char text[64];
  ep_status status = read_text(file, "material", text, message);
  if (status != EP_OK) return status;
  for (int i = 0; i < EP_MATERIALS; i++) {
    *material = (ep_material)i;
    if (strcmp(text, ep_material_name(*material)) == 0) return EP_OK;
  }
  ep_text_set(message, "unknown material \"");
  ep_text_add(message, text);
  ep_text_add(message, "\"");
  return EP_ERR_FORMAT;
}

static ep_status read_sizes(const ep_tensorfile *file, ep_model_sizes *z, char *message) {
#define ONE(name)                                                                                  \
  {                                                                                                \
    ep_status status = read_size(file, #name, &z->name, message);                                  \
    if (status != EP_OK) return status;                                                            \
  }
  EP_MODEL_SIZES(ONE)
#undef ONE
  if (z->r < 1 || z->r > MAX_MODES || z->n < 1 || z->nt < 1)
    return ep_text_refuse(message, "impossible sizes: r, n and nt must be at least 1");
  if ((z->cubic || z->cubic_float) && z->r > EP_CUBIC_MAX_MODES)
    return ep_text_refuse(message, "impossible sizes: too many modes for the cubic path");
  if ((z->cubic && (size_t)z->cubic != ep_cubic_stream_size(z->r, EP_DOUBLE)) ||
      (z->cubic_float && (size_t)z->cubic_float != ep_cubic_stream_size(z->r, EP_FLOAT)))
    return ep_text_refuse(message, "the cubic coefficients are not those of r modes");
  if (z->cubature_float && z->cubature_float != z->s)
    return ep_text_refuse(message, "impossible sizes: cubature_float is neither 0 nor s");
  if (z->s < 1 && (z->m > 0 || !(z->cubic || z->cubic_float)))
    return ep_text_refuse(message, "impossible sizes: without cubature elements (s = 0) there must "
                                   "be cubic coefficients and no descriptors");
  if (z->blocks != (z->r + 7) / 8) return ep_text_refuse(message, "blocks is not ceil(r / 8)");
  if (z->k > MAX_EXAMPLES || z->m > z->n || (z->k > 0 && z->m < 1 && z->greens < 1))
    return ep_text_refuse(message, "impossible sizes: k examples need descriptors, 1 <= m <= n, or "
                                   "the coefficients of their strains");
  if (z->rigid > 1) return ep_text_refuse(message, "rigid is neither 0 nor 1");
  if ((z->contacts > 0) != (z->nodes > 0) || z->contacts > z->n ||
      z->nodes - z->contacts > z->contacts)
    return ep_text_refuse(message, "impossible sizes: contacts and nodes of their tree");
  if (z->regions > z->k || (z->regions > 0 && z->m < z->regions))
    return ep_text_refuse(message, "regions must have examples and functions of their own");
  if (z->greens > z->k) return ep_text_refuse(message, "greens is more than the examples, k");
  return EP_OK;
}

// ---- arrays ------------------------------------------------------------------------------------

static ep_status refuse_array(char *message, const char *name, const char *why) {
  ep_text_set(message, "model array \"");
  ep_text_add(message, name);
  ep_text_add(message, "\": ");
  ep_text_add(message, why);
  return EP_ERR_FORMAT;
}

// Find an array of exactly this type and shape; NULL where it must be absent.
static ep_status find_array(const ep_tensorfile *file, const char *name, ep_dtype dtype, int d1,
                            int d2, int d3, const void **data, char *message) {
  ep_tensor t;
  *data = NULL;
  ep_status found = ep_tensorfile_find(file, name, &t);
  if ((int64_t)d1 * d2 == 0 || d3 == 0)
    return found == EP_OK ? refuse_array(message, name, "present although its size is 0") : EP_OK;
  if (found != EP_OK) return refuse_array(message, name, "missing");
  if (t.dtype != dtype) return refuse_array(message, name, "wrong number type");
  if (t.dims != 3 || t.shape[0] != d1 || t.shape[1] != d2 || t.shape[2] != d3)
    return refuse_array(message, name, "its shape does not fit the model's sizes");
  if ((uintptr_t)t.data % 64) return refuse_array(message, name, "not aligned to 64 bytes");
  *data = t.data;
  return EP_OK;
}

static ep_status check_finite(const char *name, const double *x, size_t count, char *message) {
  for (size_t i = 0; i < count; i++)
    if (!isfinite(x[i])) {
      refuse_array(message, name, "not finite at element ");
      ep_text_add_number(message, (long long)i);
      return EP_ERR_FORMAT;
    }
  return EP_OK;
}

static ep_status check_finite_floats(const char *name, const float *x, size_t count,
                                     char *message) {
  for (size_t i = 0; i < count; i++)
    if (!isfinite(x[i])) {
      refuse_array(message, name, "not finite at element ");
      ep_text_add_number(message, (long long)i);
      return EP_ERR_FORMAT;
    }
  return EP_OK;
}

static ep_status check_at_least_zero(const char *name, const double *x, int64_t count,
                                     char *message) {
  for (int64_t i = 0; i < count; i++)
    if (!(x[i] >= 0)) return refuse_array(message, name, "holds a negative number");
  return EP_OK;
}

// A guard's wall begins at this share of its volume.
static ep_status check_shares(const char *name, const double *x, int64_t count, char *message) {
  for (int64_t i = 0; i < count; i++)
    if (!(x[i] > 0) || x[i] > 1)
      return refuse_array(message, name, "holds a number that is not above 0 and at most 1");
  return EP_OK;
}

static ep_status check_index(const char *name, const int32_t *x, int64_t count, int below,
                             char *message) {
  for (int64_t i = 0; i < count; i++)
    if (x[i] < 0 || x[i] >= below)
      return refuse_array(message, name, "holds an index out of range");
  return EP_OK;
}

#define FIRST_FAILURE(call)                                                                        \
  do {                                                                                             \
    ep_status status_ = (call);                                                                    \
    if (status_ != EP_OK) return status_;                                                          \
  } while (0)

// Every region has functions and examples.
static ep_status check_regions(const ep_model *model, char *message) {
  const int regions = model->size.regions, k = model->size.k;
  if (!regions) return EP_OK;
  const int64_t parts = (int64_t)regions * model->size.s;
  const int32_t *first = model->region_first;
  FIRST_FAILURE(check_index("example_region", model->example_region, k, regions, message));
  FIRST_FAILURE(check_at_least_zero("region_inside", model->region_inside, parts, message));
  FIRST_FAILURE(check_at_least_zero("region_outside", model->region_outside, parts, message));
  for (int g = 0; g < regions; g++) {
    int examples = 0;
    for (int i = 0; i < k; i++) examples += model->example_region[i] == g;
    if (!examples)
      return refuse_array(message, "example_region", "leaves a region without examples");
    if (first[g] >= first[g + 1] || first[0] != 0 || first[g + 1] > model->size.m)
      return refuse_array(message, "region_first", "does not divide the functions");
  }
  return first[regions] == model->size.m
             ? EP_OK
             : refuse_array(message, "region_first", "does not divide the functions");
}

static ep_status read_arrays(const ep_tensorfile *file, ep_model *model, char *message) {
  const int n = model->size.n, nt = model->size.nt, r = model->size.r, m = model->size.m;
  const int k = model->size.k, s = model->size.s, blocks = model->size.blocks;
  const int greens = model->size.greens, cubic = model->size.cubic;
  const int cubature_float = model->size.cubature_float;
  const int cubic_float = model->size.cubic_float, rigid = model->size.rigid;
  const int guards = model->size.guards;
  const int contacts = model->size.contacts, nodes = model->size.nodes;
  const int regions = model->size.regions;
  const void *data;
#define DTYPE_double EP_F64
#define DTYPE_int32  EP_I32
#define DTYPE_float  EP_F32
#define ONE(type, name, d1, d2, d3)                                                                \
  FIRST_FAILURE(find_array(file, #name, DTYPE_##type, d1, d2, d3, &data, message));                \
  model->name = data;                                                                              \
  if (DTYPE_##type == EP_F64)                                                                      \
    FIRST_FAILURE(check_finite(#name, data, (size_t)(d1) * (size_t)(d2) * (size_t)(d3), message)); \
  if (DTYPE_##type == EP_F32)                                                                      \
    FIRST_FAILURE(                                                                                 \
        check_finite_floats(#name, data, (size_t)(d1) * (size_t)(d2) * (size_t)(d3), message));
  EP_MODEL_ARRAYS(ONE)
#undef ONE
  FIRST_FAILURE(check_index("tets", model->tets, 4 * (int64_t)nt, n, message));
  FIRST_FAILURE(check_at_least_zero("cubic_scales", model->cubic_scales,
                                    cubic > 0 || cubic_float > 0 ? 3 : 0, message));
  FIRST_FAILURE(check_index("cubature_tet", model->cubature_tet, s, nt, message));
  FIRST_FAILURE(check_at_least_zero("cubature_w", model->cubature_w, s, message));
  FIRST_FAILURE(check_at_least_zero("cubature_lambda", model->cubature_lambda, s, message));
  FIRST_FAILURE(check_at_least_zero("cubature_mu", model->cubature_mu, s, message));
  FIRST_FAILURE(check_index("guard_tet", model->guard_tet, guards, nt, message));
  FIRST_FAILURE(check_at_least_zero("guard_w", model->guard_w, guards, message));
  FIRST_FAILURE(check_at_least_zero("guard_stiffness", model->guard_stiffness, guards, message));
  FIRST_FAILURE(check_shares("guard_limit", model->guard_limit, guards, message));
  FIRST_FAILURE(check_at_least_zero("guard_growth", model->guard_growth,
                                    (guards + 7) / 8 * 8 * blocks, message));
  FIRST_FAILURE(check_index("contact_vertex", model->contact_vertex, contacts, n, message));
  FIRST_FAILURE(check_at_least_zero("contact_area", model->contact_area, contacts, message));
  FIRST_FAILURE(check_at_least_zero("tree_radius", model->tree_radius, nodes, message));
  FIRST_FAILURE(check_at_least_zero("contact_scale", model->contact_scale, contacts > 0, message));
  if (!ep_contact_tree_sound(model))
    return refuse_array(message, "tree_range", "is not the tree of the contact vertices");
  FIRST_FAILURE(check_at_least_zero("green_scale", model->green_scale, greens ? 1 : 0, message));
  if (rigid && !(model->rigid_mass[0] > 0))
    return refuse_array(message, "rigid_mass", "not positive");
  FIRST_FAILURE(check_regions(model, message));
  return check_at_least_zero("example_w", model->example_w, m ? (int64_t)k * s : 0, message);
}

static ep_status read_scale(const ep_tensorfile *file, double *scale, char *message) {
  ep_tensor t;
  if (ep_tensorfile_find(file, "rest_scale", &t) != EP_OK || t.dtype != EP_F64 || t.dims != 1 ||
      t.shape[0] != 1)
    return refuse_array(message, "rest_scale", "missing, or not one F64 number");
  memcpy(scale, t.data, sizeof *scale);
  if (!(*scale > 0) || !isfinite(*scale))
    return refuse_array(message, "rest_scale", "not positive");
  return EP_OK;
}

ep_evaluator ep_model_best_evaluator(const ep_model *model) {
  if (model->size.cubic) return EP_EVALUATE_CUBIC;
  if (model->size.cubic_float) return EP_EVALUATE_CUBIC_FLOAT;
  return model->size.cubature_float ? EP_EVALUATE_CUBATURE_FLOAT : EP_EVALUATE_CUBATURE;
}

ep_status ep_model_check_evaluator(const ep_model *model, char *message) {
  const int stvk = model->material == EP_STVK || model->material == EP_STVK_VOLUME;
  if (ep_is_cubature(model->evaluator) && model->size.s < 1)
    return ep_text_refuse(message, "the model has no cubature elements");
  if (model->evaluator == EP_EVALUATE_CUBATURE_FLOAT && !model->size.cubature_float)
    return ep_text_refuse(message, "the model has no cubature in floats");
  if (model->evaluator == EP_EVALUATE_CUBIC && !model->size.cubic)
    return ep_text_refuse(message, "the model has no cubic coefficients in doubles");
  if (model->evaluator == EP_EVALUATE_CUBIC_FLOAT && !model->size.cubic_float)
    return ep_text_refuse(message, "the model has no cubic coefficients in floats");
  if (!ep_is_cubature(model->evaluator) && !stvk)
    return ep_text_refuse(message, "cubic coefficients with a material other than stvk");
  if (!ep_is_cubature(model->evaluator) && model->material == EP_STVK_VOLUME && model->size.s < 1)
    return ep_text_refuse(message, "the volume penalty needs cubature elements");
  return EP_OK;
}

static ep_status open_model(const void *bytes, size_t size, ep_model *model, char *message) {
  ep_tensorfile file;
  if ((uintptr_t)bytes % 64) {
    ep_text_set(message, "the model's memory is not aligned to 64 bytes");
    return EP_ERR_ARGUMENT;
  }
  FIRST_FAILURE(ep_tensorfile_open(bytes, size, &file, message));
  FIRST_FAILURE(read_kind(&file, message));
  FIRST_FAILURE(read_material(&file, &model->material, message));
  FIRST_FAILURE(read_sizes(&file, &model->size, message));
  FIRST_FAILURE(read_scale(&file, &model->rest_scale, message));
  FIRST_FAILURE(read_arrays(&file, model, message));
  model->evaluator = ep_model_best_evaluator(model);
  return ep_model_check_evaluator(model, message);
}

ep_status ep_model_open(const void *bytes, size_t size, ep_model *model, char *message) {
  memset(model, 0, sizeof *model);
  ep_text_set(message, "");
  ep_status status = open_model(bytes, size, model, message);
  if (status != EP_OK) memset(model, 0, sizeof *model);
  return status;
}

void ep_positions(const ep_model *model, const double *q, double *x) {
  size_t width = 3 * (size_t)model->size.n;
  memcpy(x, model->rest_x, width * sizeof *x);
  for (int a = 0; a < model->size.r; a++) {
    const double *u = model->u + (size_t)a * width;
    for (size_t i = 0; i < width; i++) x[i] += q[a] * u[i];
  }
}
