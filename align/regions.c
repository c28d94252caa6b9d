#include <ctype.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>

#include "align/align.h"
#include "base/files.h"

// A cursor over the text; `line` counts from 1.
typedef struct reader {
  const char *name, *at;
  int line;
  int *mark; // (largest mesh) region in which a vertex was last seen, to drop repeats
  ep_regions *out;
  int capacity;
} reader;

void ep_regions_free(ep_regions *regions) {
  if (!regions) return;
  free(regions->start);
  free(regions->vertex);
  memset(regions, 0, sizeof *regions);
}

static void skip_spaces(reader *r) {
  while (*r->at == ' ' || *r->at == '\t' || *r->at == '\r') r->at++;
}

static void skip_separators(reader *r) {
  while (*r->at == ' ' || *r->at == '\t' || *r->at == '\r' || *r->at == ';' || *r->at == ',')
    r->at++;
}

static void skip_blank_lines(reader *r) {
  while (isspace((unsigned char)*r->at)) r->line += *r->at++ == '\n';
}

// A whole number without sign; -1 where there is none, INT_MAX where it is too large.
static int take_number(reader *r) {
  if (!isdigit((unsigned char)*r->at)) return -1;
  long value = 0;
  while (isdigit((unsigned char)*r->at)) {
    if (value < INT_MAX) value = value * 10 + (*r->at - '0');
    r->at++;
  }
  return value < INT_MAX ? (int)value : INT_MAX;
}

static ep_status unexpected(const reader *r, const char *wanted, ep_error *err) {
  if (!*r->at)
    return ep_fail(err, EP_ERR_FORMAT, "%s:%d: the file ends where %s was expected", r->name,
                   r->line, wanted);
  return ep_fail(err, EP_ERR_FORMAT, "%s:%d: '%c' where %s was expected", r->name, r->line,
                 isprint((unsigned char)*r->at) ? *r->at : '?', wanted);
}

static ep_status push(reader *r, int *used, int vertex, ep_error *err) {
  if (*used == r->capacity) {
    const int larger = r->capacity ? 2 * r->capacity : 1024;
    int *grown = realloc(r->out->vertex, (size_t)larger * sizeof *grown);
    if (!grown) return ep_fail(err, EP_ERR_MEMORY, "%s: no memory for the regions", r->name);
    r->out->vertex = grown;
    r->capacity = larger;
  }
  r->out->vertex[(*used)++] = vertex;
  return EP_OK;
}

// One line: vertices of one region of one shape. Vertices of the file no tet uses are passed over.
static ep_status take_region(reader *r, int which, const ep_mesh *mesh, int *used, ep_error *err) {
  const int region = which / r->out->shapes + 1, first = *used;
  skip_blank_lines(r);
  if (!*r->at)
    return ep_fail(err, EP_ERR_FORMAT,
                   "%s:%d: the file ends after %d of %d lines of vertices (%d regions for each of "
                   "%d shapes)",
                   r->name, r->line, which, r->out->count * r->out->shapes, r->out->count,
                   r->out->shapes);
  skip_separators(r);
  while (*r->at && *r->at != '\n') {
    const int number = take_number(r);
    if (number < 0) return unexpected(r, "a vertex number or the line's end", err);
    if (number < 1 || number > mesh->file_vertices)
      return ep_fail(err, EP_ERR_FORMAT,
                     "%s:%d: region %d names vertex %d, but %s has vertices 1 to %d", r->name,
                     r->line, region, number, mesh->name, mesh->file_vertices);
    const int vertex = ep_mesh_from_file_vertex(mesh, number - 1);
    if (vertex >= 0 && r->mark[vertex] != which) {
      r->mark[vertex] = which;
      EP_TRY(push(r, used, vertex, err));
    }
    skip_separators(r);
  }
  if (*used == first)
    return ep_fail(err, EP_ERR_FORMAT,
                   "%s:%d: region %d has no vertices on %s; give some or leave the region out",
                   r->name, r->line, region, mesh->name);
  return EP_OK;
}

static ep_status take_count(reader *r, ep_error *err) {
  skip_blank_lines(r);
  const int count = take_number(r);
  if (count < 0) return unexpected(r, "the number of regions", err);
  if (count < 1 || count > INT_MAX / r->out->shapes - 1)
    return ep_fail(err, EP_ERR_FORMAT, "%s:%d: the number of regions is %d, it must be 1 or more",
                   r->name, r->line, count);
  r->out->count = count;
  skip_spaces(r);
  if (*r->at == ';') r->at++;
  skip_spaces(r);
  return *r->at == '\n' || !*r->at ? EP_OK : unexpected(r, "the line's end", err);
}

// Lines of vertices the text can hold at most: bounds what a wrong count makes us allocate.
static int lines_left(const char *at) {
  int lines = 1;
  for (; *at; at++) lines += *at == '\n';
  return lines;
}

static ep_status take_all(reader *r, const ep_mesh *const *meshes, ep_error *err) {
  EP_TRY(take_count(r, err));
  const int lines = r->out->count * r->out->shapes, left = lines_left(r->at);
  const int room = lines < left ? lines : left;
  r->out->start = malloc(((size_t)room + 1) * sizeof *r->out->start);
  if (!r->out->start)
    return ep_fail(err, EP_ERR_MEMORY, "%s: no memory for %d lines", r->name, room);
  int used = 0;
  for (int which = 0; which < lines; which++) {
    if (which < room) r->out->start[which] = used;
    EP_TRY(take_region(r, which, meshes[which % r->out->shapes], &used, err));
  }
  r->out->start[lines] = used;
  skip_blank_lines(r);
  if (*r->at)
    return ep_fail(err, EP_ERR_FORMAT,
                   "%s:%d: more lines than %d regions for %d shapes need; the file must name the "
                   "object and every example, in the scene's order",
                   r->name, r->line, r->out->count, r->out->shapes);
  return EP_OK;
}

ep_status ep_regions_parse(const char *name, const char *bytes, int shapes,
                           const ep_mesh *const *meshes, ep_regions *out, ep_error *err) {
  memset(out, 0, sizeof *out);
  if (shapes < 1) return ep_fail(err, EP_ERR_ARGUMENT, "%s: regions of no shapes", name);
  int largest = 0;
  for (int s = 0; s < shapes; s++)
    if (meshes[s]->nv > largest) largest = meshes[s]->nv;
  reader r = {.name = name, .at = bytes, .line = 1, .out = out};
  out->shapes = shapes;
  r.mark = malloc(((size_t)largest + 1) * sizeof *r.mark);
  if (!r.mark) return ep_fail(err, EP_ERR_MEMORY, "%s: no memory for %d vertices", name, largest);
  for (int i = 0; i < largest; i++) r.mark[i] = -1;
  const ep_status status = take_all(&r, meshes, err);
  free(r.mark);
  if (status != EP_OK) ep_regions_free(out);
  return status;
}

ep_status ep_regions_read(const char *path, int shapes, const ep_mesh *const *meshes,
                          ep_regions *out, ep_error *err) {
  memset(out, 0, sizeof *out);
  char *text = NULL;
  size_t size = 0;
  EP_TRY(ep_file_read(path, &text, &size, err));
  ep_status status = EP_OK;
  if (strlen(text) != size)
    status =
        ep_fail(err, EP_ERR_FORMAT, "%s: not a text file (a zero byte at %zu)", path, strlen(text));
  else
    status = ep_regions_parse(path, text, shapes, meshes, out, err);
  free(text);
  return status;
}
