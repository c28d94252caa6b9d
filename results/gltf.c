#include "results/gltf.h"

#include <jansson.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "base/files.h"

// glTF 2.0 constants
enum { FLOAT = 5126, UNSIGNED_INT = 5125, ARRAY_BUFFER = 34962, ELEMENT_ARRAY_BUFFER = 34963 };
enum { CHUNK_JSON = 0x4E4F534A, CHUNK_BIN = 0x004E4942, MAGIC = 0x46546C67 };

typedef struct writer {
  const ep_gltf_animation *a;
  bool flat;                                     // no normals: viewers then shade flat
  int nv;                                        // vertices on the surface
  int *vertex;                                   // (nv) surface vertex -> vertex
  uint32_t *index;                               // (triangles x 3) in surface vertices
  double *low, *range;                           // (r) of each mode's coordinate
  float *base, *base_normal, *position, *normal; // (nv x 3); the last two are scratch
  unsigned char *bin;                            // the binary chunk
  size_t used, capacity;
  json_t *views, *accessors;
  bool lost; // a piece of the text for lack of memory: nothing is written then
  ep_error *err;
} writer;

// Both take the value over; what is lost shows before anything is written.
static void put(writer *w, json_t *object, const char *key, json_t *value) {
  if (json_object_set_new(object, key, value) != 0) w->lost = true;
}
static void push(writer *w, json_t *array, json_t *value) {
  if (json_array_append_new(array, value) != 0) w->lost = true;
}
static ep_status no_text(const writer *w) {
  return ep_fail(w->err, EP_ERR_MEMORY, "no memory for glTF text");
}

ep_gltf_animation ep_default_gltf(void) {
  return (ep_gltf_animation){
      .name = "eigenpose", .base_color = {0.55f, 0.62f, 0.75f}, .target_normals = true};
}

static ep_status check(const ep_gltf_animation *a, ep_error *err) {
  if (a->n < 1 || a->triangles < 1 || a->r < 0 || a->frames < 0)
    return ep_fail(err, EP_ERR_ARGUMENT, "glTF: nothing to write (%d vertices, %d triangles)", a->n,
                   a->triangles);
  for (int i = 0; i < 3 * a->triangles; i++)
    if (a->triangle[i] < 0 || a->triangle[i] >= a->n)
      return ep_fail(err, EP_ERR_ARGUMENT, "glTF: triangle %d uses vertex %d of %d", i / 3,
                     a->triangle[i], a->n);
  for (int f = 0; f < a->frames; f++)
    if (!(a->time[f] >= 0) || isinf(a->time[f]) ||
        (f > 0 && !((float)a->time[f] > (float)a->time[f - 1])))
      return ep_fail(err, EP_ERR_ARGUMENT, "glTF: times must ascend from 0; frame %d is at %g s", f,
                     a->time[f]);
  const size_t count = (size_t)a->frames * (size_t)a->r;
  for (size_t i = 0; i < count; i++)
    if (!isfinite(a->q[i]))
      return ep_fail(err, EP_ERR_ARGUMENT, "glTF: q%zu of frame %zu is not a number",
                     i % (size_t)a->r, i / (size_t)a->r);
  return EP_OK;
}

// Surface vertices keep their order; index and vertex are filled.
static ep_status make_index(writer *w) {
  const ep_gltf_animation *a = w->a;
  int *number = calloc((size_t)a->n, sizeof *number);
  w->vertex = malloc((size_t)a->n * sizeof *w->vertex);
  w->index = malloc((size_t)a->triangles * 3 * sizeof *w->index);
  if (!number || !w->vertex || !w->index) {
    free(number);
    return ep_fail(w->err, EP_ERR_MEMORY, "no memory for a glTF surface of %d triangles",
                   a->triangles);
  }
  for (int i = 0; i < 3 * a->triangles; i++) number[a->triangle[i]] = 1;
  for (int v = 0; v < a->n; v++)
    if (number[v]) {
      w->vertex[w->nv] = v;
      number[v] = w->nv++;
    }
  for (int i = 0; i < 3 * a->triangles; i++) w->index[i] = (uint32_t)number[a->triangle[i]];
  free(number);
  return EP_OK;
}

