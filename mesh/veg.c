// VegaFEM's .veg: sections *VERTICES, *ELEMENTS, *MATERIAL, *SET, *REGION; *INCLUDE stands for the
// lines of another file (also of a TetGen .node or .ele). Numbers in the file count from the
// number of the first vertex and the first element, 0 or 1.
#include <limits.h>
#include <stdlib.h>
#include <string.h>

#include "base/files.h"
#include "mesh/readers.h"

enum { INCLUDE_DEPTH = 8, INCLUDE_COUNT = 64 };

// Text being read; included files stay in memory to the end, since names point into them.
typedef struct source {
  char *text; // owned; NULL for the first one
  char *name; // owned; NULL for the first one
  ep_scan scan;
} source;

typedef struct element_set {
  ep_token name;
  ep_scan place;
  int *element; // numbers as in the file
  int count, room;
} element_set;

typedef struct region {
  ep_token set, material;
  ep_scan place;
} region;

typedef struct veg {
  ep_raw_mesh *raw;
  const char *folder;
  source *sources[INCLUDE_COUNT + 1];
  int nsources, depth;
  source *stack[INCLUDE_DEPTH];
  ep_scan line; // the line under work
  bool pending; // it is to be delivered once more
  bool have_vertices, have_elements;
  int vertex_base, element_base;
  ep_token *material_name; // (raw->nmaterials)
  element_set *set;
  region *regions;
  int nsets, nregions, room_names, room_materials, room_sets, room_regions;
} veg;

// --- lines, through includes

static ep_status add_source(veg *v, char *name, char *text, ep_scan scan, ep_error *err) {
  source *s = malloc(sizeof *s);
  if (!s) {
    free(name);
    free(text);
    return ep_fail(err, EP_ERR_MEMORY, "no memory for the mesh %s", v->raw->name);
  }
  *s = (source){.text = text, .name = name, .scan = scan};
  s->scan.comment = '#';
  s->scan.commas = true;
  v->sources[v->nsources++] = s;
  v->stack[v->depth++] = s;
  return EP_OK;
}

// The rest of the line as a path; file names may hold blanks and commas.
static ep_status include_path(veg *v, ep_scan line, char path[EP_PATH_MAX], ep_error *err) {
  const char *from = line.at, *to = line.end;
  while (from < to && strchr(" \t\r", *from)) from++;
  while (to > from && strchr(" \t\r", to[-1])) to--;
  if (from == to) return ep_scan_fail(&line, err, "*INCLUDE without a file name");
  if (memchr(from, '\0', (size_t)(to - from)) || to - from >= EP_PATH_MAX)
    return ep_scan_fail(&line, err, "*INCLUDE: not a file name");
  if (!v->folder) return ep_scan_fail(&line, err, "*INCLUDE in a mesh that is not in a folder");
  char name[EP_PATH_MAX];
  memcpy(name, from, (size_t)(to - from));
  name[to - from] = '\0';
  return ep_path_join(v->folder, name, path, err);
}

static ep_status include(veg *v, ep_scan line, ep_error *err) {
  char path[EP_PATH_MAX], *text;
  size_t size;
  EP_TRY(include_path(v, line, path, err));
  if (v->depth == INCLUDE_DEPTH || v->nsources > INCLUDE_COUNT)
    return ep_scan_fail(&line, err, "*INCLUDE %s: too many nested files; does it include itself?",
                        path);
  const ep_status status = ep_file_read(path, &text, &size, err);
  if (status != EP_OK) {
    if (err) ep_fail_context(err, "%s", line.name);
    return status;
  }
  char *name = strdup(path);
  if (!name) {
    free(text);
    return ep_fail(err, EP_ERR_MEMORY, "no memory for the mesh %s", v->raw->name);
  }
  return add_source(v, name, text, ep_scan_open(name, text, size, '#'), err);
}

// The next line into v->line; *end where there is none.
static ep_status next_line(veg *v, bool *end, ep_error *err) {
  *end = false;
  if (v->pending) {
    v->pending = false;
    return EP_OK;
  }
  while (v->depth > 0) {
    ep_scan line;
    if (!ep_scan_line(&v->stack[v->depth - 1]->scan, &line)) {
      // An error about something missing should name the last line there was.
      if (v->depth == 1 && !v->line.start) v->line = line;
      v->depth--;
      continue;
    }
    if (!ep_token_is(ep_scan_peek(&line), "*INCLUDE")) {
      v->line = line;
      return EP_OK;
    }
    ep_token token;
    ep_scan_token(&line, &token);
    EP_TRY(include(v, line, err));
  }
  *end = true;
  return EP_OK;
}

