// Medit's ASCII .mesh (INRIA): keyword, count, lines of numbers. Vertices count from 1; files that
// count from 0 show it by using a vertex 0.
#include <ctype.h>
#include <limits.h>

#include "mesh/readers.h"

typedef enum section_kind { VERTICES, TETS, QUADRATIC_TETS, CELLS, OTHER } section_kind;

// Numbers of a line, the reference included. OTHER: things that are no cells (corners, normals).
static const struct {
  const char *word;
  section_kind kind;
  int columns;
} sections[] = {
    {"Vertices", VERTICES, 4},
    {"Tetrahedra", TETS, 5},
    {"TetrahedraP2", QUADRATIC_TETS, 11},
    {"Edges", CELLS, 3},
    {"EdgesP2", CELLS, 4},
    {"Triangles", CELLS, 4},
    {"TrianglesP2", CELLS, 7},
    {"Quadrilaterals", CELLS, 5},
    {"Hexahedra", CELLS, 9},
    {"Hexaedra", CELLS, 9}, // as old writers spell it
    {"Prisms", CELLS, 7},
    {"Pyramids", CELLS, 6},
    {"Corners", OTHER, 1},
    {"RequiredVertices", OTHER, 1},
    {"Ridges", OTHER, 1},
    {"RequiredEdges", OTHER, 1},
    {"RequiredTriangles", OTHER, 1},
    {"RequiredQuadrilaterals", OTHER, 1},
    {"Normals", OTHER, 3},
    {"Tangents", OTHER, 3},
    {"NormalAtVertices", OTHER, 2},
    {"TangentAtVertices", OTHER, 2},
    {"TangentAtEdges", OTHER, 3},
};

typedef struct medit {
  ep_raw_mesh *raw;
  ep_scan scan;
  bool have_vertices, have_tets;
  int lowest, highest;   // vertex numbers the tets use
  ep_scan highest_place; // where the highest stands, for the message
} medit;

static ep_status read_vertices(medit *m, int count, ep_error *err) {
  if (m->have_vertices) return ep_scan_fail(&m->scan, err, "a second section Vertices");
  m->have_vertices = true;
  for (int i = 0; i < count; i++) {
    double x[3];
    EP_TRY(ep_scan_doubles(&m->scan, "a coordinate", 3, x, err));
    EP_TRY(ep_scan_skip_numbers(&m->scan, 1, "the reference of a vertex", err));
    EP_TRY(ep_raw_vertex(m->raw, x, err));
  }
  return EP_OK;
}

static ep_status read_tets(medit *m, int count, ep_error *err) {
  if (m->have_tets) return ep_scan_fail(&m->scan, err, "a second section Tetrahedra");
  m->have_tets = true;
  for (int e = 0; e < count; e++) {
    int tet[4];
    for (int i = 0; i < 4; i++) {
      EP_TRY(ep_scan_int(&m->scan, "a vertex of a tet", 0, EP_MESH_LIMIT, tet + i, err));
      if (tet[i] < m->lowest) m->lowest = tet[i];
      if (tet[i] <= m->highest) continue;
      m->highest = tet[i];
      m->highest_place = m->scan;
    }
    EP_TRY(ep_scan_skip_numbers(&m->scan, 1, "the reference of a tet", err));
    EP_TRY(ep_raw_tet(m->raw, tet, err));
  }
  return EP_OK;
}

static ep_status read_others(medit *m, int count, int columns, section_kind kind, ep_error *err) {
  for (int i = 0; i < count; i++) {
    EP_TRY(ep_scan_skip_numbers(&m->scan, columns, "a number of this section", err));
    if (kind != OTHER) ep_raw_drop(m->raw, kind == QUADRATIC_TETS);
  }
  return EP_OK;
}

// A keyword not in the table: its numbers run to the next keyword.
static ep_status skip_unknown(medit *m, ep_error *err) {
  for (;;) {
    const ep_token token = ep_scan_peek(&m->scan);
    if (token.length == 0 || isalpha((unsigned char)*token.text)) return EP_OK;
    EP_TRY(ep_scan_skip_numbers(&m->scan, 1, "a number of this section", err));
  }
}

static ep_status read_section(medit *m, ep_token word, ep_error *err) {
  for (size_t i = 0; i < sizeof sections / sizeof *sections; i++) {
    int count;
    if (!ep_token_is(word, sections[i].word)) continue;
    EP_TRY(ep_scan_int(&m->scan, "the count of a section", 0, EP_MESH_LIMIT, &count, err));
    if (sections[i].kind == VERTICES) return read_vertices(m, count, err);
    if (sections[i].kind == TETS) return read_tets(m, count, err);
    return read_others(m, count, sections[i].columns, sections[i].kind, err);
  }
  if (isalpha((unsigned char)*word.text)) return skip_unknown(m, err);
  return ep_scan_fail(&m->scan, err,
                      "a keyword (Vertices, Tetrahedra, ..., End) is expected, not "
                      "'%.*s'; does the section before hold more than it says?",
                      word.length < 40 ? word.length : 40, word.text);
}

static ep_status read_header(medit *m, ep_error *err) {
  ep_token word;
  int version, dimension;
  ep_scan_token(&m->scan, &word);
  if (!ep_token_is(word, "MeshVersionFormatted"))
    return ep_scan_fail(&m->scan, err,
                        "not an ASCII Medit file: it must begin with MeshVersionFormatted");
  EP_TRY(ep_scan_int(&m->scan, "MeshVersionFormatted", 0, 4, &version, err));
  ep_scan_token(&m->scan, &word);
  if (!ep_token_is(word, "Dimension")) return ep_scan_fail(&m->scan, err, "Dimension is missing");
  return ep_scan_int(&m->scan, "Dimension", 3, 3, &dimension, err);
}

static ep_status settle_base(medit *m, ep_error *err) {
  const int base = m->lowest == 0 ? 0 : 1;
  if (m->raw->nt == 0) return EP_OK;
  if (m->highest - base >= m->raw->nv)
    return ep_scan_fail(&m->highest_place, err,
                        "a tet has vertex %d, but the vertices are numbered %d to %d", m->highest,
                        base, m->raw->nv - 1 + base);
  for (int i = 0; i < 4 * m->raw->nt; i++) m->raw->tet[i] -= base;
  return EP_OK;
}

ep_status ep_read_medit(ep_raw_mesh *raw, ep_scan scan, ep_error *err) {
  medit m = {.raw = raw, .scan = scan, .lowest = INT_MAX, .highest = -1};
  m.scan.comment = '#';
  EP_TRY(read_header(&m, err));
  ep_token word;
  while (ep_scan_token(&m.scan, &word) && !ep_token_is(word, "End"))
    EP_TRY(read_section(&m, word, err));
  if (!m.have_vertices) return ep_scan_fail(&m.scan, err, "there is no section Vertices");
  return settle_base(&m, err);
}