static ep_status make_ranges(writer *w) {
  const ep_gltf_animation *a = w->a;
  const size_t bytes = (size_t)w->nv * 3 * sizeof(float);
  w->low = calloc((size_t)a->r + 1, sizeof *w->low);
  w->range = calloc((size_t)a->r + 1, sizeof *w->range);
  w->base = malloc(bytes);
  w->base_normal = malloc(bytes);
  w->position = malloc(bytes);
  w->normal = malloc(bytes);
  if (!w->low || !w->range || !w->base || !w->base_normal || !w->position || !w->normal)
    return ep_fail(w->err, EP_ERR_MEMORY, "no memory for glTF modes (%d vertices)", w->nv);
  for (int i = 0; i < a->r && a->frames > 0; i++) {
    double low = a->q[i], high = a->q[i];
    for (int f = 1; f < a->frames; f++) {
      const double q = a->q[(size_t)f * (size_t)a->r + (size_t)i];
      low = fmin(low, q);
      high = fmax(high, q);
    }
    w->low[i] = low;
    w->range[i] = high - low;
  }
  return EP_OK;
}

// ---- geometry --------------------------------------------------------------------------------
static void make_base(writer *w) {
  const ep_gltf_animation *a = w->a;
  for (int v = 0; v < w->nv; v++)
    for (int k = 0; k < 3; k++) {
      const size_t at = 3 * (size_t)w->vertex[v] + (size_t)k;
      double x = a->x[at];
      for (int i = 0; i < a->r; i++) x += a->u[(size_t)i * 3 * (size_t)a->n + at] * w->low[i];
      w->base[3 * v + k] = (float)x;
    }
}

static void make_target(writer *w, int mode) {
  const double *u = w->a->u + (size_t)mode * 3 * (size_t)w->a->n;
  for (int v = 0; v < w->nv; v++)
    for (int k = 0; k < 3; k++)
      w->position[3 * v + k] = (float)(u[3 * (size_t)w->vertex[v] + (size_t)k] * w->range[mode]);
}

// Area-weighted unit vertex normals at base + target (target may be NULL).
static void make_normals(const writer *w, const float *target, float *normal) {
  memset(normal, 0, (size_t)w->nv * 3 * sizeof *normal);
  for (int t = 0; t < w->a->triangles; t++) {
    const uint32_t *corner = w->index + 3 * (size_t)t;
    double p[3][3], e[2][3];
    for (int c = 0; c < 3; c++)
      for (int k = 0; k < 3; k++) {
        const size_t at = 3 * (size_t)corner[c] + (size_t)k;
        p[c][k] = (double)w->base[at] + (target ? (double)target[at] : 0);
      }
    for (int k = 0; k < 3; k++) {
      e[0][k] = p[1][k] - p[0][k];
      e[1][k] = p[2][k] - p[0][k];
    }
    for (int k = 0; k < 3; k++) {
      const int i = (k + 1) % 3, j = (k + 2) % 3;
      const float cross = (float)(e[0][i] * e[1][j] - e[0][j] * e[1][i]);
      for (int c = 0; c < 3; c++) normal[3 * (size_t)corner[c] + (size_t)k] += cross;
    }
  }
  for (int v = 0; v < w->nv; v++) {
    float *n = normal + 3 * (size_t)v;
    const double length = sqrt((double)n[0] * (double)n[0] + (double)n[1] * (double)n[1] +
                               (double)n[2] * (double)n[2]);
    // glTF demands unit length; where faces cancel any direction will do
    for (int k = 0; k < 3; k++) n[k] = length > 0 ? (float)((double)n[k] / length) : (k == 2);
  }
}