// A line a section must have.
static ep_status need_line(veg *v, const char *what, ep_error *err) {
  bool end;
  EP_TRY(next_line(v, &end, err));
  if (end) return ep_scan_fail(&v->line, err, "the file ends too early: %s is missing", what);
  const ep_token token = ep_scan_peek(&v->line);
  if (*token.text == '*') {
    v->line.mark = token.text;
    return ep_scan_fail(&v->line, err, "%s is missing before this section", what);
  }
  return EP_OK;
}

// --- sections

// "count columns [attributes [markers]]": how many numbers follow the columns of each line.
static ep_status read_counts(veg *v, const char *what, int columns, int *count, int *extra,
                             ep_error *err) {
  int found = columns, attributes = 0, markers = 0;
  EP_TRY(need_line(v, what, err));
  EP_TRY(ep_scan_int(&v->line, what, 0, EP_MESH_LIMIT, count, err));
  if (ep_scan_peek(&v->line).length)
    EP_TRY(ep_scan_int(&v->line, "the number of columns", columns, columns, &found, err));
  if (ep_scan_peek(&v->line).length)
    EP_TRY(ep_scan_int(&v->line, "the number of attributes", 0, 1000, &attributes, err));
  if (ep_scan_peek(&v->line).length)
    EP_TRY(ep_scan_int(&v->line, "the number of markers", 0, 1000, &markers, err));
  *extra = attributes + markers;
  return ep_scan_expect_end(&v->line, err);
}

// The number that begins each line: 0 or 1 first, then counting up.
static ep_status read_number(veg *v, const char *what, int i, int *base, ep_error *err) {
  int number;
  EP_TRY(ep_scan_int(&v->line, what, 0, INT_MAX, &number, err));
  if (i == 0) *base = number;
  if (*base > 1)
    return ep_scan_fail(&v->line, err, "%s is %d, but numbers begin at 0 or 1", what, number);
  if (number != *base + i)
    return ep_scan_fail(&v->line, err, "%s is %d, but %d comes next", what, number, *base + i);
  return EP_OK;
}

static ep_status read_vertices(veg *v, ep_error *err) {
  int count, extra;
  if (v->have_vertices) return ep_scan_fail(&v->line, err, "a second section *VERTICES");
  v->have_vertices = true;
  EP_TRY(read_counts(v, "the number of vertices", 3, &count, &extra, err));
  for (int i = 0; i < count; i++) {
    double x[3];
    EP_TRY(need_line(v, "a vertex", err));
    EP_TRY(read_number(v, "the vertex number", i, &v->vertex_base, err));
    EP_TRY(ep_scan_doubles(&v->line, "a coordinate", 3, x, err));
    EP_TRY(ep_scan_skip_numbers(&v->line, extra, "an attribute", err));
    EP_TRY(ep_scan_expect_end(&v->line, err));
    EP_TRY(ep_raw_vertex(v->raw, x, err));
  }
  return EP_OK;
}

static ep_status read_element_type(veg *v, ep_error *err) {
  ep_token type;
  EP_TRY(need_line(v, "the element type", err));
  ep_scan_token(&v->line, &type);
  if (!ep_token_is(type, "TET") && !ep_token_is(type, "TETS"))
    return ep_scan_fail_as(&v->line, EP_ERR_UNSUPPORTED, err,
                           "elements of type %.*s; a mesh of tets (TET) is needed",
                           type.length < 40 ? type.length : 40, type.text);
  return ep_scan_expect_end(&v->line, err);
}

static ep_status read_elements(veg *v, ep_error *err) {
  int count, extra;
  if (v->have_elements) return ep_scan_fail(&v->line, err, "a second section *ELEMENTS");
  if (!v->have_vertices) return ep_scan_fail(&v->line, err, "*ELEMENTS before *VERTICES");
  v->have_elements = true;
  EP_TRY(read_element_type(v, err));
  EP_TRY(read_counts(v, "the number of elements", 4, &count, &extra, err));
  for (int e = 0; e < count; e++) {
    int tet[4];
    EP_TRY(need_line(v, "an element", err));
    EP_TRY(read_number(v, "the element number", e, &v->element_base, err));
    for (int i = 0; i < 4; i++) {
      EP_TRY(ep_scan_int(&v->line, "a vertex of the element", v->vertex_base,
                         v->raw->nv - 1 + v->vertex_base, tet + i, err));
      tet[i] -= v->vertex_base;
    }
    EP_TRY(ep_scan_skip_numbers(&v->line, extra, "an attribute", err));
    EP_TRY(ep_scan_expect_end(&v->line, err));
    EP_TRY(ep_raw_tet(v->raw, tet, err));
  }
  return EP_OK;
}

static ep_status read_name(veg *v, const char *what, ep_token *name, ep_error *err) {
  if (!ep_scan_token(&v->line, name)) return ep_scan_fail(&v->line, err, "%s has no name", what);
  return EP_OK;
}

static ep_status read_enu(veg *v, ep_elastic *m, ep_error *err) {
  ep_token model;
  EP_TRY(need_line(v, "the material model", err));
  ep_scan_token(&v->line, &model);
  if (!ep_token_is(model, "ENU"))
    return ep_scan_fail_as(&v->line, EP_ERR_UNSUPPORTED, err,
                           "material model %.*s; only 'ENU, density, E, nu' is known",
                           model.length < 40 ? model.length : 40, model.text);
  EP_TRY(ep_scan_double(&v->line, "the density", &m->density, err));
  EP_TRY(ep_scan_double(&v->line, "Young's modulus", &m->young, err));
  EP_TRY(ep_scan_double(&v->line, "Poisson's ratio", &m->poisson, err));
  EP_TRY(ep_scan_expect_end(&v->line, err));
  if (!(m->density > 0) || !(m->young > 0))
    return ep_scan_fail(&v->line, err, "density and Young's modulus must be above 0");
  if (!(m->poisson >= 0 && m->poisson < 0.5))
    return ep_scan_fail(&v->line, err, "Poisson's ratio is %g, but must lie in [0, 0.5)",
                        m->poisson);
  return EP_OK;
}

static ep_status read_material(veg *v, ep_error *err) {
  ep_raw_mesh *raw = v->raw;
  ep_token name;
  ep_elastic material;
  EP_TRY(read_name(v, "*MATERIAL", &name, err));
  EP_TRY(ep_scan_expect_end(&v->line, err));
  EP_TRY(read_enu(v, &material, err));
  void *names = v->material_name, *materials = raw->material;
  ep_status status =
      ep_grow(&names, &v->room_names, raw->nmaterials + 1, sizeof name, raw->name, err);
  v->material_name = names;
  if (status != EP_OK) return status;
  status =
      ep_grow(&materials, &v->room_materials, raw->nmaterials + 1, sizeof material, raw->name, err);
  raw->material = materials;
  if (status != EP_OK) return status;
  v->material_name[raw->nmaterials] = name;
  raw->material[raw->nmaterials++] = material;
  return EP_OK;
}

static ep_status add_to_set(veg *v, element_set *set, int element, ep_error *err) {
  void *elements = set->element;
  const ep_status status =
      ep_grow(&elements, &set->room, set->count + 1, sizeof element, v->raw->name, err);
  set->element = elements;
  if (status == EP_OK) set->element[set->count++] = element;
  return status;
}

static ep_status read_set(veg *v, ep_error *err) {
  element_set set = {0};
  EP_TRY(read_name(v, "*SET", &set.name, err));
  set.place = v->line;
  EP_TRY(ep_scan_expect_end(&v->line, err));
  void *sets = v->set;
  const ep_status status =
      ep_grow(&sets, &v->room_sets, v->nsets + 1, sizeof set, v->raw->name, err);
  v->set = sets;
  if (status != EP_OK) return status;
  v->set[v->nsets++] = set;
  for (;;) {
    bool end;
    EP_TRY(next_line(v, &end, err));
    if (end) return EP_OK;
    if (*ep_scan_peek(&v->line).text == '*') {
      v->pending = true;
      return EP_OK;
    }
    while (ep_scan_peek(&v->line).length) {
      int element;
      EP_TRY(ep_scan_int(&v->line, "an element of the set", 0, INT_MAX, &element, err));
      EP_TRY(add_to_set(v, &v->set[v->nsets - 1], element, err));
    }
  }
}

static ep_status read_region(veg *v, ep_error *err) {
  region r;
  EP_TRY(need_line(v, "'set, material' of the region", err));
  EP_TRY(read_name(v, "the set of the region", &r.set, err));
  r.place = v->line;
  EP_TRY(read_name(v, "the material of the region", &r.material, err));
  EP_TRY(ep_scan_expect_end(&v->line, err));
  void *regions = v->regions;
  const ep_status status =
      ep_grow(&regions, &v->room_regions, v->nregions + 1, sizeof r, v->raw->name, err);
  v->regions = regions;
  if (status == EP_OK) v->regions[v->nregions++] = r;
  return status;
}

// --- materials of the elements, when everything is known