// ---- buffer ----------------------------------------------------------------------------------
// Append bytes (all counts here are multiples of 4) and a view of them; returns the view's number.
static ep_status append(writer *w, const void *bytes, size_t size, int target, int *view) {
  if (size > SIZE_MAX / 4 || w->used + size > UINT32_MAX - (1u << 24))
    return ep_fail(w->err, EP_ERR_UNSUPPORTED,
                   "glTF: more than 4 GiB; write fewer modes or leave target normals out");
  if (w->used + size > w->capacity) {
    const size_t capacity = 2 * (w->used + size);
    unsigned char *larger = realloc(w->bin, capacity);
    if (!larger) return ep_fail(w->err, EP_ERR_MEMORY, "no memory for %zu bytes of glTF", capacity);
    w->bin = larger;
    w->capacity = capacity;
  }
  memcpy(w->bin + w->used, bytes, size);
  json_t *entry = json_pack("{s:i, s:I, s:I}", "buffer", 0, "byteOffset", (json_int_t)w->used,
                            "byteLength", (json_int_t)size);
  if (target) put(w, entry, "target", json_integer(target));
  w->used += size;
  *view = (int)json_array_size(w->views);
  push(w, w->views, entry);
  return EP_OK;
}

// Bounds of single-precision numbers, exact in JSON: glTF wants them to be the data's own.
static json_t *bounds(writer *w, const float *data, size_t count, int components, bool highest) {
  json_t *list = json_array();
  for (int k = 0; k < components; k++) {
    float best = data[k];
    for (size_t i = 1; i < count; i++) {
      const float value = data[i * (size_t)components + (size_t)k];
      if (highest ? value > best : value < best) best = value;
    }
    push(w, list, json_real((double)best));
  }
  return list;
}

static ep_status add_floats(writer *w, const float *data, size_t count, int components, int target,
                            bool bounded, int *accessor) {
  int view;
  for (size_t i = 0; i < count * (size_t)components; i++)
    if (!isfinite(data[i]))
      return ep_fail(w->err, EP_ERR_ARGUMENT,
                     "glTF: a position, mode or pose is not a number of single precision");
  EP_TRY(append(w, data, count * (size_t)components * sizeof *data, target, &view));
  json_t *entry = json_pack("{s:i, s:i, s:I, s:s}", "bufferView", view, "componentType", FLOAT,
                            "count", (json_int_t)count, "type",
                            components == 4   ? "VEC4"
                            : components == 3 ? "VEC3"
                                              : "SCALAR");
  if (bounded) {
    put(w, entry, "min", bounds(w, data, count, components, false));
    put(w, entry, "max", bounds(w, data, count, components, true));
  }
  *accessor = (int)json_array_size(w->accessors);
  push(w, w->accessors, entry);
  return EP_OK;
}

static ep_status add_indices(writer *w, int *accessor) {
  int view;
  const size_t count = 3 * (size_t)w->a->triangles;
  EP_TRY(append(w, w->index, count * sizeof *w->index, ELEMENT_ARRAY_BUFFER, &view));
  *accessor = (int)json_array_size(w->accessors);
  json_t *entry = json_pack("{s:i, s:i, s:I, s:s}", "bufferView", view, "componentType",
                            UNSIGNED_INT, "count", (json_int_t)count, "type", "SCALAR");
  push(w, w->accessors, entry);
  return EP_OK;
}

static ep_status add_colors(writer *w, json_t *attributes) {
  if (!w->a->color) return EP_OK;
  for (int v = 0; v < w->nv; v++)
    for (int k = 0; k < 3; k++)
      w->position[3 * v + k] =
          fminf(1, fmaxf(0, w->a->color[3 * (size_t)w->vertex[v] + (size_t)k]));
  int accessor;
  EP_TRY(add_floats(w, w->position, (size_t)w->nv, 3, ARRAY_BUFFER, false, &accessor));
  put(w, attributes, "COLOR_0", json_integer(accessor));
  return EP_OK;
}

static ep_status add_targets(writer *w, json_t *targets) {
  for (int mode = 0; mode < w->a->r; mode++) {
    int position, normal;
    make_target(w, mode);
    EP_TRY(add_floats(w, w->position, (size_t)w->nv, 3, ARRAY_BUFFER, true, &position));
    json_t *target = json_pack("{s:i}", "POSITION", position);
    push(w, targets, target);
    if (!w->a->target_normals) continue;
    make_normals(w, w->position, w->normal);
    for (int i = 0; i < 3 * w->nv; i++) w->normal[i] -= w->base_normal[i];
    EP_TRY(add_floats(w, w->normal, (size_t)w->nv, 3, ARRAY_BUFFER, false, &normal));
    put(w, target, "NORMAL", json_integer(normal));
  }
  return EP_OK;
}