static ep_status assign_set(veg *v, const element_set *set, int material, ep_error *err) {
  ep_raw_mesh *raw = v->raw;
  for (int i = 0; i < set->count; i++) {
    const int e = set->element[i] - v->element_base;
    if (e < 0 || e >= raw->nt)
      return ep_scan_fail(&set->place, err,
                          "set %.*s holds element %d, but elements are numbered %d to %d",
                          set->name.length < 40 ? set->name.length : 40, set->name.text,
                          set->element[i], v->element_base, raw->nt - 1 + v->element_base);
    raw->tet_material[e] = material;
  }
  return EP_OK;
}

static ep_status assign_region(veg *v, const region *r, ep_error *err) {
  ep_raw_mesh *raw = v->raw;
  int material = 0;
  while (material < raw->nmaterials && !ep_token_same(v->material_name[material], r->material))
    material++;
  if (material == raw->nmaterials)
    return ep_scan_fail(&r->place, err, "there is no material %.*s",
                        r->material.length < 40 ? r->material.length : 40, r->material.text);
  for (int i = 0; i < v->nsets; i++)
    if (ep_token_same(v->set[i].name, r->set)) return assign_set(v, v->set + i, material, err);
  if (!ep_token_is(r->set, "allElements"))
    return ep_scan_fail(&r->place, err, "there is no set %.*s",
                        r->set.length < 40 ? r->set.length : 40, r->set.text);
  for (int e = 0; e < raw->nt; e++) raw->tet_material[e] = material;
  return EP_OK;
}

// Later regions override earlier ones; one material and no region means that material everywhere.
static ep_status assign_materials(veg *v, ep_error *err) {
  ep_raw_mesh *raw = v->raw;
  if (raw->nmaterials == 0 && v->nregions == 0) return EP_OK;
  raw->tet_material = malloc(((size_t)raw->nt + 1) * sizeof(int));
  if (!raw->tet_material)
    return ep_fail(err, EP_ERR_MEMORY, "no memory for the mesh %s", raw->name);
  const int start = v->nregions == 0 && raw->nmaterials == 1 ? 0 : -1;
  for (int e = 0; e < raw->nt; e++) raw->tet_material[e] = start;
  for (int i = 0; i < v->nregions; i++) EP_TRY(assign_region(v, v->regions + i, err));
  for (int e = 0; e < raw->nt; e++)
    if (raw->tet_material[e] < 0)
      return ep_fail(err, EP_ERR_FORMAT,
                     "%s: element %d has no material; give it one with *REGION, or all with "
                     "'allElements, NAME'",
                     raw->name, e + v->element_base);
  return EP_OK;
}

static ep_status read_section(veg *v, ep_error *err) {
  static const struct {
    const char *word;
    ep_status (*read)(veg *, ep_error *);
  } sections[] = {{"*VERTICES", read_vertices},
                  {"*ELEMENTS", read_elements},
                  {"*MATERIAL", read_material},
                  {"*SET", read_set},
                  {"*REGION", read_region}};
  ep_token word;
  ep_scan_token(&v->line, &word);
  for (size_t i = 0; i < sizeof sections / sizeof *sections; i++)
    if (ep_token_is(word, sections[i].word)) return sections[i].read(v, err);
  return ep_scan_fail(&v->line, err,
                      "'%.*s' is no section of a .veg file (*VERTICES, *ELEMENTS, *MATERIAL, "
                      "*REGION, *SET, *INCLUDE)",
                      word.length < 40 ? word.length : 40, word.text);
}

static ep_status read_all(veg *v, ep_error *err) {
  for (;;) {
    bool end;
    EP_TRY(next_line(v, &end, err));
    if (end) break;
    EP_TRY(read_section(v, err));
  }
  if (!v->have_vertices || !v->have_elements)
    return ep_fail(err, EP_ERR_FORMAT, "%s: there is no section %s", v->raw->name,
                   v->have_vertices ? "*ELEMENTS" : "*VERTICES");
  return assign_materials(v, err);
}

ep_status ep_read_veg(ep_raw_mesh *raw, ep_scan scan, const char *folder, ep_error *err) {
  veg v = {.raw = raw, .folder = folder};
  ep_status status = add_source(&v, NULL, NULL, scan, err);
  if (status == EP_OK) status = read_all(&v, err);
  for (int i = 0; i < v.nsources; i++) {
    free(v.sources[i]->text);
    free(v.sources[i]->name);
    free(v.sources[i]);
  }
  for (int i = 0; i < v.nsets; i++) free(v.set[i].element);
  free(v.set);
  free(v.material_name);
  free(v.regions);
  return status;
}