static ep_status add_primitive(writer *w, json_t *primitive) {
  json_t *attributes = json_object(), *targets = json_array();
  put(w, primitive, "attributes", attributes);
  put(w, primitive, "material", json_integer(0));
  put(w, primitive, "targets", targets);
  int accessor;
  EP_TRY(add_indices(w, &accessor));
  put(w, primitive, "indices", json_integer(accessor));
  make_base(w);
  EP_TRY(add_floats(w, w->base, (size_t)w->nv, 3, ARRAY_BUFFER, true, &accessor));
  put(w, attributes, "POSITION", json_integer(accessor));
  if (!w->flat) {
    make_normals(w, NULL, w->base_normal);
    EP_TRY(add_floats(w, w->base_normal, (size_t)w->nv, 3, ARRAY_BUFFER, false, &accessor));
    put(w, attributes, "NORMAL", json_integer(accessor));
  }
  EP_TRY(add_colors(w, attributes));
  EP_TRY(add_targets(w, targets));
  if (w->a->r == 0) json_object_del(primitive, "targets"); // glTF has no empty lists
  return EP_OK;
}

static void free_arrays(writer *w) {
  free(w->vertex);
  free(w->index);
  free(w->low);
  free(w->range);
  free(w->base);
  free(w->base_normal);
  free(w->position);
  free(w->normal);
}

// ---- animation -------------------------------------------------------------------------------
static float weight(const writer *w, int frame, int mode) {
  if (!(w->range[mode] > 0)) return 0;
  const double q = w->a->q[(size_t)frame * (size_t)w->a->r + (size_t)mode];
  return (float)((q - w->low[mode]) / w->range[mode]);
}

// One thing of one node over time.
typedef struct channels {
  json_t *channel, *sampler;
  int input; // accessor of the times
} channels;

static ep_status add_channel(writer *w, channels *c, const float *values, size_t count,
                             int components, int node, const char *path) {
  int output = -1;
  EP_TRY(add_floats(w, values, count, components, 0, false, &output));
  push(w, c->channel,
       json_pack("{s:i, s:{s:i, s:s}}", "sampler", (int)json_array_size(c->sampler), "target",
                 "node", node, "path", path));
  push(
      w, c->sampler,
      json_pack("{s:i, s:i, s:s}", "input", c->input, "output", output, "interpolation", "LINEAR"));
  return EP_OK;
}

static ep_status add_weights(writer *w, channels *c, float *values) {
  const ep_gltf_animation *a = w->a;
  for (int f = 0; f < a->frames; f++)
    for (int i = 0; i < a->r; i++) values[(size_t)f * (size_t)a->r + (size_t)i] = weight(w, f, i);
  return add_channel(w, c, values, (size_t)a->frames * (size_t)a->r, 1, 0, "weights");
}

// Unit quaternion (x, y, z, w) of a rotation, on the side of the one before.
static void quaternion(const double R[9], const float *before, float q[4]) {
  const double trace[4] = {R[0] - R[4] - R[8], R[4] - R[0] - R[8], R[8] - R[0] - R[4],
                           R[0] + R[4] + R[8]};
  int most = 0;
  for (int i = 1; i < 4; i++)
    if (trace[i] > trace[most]) most = i;
  double v[4];
  v[most] = 1 + trace[most];
  const double skew[3] = {R[7] - R[5], R[2] - R[6], R[3] - R[1]};
  for (int i = 0; i < 3; i++) {
    if (most == 3)
      v[i] = skew[i];
    else if (i != most)
      v[i] = R[3 * i + most] + R[3 * most + i];
  }
  if (most < 3) v[3] = skew[most];
  const double length = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2] + v[3] * v[3]);
  double same = 0;
  for (int i = 0; before && i < 4; i++) same += v[i] * (double)before[i];
  for (int i = 0; i < 4; i++) q[i] = (float)((same < 0 ? -v[i] : v[i]) / length);
}

static ep_status add_pose(writer *w, channels *c, const double *pose, int node, float *values) {
  const int frames = w->a->frames;
  if (!pose) return EP_OK;
  for (int f = 0; f < frames; f++)
    for (int i = 0; i < 3; i++) values[3 * f + i] = (float)pose[12 * (size_t)f + (size_t)i];
  EP_TRY(add_channel(w, c, values, (size_t)frames, 3, node, "translation"));
  for (int f = 0; f < frames; f++)
    quaternion(pose + 12 * (size_t)f + 3, f ? values + 4 * (f - 1) : NULL, values + 4 * f);
  return add_channel(w, c, values, (size_t)frames, 4, node, "rotation");
}

static ep_status add_channels(writer *w, channels *c, float *values) {
  const ep_gltf_animation *a = w->a;
  for (int f = 0; f < a->frames; f++) values[f] = (float)a->time[f];
  EP_TRY(add_floats(w, values, (size_t)a->frames, 1, 0, true, &c->input));
  if (a->r > 0) EP_TRY(add_weights(w, c, values));
  EP_TRY(add_pose(w, c, a->pose, 0, values));
  for (int i = 0; i < a->solids; i++) EP_TRY(add_pose(w, c, a->solid[i].pose, i + 1, values));
  return EP_OK;
}

static ep_status add_animation(writer *w, json_t *root) {
  const ep_gltf_animation *a = w->a;
  if (a->frames == 0 || (a->r == 0 && !a->pose && a->solids == 0)) return EP_OK;
  const size_t most = (size_t)a->frames * (size_t)(a->r > 4 ? a->r : 4);
  float *values = malloc(most * sizeof *values);
  if (!values) return ep_fail(w->err, EP_ERR_MEMORY, "no memory for %d glTF frames", a->frames);
  channels c = {.channel = json_array(), .sampler = json_array()};
  const ep_status status = add_channels(w, &c, values);
  free(values);
  put(w, root, "animations",
      json_pack("[{s:s, s:o, s:o}]", "name", "trajectory", "channels", c.channel, "samplers",
                c.sampler));
  return status;
}

// A solid's mesh and node, with a writer of its own over the same buffer.
static ep_status add_solid(writer *w, json_t *root, const ep_gltf_solid *solid, int number) {
  const ep_gltf_animation still = {
      .n = solid->n, .x = solid->x, .triangles = solid->triangles, .triangle = solid->triangle};
  char name[32];
  writer own = *w;
  own.a = &still;
  own.flat = solid->flat;
  own.nv = 0;
  own.vertex = NULL, own.index = NULL, own.low = NULL, own.range = NULL;
  own.base = NULL, own.base_normal = NULL, own.position = NULL, own.normal = NULL;
  json_t *primitive = json_object();
  ep_status status = primitive ? make_index(&own) : no_text(w);
  if (status == EP_OK) status = make_ranges(&own);
  if (status == EP_OK) status = add_primitive(&own, primitive);
  w->bin = own.bin, w->used = own.used, w->capacity = own.capacity;
  w->lost = own.lost;
  free_arrays(&own);
  snprintf(name, sizeof name, "obstacle %d", number + 1);
  if (status == EP_OK) {
    put(w, primitive, "material", json_integer(1));
    push(w, json_object_get(root, "meshes"),
         json_pack("{s:s, s:[O]}", "name", name, "primitives", primitive));
    push(w, json_object_get(root, "nodes"),
         json_pack("{s:i, s:s}", "mesh", number + 1, "name", name));
    json_t *scene = json_array_get(json_object_get(root, "scenes"), 0);
    push(w, json_object_get(scene, "nodes"), json_integer(number + 1));
  }
  json_decref(primitive);
  return status;
}

// Weights at the first frame (without frames: at rest), and the targets' names for editors.
static void add_mesh(writer *w, json_t *root, json_t *primitive) {
  json_t *mesh = json_pack("{s:s, s:[O]}", "name", w->a->name, "primitives", primitive);
  if (w->a->r > 0) {
    json_t *weights = json_array(), *names = json_array();
    for (int i = 0; i < w->a->r; i++) {
      char name[32];
      snprintf(name, sizeof name, "mode %d", i);
      push(w, names, json_string(name));
      push(w, weights, json_real(w->a->frames ? (double)weight(w, 0, i) : 0));
    }
    put(w, mesh, "weights", weights);
    put(w, mesh, "extras", json_pack("{s:o}", "targetNames", names));
  }
  put(w, root, "meshes", json_pack("[o]", mesh));
}

static json_t *make_root(writer *w) {
  const float *c = w->a->base_color;
  json_t *root = json_pack("{s:{s:s, s:s}, s:i, s:[{s:[i]}], s:[{s:i, s:s}]}", "asset", "version",
                           "2.0", "generator", "Eigenpose", "scene", 0, "scenes", "nodes", 0,
                           "nodes", "mesh", 0, "name", w->a->name);
  if (!root) return NULL;
  put(w, root, "materials",
      json_pack("[{s:{s:[f,f,f,f], s:f, s:f}, s:b}]", "pbrMetallicRoughness", "baseColorFactor",
                (double)c[0], (double)c[1], (double)c[2], 1.0, "metallicFactor", 0.0,
                "roughnessFactor", 0.6, "doubleSided", 1));
  if (w->a->solids > 0) // grey, for what is in the way
    push(w, json_object_get(root, "materials"),
         json_pack("{s:{s:[f,f,f,f], s:f, s:f}}", "pbrMetallicRoughness", "baseColorFactor", 0.5,
                   0.5, 0.48, 1.0, "metallicFactor", 0.0, "roughnessFactor", 0.8));
  return root;
}

static void put_u32(FILE *file, size_t value) {
  for (int byte = 0; byte < 4; byte++) fputc((int)(value >> (8 * byte) & 255), file);
}

// Header (12 bytes), JSON chunk padded with blanks, binary chunk padded with zeros.
static ep_status write_container(const char *path, const char *text, const writer *w) {
  const size_t length = strlen(text), padded = (length + 3) / 4 * 4, bin = (w->used + 3) / 4 * 4;
  ep_output out;
  EP_TRY(ep_output_open(&out, path, w->err));
  put_u32(out.file, MAGIC);
  put_u32(out.file, 2);
  put_u32(out.file, 12 + 8 + padded + 8 + bin);
  put_u32(out.file, padded);
  put_u32(out.file, CHUNK_JSON);
  fwrite(text, 1, length, out.file);
  for (size_t i = length; i < padded; i++) fputc(' ', out.file);
  put_u32(out.file, bin);
  put_u32(out.file, CHUNK_BIN);
  fwrite(w->bin, 1, w->used, out.file);
  for (size_t i = w->used; i < bin; i++) fputc(0, out.file);
  return ep_output_commit(&out, w->err);
}

static ep_status write_all(const char *path, writer *w, json_t *root) {
  json_t *primitive = json_object();
  ep_status status = primitive ? add_primitive(w, primitive) : no_text(w);
  if (status == EP_OK) add_mesh(w, root, primitive);
  json_decref(primitive);
  EP_TRY(status);
  for (int i = 0; i < w->a->solids; i++) EP_TRY(add_solid(w, root, &w->a->solid[i], i));
  EP_TRY(add_animation(w, root));
  put(w, root, "accessors", json_incref(w->accessors));
  put(w, root, "bufferViews", json_incref(w->views));
  put(w, root, "buffers", json_pack("[{s:I}]", "byteLength", (json_int_t)((w->used + 3) / 4 * 4)));
  if (w->lost) return no_text(w);
  char *text = json_dumps(root, JSON_COMPACT | JSON_REAL_PRECISION(9));
  if (!text) return no_text(w);
  status = write_container(path, text, w);
  free(text);
  return status;
}

ep_status ep_gltf_write(const char *path, const ep_gltf_animation *animation, ep_error *err) {
  EP_TRY(check(animation, err));
  writer w = {.a = animation, .views = json_array(), .accessors = json_array(), .err = err};
  json_t *root = make_root(&w);
  ep_status status = EP_OK;
  if (!root || !w.views || !w.accessors)
    status = ep_fail(err, EP_ERR_ARGUMENT, "glTF: name is not UTF-8, or no memory");
  if (status == EP_OK) status = make_index(&w);
  if (status == EP_OK) status = make_ranges(&w);
  if (status == EP_OK) status = write_all(path, &w, root);
  json_decref(root);
  json_decref(w.views);
  json_decref(w.accessors);
  free_arrays(&w);
  free(w.bin);
  return status;
}
