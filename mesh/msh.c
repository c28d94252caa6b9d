// Gmsh's .msh, versions 2.x and 4.1, ASCII and binary (either byte order). Sections other than
// $Nodes and $Elements are passed over. Vertices are kept in the order of their numbers, which need
// not be dense: file_vertex is the number less 1 (less 0 where the file has a vertex 0).
#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "mesh/readers.h"

enum { TET = 4, MOST_NODES = 125, MOST_TAGS = 10000 };

typedef struct msh {
  ep_raw_mesh *raw;
  ep_scan scan;
  bool binary, swap, wide; // wide: version 4 counts with 64 bits where version 2 has 32
  bool have_nodes, have_elements;
  int *number; // (raw->nv) as in the file
  int nnumbers, room_numbers;
  bool dense; // number[i] == number[0] + i
} msh;

// Nodes of each element type, from the Gmsh manual; 0: no such type here.
static int nodes_of(int type) {
  static const unsigned char nodes[] = {0,  2,  3,  4,  4, 8, 6,  5,  3,  6, 9,
                                        10, 27, 18, 14, 1, 8, 20, 15, 13, 9, 10,
                                        12, 15, 15, 21, 4, 5, 6,  20, 35, 56};
  if (type == 92) return 64;
  if (type == 93) return 125;
  return type > 0 && type < (int)sizeof nodes ? nodes[type] : 0;
}

static bool is_high_tet(int type) {
  return type == 11 || (type >= 29 && type <= 31);
}

// --- numbers, whatever the encoding

static ep_status in_range(msh *m, const char *what, long long value, long long low, long long high,
                          ep_error *err) {
  if (value >= low && value <= high) return EP_OK;
  m->scan.at = m->scan.mark;
  return ep_scan_fail_byte(&m->scan, err, "%s is %lld, but must lie in %lld to %lld", what, value,
                           low, high);
}

static ep_status read_int(msh *m, const char *what, int low, int high, int *out, ep_error *err) {
  if (!m->binary) return ep_scan_int(&m->scan, what, low, high, out, err);
  int32_t value;
  EP_TRY(ep_scan_i32(&m->scan, m->swap, what, &value, err));
  *out = value;
  return in_range(m, what, value, low, high, err);
}

// A count or number: size_t in version 4, int in version 2.
static ep_status read_size(msh *m, const char *what, int high, int *out, ep_error *err) {
  if (!m->binary || !m->wide) return read_int(m, what, 0, high, out, err);
  int64_t value;
  EP_TRY(ep_scan_i64(&m->scan, m->swap, what, &value, err));
  EP_TRY(in_range(m, what, value, 0, high, err));
  *out = (int)value;
  return EP_OK;
}

static ep_status read_double(msh *m, const char *what, double *out, ep_error *err) {
  if (!m->binary) return ep_scan_double(&m->scan, what, out, err);
  EP_TRY(ep_scan_f64(&m->scan, m->swap, what, out, err));
  if (isfinite(*out)) return EP_OK;
  m->scan.at = m->scan.mark;
  return ep_scan_fail_byte(&m->scan, err, "%s is not a finite number", what);
}

// "name:line" in text, "name: byte N" in binary files.
static ep_status fail_at(msh *m, ep_error *err, const char *what, long long a, long long b) {
  if (m->binary) return ep_scan_fail_byte(&m->scan, err, "%s (%lld, %lld)", what, a, b);
  return ep_scan_fail(&m->scan, err, "%s (%lld, %lld)", what, a, b);
}

// --- nodes

static ep_status add_number(msh *m, ep_error *err) {
  int number;
  EP_TRY(read_size(m, "a node number", INT_MAX - 1, &number, err));
  void *numbers = m->number;
  const ep_status status =
      ep_grow(&numbers, &m->room_numbers, m->nnumbers + 1, sizeof number, m->raw->name, err);
  m->number = numbers;
  if (status == EP_OK) m->number[m->nnumbers++] = number;
  return status;
}

static ep_status add_vertex(msh *m, int parameters, ep_error *err) {
  double x[3], unused;
  for (int k = 0; k < 3; k++) EP_TRY(read_double(m, "a coordinate", x + k, err));
  for (int k = 0; k < parameters; k++) EP_TRY(read_double(m, "a parameter", &unused, err));
  return ep_raw_vertex(m->raw, x, err);
}

// A count in version 2 is text, also in binary files; the data begin behind its line.
static ep_status read_text_count(msh *m, const char *what, int *count, ep_error *err) {
  EP_TRY(ep_scan_int(&m->scan, what, 0, EP_MESH_LIMIT, count, err));
  if (m->binary) ep_scan_skip_line(&m->scan);
  return EP_OK;
}

static ep_status read_nodes_2(msh *m, ep_error *err) {
  int count;
  EP_TRY(read_text_count(m, "the number of nodes", &count, err));
  for (int i = 0; i < count; i++) {
    EP_TRY(add_number(m, err));
    EP_TRY(add_vertex(m, 0, err));
  }
  return EP_OK;
}

typedef struct block {
  int dimension, kind, count; // kind: parametric for nodes, type for elements
} block;

// Four counts before all blocks; the least and the greatest number are not needed.
static ep_status read_block_header_4(msh *m, int *blocks, int *total, ep_error *err) {
  int unused;
  if (m->binary) ep_scan_skip_line(&m->scan);
  EP_TRY(read_size(m, "the number of blocks", INT_MAX, blocks, err));
  EP_TRY(read_size(m, "the number of entries", EP_MESH_LIMIT, total, err));
  EP_TRY(read_size(m, "the least number", INT_MAX, &unused, err));
  return read_size(m, "the greatest number", INT_MAX, &unused, err);
}

static ep_status read_block_4(msh *m, const char *kind, block *b, ep_error *err) {
  int unused;
  EP_TRY(read_int(m, "the dimension of a block", 0, 3, &b->dimension, err));
  EP_TRY(read_int(m, "the entity of a block", INT_MIN, INT_MAX, &unused, err));
  EP_TRY(read_int(m, kind, 0, INT_MAX, &b->kind, err));
  return read_size(m, "the number of entries of a block", EP_MESH_LIMIT, &b->count, err);
}

static ep_status read_nodes_4(msh *m, ep_error *err) {
  int blocks, total;
  EP_TRY(read_block_header_4(m, &blocks, &total, err));
  for (int i = 0; i < blocks; i++) {
    block b;
    EP_TRY(read_block_4(m, "whether a block has parameters", &b, err));
    for (int j = 0; j < b.count; j++) EP_TRY(add_number(m, err));
    for (int j = 0; j < b.count; j++) EP_TRY(add_vertex(m, b.kind ? b.dimension : 0, err));
  }
  if (m->raw->nv == total) return EP_OK;
  return fail_at(m, err, "the section announces other than the blocks hold: nodes", total,
                 m->raw->nv);
}

typedef struct numbered {
  int number, place;
} numbered;

static int compare_numbered(const void *a, const void *b) {
  const int s = ((const numbered *)a)->number, t = ((const numbered *)b)->number;
  return (s > t) - (s < t);
}

// Bring the vertices into the order of their numbers.
static ep_status sort_nodes(msh *m, ep_error *err) {
  const int nv = m->raw->nv;
  numbered *order = malloc(((size_t)nv + 1) * sizeof *order);
  double *x = malloc((3 * (size_t)nv + 1) * sizeof *x);
  if (order && x) {
    for (int i = 0; i < nv; i++) order[i] = (numbered){m->number[i], i};
    qsort(order, (size_t)nv, sizeof *order, compare_numbered);
    for (int i = 0; i < nv; i++) {
      m->number[i] = order[i].number;
      memcpy(x + 3 * i, m->raw->x + 3 * order[i].place, 3 * sizeof *x);
    }
    memcpy(m->raw->x, x, 3 * (size_t)nv * sizeof *x);
  }
  const bool good = order && x;
  free(order);
  free(x);
  return good ? EP_OK : ep_fail(err, EP_ERR_MEMORY, "no memory for the mesh %s", m->raw->name);
}

static ep_status number_nodes(msh *m, ep_error *err) {
  const int nv = m->raw->nv;
  bool ascending = true;
  for (int i = 1; i < nv; i++) ascending &= m->number[i] > m->number[i - 1];
  if (!ascending) EP_TRY(sort_nodes(m, err));
  for (int i = 1; i < nv; i++)
    if (m->number[i] == m->number[i - 1])
      return ep_fail(err, EP_ERR_FORMAT, "%s: two nodes have the number %d", m->raw->name,
                     m->number[i]);
  const int base = nv && m->number[0] == 0 ? 0 : 1;
  m->dense = nv && m->number[nv - 1] - m->number[0] == nv - 1;
  if (!nv || (m->dense && m->number[0] == base)) return EP_OK;
  m->raw->number = malloc((size_t)nv * sizeof(int));
  if (!m->raw->number)
    return ep_fail(err, EP_ERR_MEMORY, "no memory for the mesh %s", m->raw->name);
  for (int i = 0; i < nv; i++) m->raw->number[i] = m->number[i] - base;
  return EP_OK;
}

static ep_status read_nodes(msh *m, ep_error *err) {
  if (m->have_nodes) return ep_scan_fail(&m->scan, err, "a second section $Nodes");
  m->have_nodes = true;
  EP_TRY(m->wide ? read_nodes_4(m, err) : read_nodes_2(m, err));
  return number_nodes(m, err);
}

// --- elements

static int place_of(const msh *m, int number) {
  const int nv = m->raw->nv;
  if (nv == 0 || number < m->number[0] || number > m->number[nv - 1]) return -1;
  if (m->dense) return number - m->number[0];
  int low = 0, high = nv - 1;
  while (low < high) {
    const int middle = low + (high - low) / 2;
    if (m->number[middle] < number)
      low = middle + 1;
    else
      high = middle;
  }
  return m->number[low] == number ? low : -1;
}

static ep_status read_tet(msh *m, int element, ep_error *err) {
  int tet[4];
  for (int i = 0; i < 4; i++) {
    int number;
    EP_TRY(read_size(m, "a node of an element", INT_MAX, &number, err));
    tet[i] = place_of(m, number);
    if (tet[i] < 0)
      return fail_at(m, err, "an element has a node that does not exist: element, node", element,
                     number);
  }
  return ep_raw_tet(m->raw, tet, err);
}

static ep_status read_element_nodes(msh *m, int type, int element, ep_error *err) {
  if (type == TET) return read_tet(m, element, err);
  int unused;
  for (int i = 0; i < nodes_of(type); i++)
    EP_TRY(read_size(m, "a node of an element", INT_MAX, &unused, err));
  ep_raw_drop(m->raw, is_high_tet(type));
  return EP_OK;
}

static ep_status check_type(msh *m, int type, ep_error *err) {
  if (nodes_of(type)) return EP_OK;
  return ep_scan_fail_as(&m->scan, EP_ERR_UNSUPPORTED, err,
                         "elements of type %d are not known here; export linear tets", type);
}

static ep_status read_element_2(msh *m, int type, int tags, ep_error *err) {
  int unused, element;
  EP_TRY(read_int(m, "an element number", INT_MIN, INT_MAX, &element, err));
  if (!m->binary) {
    EP_TRY(read_int(m, "an element type", 0, INT_MAX, &type, err));
    EP_TRY(check_type(m, type, err));
    EP_TRY(read_int(m, "the number of tags", 0, MOST_TAGS, &tags, err));
  }
  for (int i = 0; i < tags; i++)
    EP_TRY(read_int(m, "a tag of an element", INT_MIN, INT_MAX, &unused, err));
  return read_element_nodes(m, type, element, err);
}

static ep_status read_elements_2(msh *m, ep_error *err) {
  int total, type = 0, count = 1, tags = 0;
  EP_TRY(read_text_count(m, "the number of elements", &total, err));
  for (int done = 0; done < total; done += count) {
    if (m->binary) {
      EP_TRY(read_int(m, "an element type", 0, INT_MAX, &type, err));
      EP_TRY(check_type(m, type, err));
      EP_TRY(read_int(m, "the number of elements of a block", 1, total - done, &count, err));
      EP_TRY(read_int(m, "the number of tags", 0, MOST_TAGS, &tags, err));
    }
    for (int i = 0; i < count; i++) EP_TRY(read_element_2(m, type, tags, err));
  }
  return EP_OK;
}

static ep_status read_elements_4(msh *m, ep_error *err) {
  int blocks, total, done = 0;
  EP_TRY(read_block_header_4(m, &blocks, &total, err));
  for (int i = 0; i < blocks; i++) {
    block b;
    EP_TRY(read_block_4(m, "an element type", &b, err));
    EP_TRY(check_type(m, b.kind, err));
    if (b.count > total - done)
      return fail_at(m, err, "the blocks hold more elements than the section announces", total,
                     (long long)done + b.count);
    for (int j = 0; j < b.count; j++) {
      int element;
      EP_TRY(read_size(m, "an element number", INT_MAX, &element, err));
      EP_TRY(read_element_nodes(m, b.kind, element, err));
    }
    done += b.count;
  }
  if (done == total) return EP_OK;
  return fail_at(m, err, "the section announces more elements than the blocks hold", total, done);
}

static ep_status read_elements(msh *m, ep_error *err) {
  if (m->have_elements) return ep_scan_fail(&m->scan, err, "a second section $Elements");
  if (!m->have_nodes) return ep_scan_fail(&m->scan, err, "$Elements before $Nodes");
  m->have_elements = true;
  return m->wide ? read_elements_4(m, err) : read_elements_2(m, err);
}

// --- the file

static ep_status read_byte_order(msh *m, ep_error *err) {
  int32_t one;
  ep_scan_skip_line(&m->scan);
  EP_TRY(ep_scan_i32(&m->scan, false, "the byte order mark", &one, err));
  m->swap = one != 1;
  if (m->swap) {
    m->scan.at = m->scan.mark;
    EP_TRY(ep_scan_i32(&m->scan, true, "the byte order mark", &one, err));
  }
  if (one == 1) return EP_OK;
  m->scan.at = m->scan.mark;
  return ep_scan_fail_byte(&m->scan, err, "not a Gmsh byte order mark");
}

static ep_status read_format(msh *m, ep_error *err) {
  double version;
  int binary, size;
  EP_TRY(ep_scan_double(&m->scan, "the version", &version, err));
  if (!(version >= 2 && version < 3) && version != 4.1)
    return ep_scan_fail_as(&m->scan, EP_ERR_UNSUPPORTED, err,
                           "Gmsh file version %g; save it as version 4.1 or 2.2", version);
  EP_TRY(ep_scan_int(&m->scan, "the file type", 0, 1, &binary, err));
  EP_TRY(ep_scan_int(&m->scan, "the size of a number", 8, 8, &size, err));
  m->wide = version > 4;
  m->binary = binary == 1;
  return m->binary ? read_byte_order(m, err) : EP_OK;
}

// Move behind "$End" and the section's name, `section` being "$Name".
static ep_status skip_section(msh *m, ep_token section, ep_error *err) {
  const char *p = m->scan.at;
  const size_t length = (size_t)section.length - 1;
  while ((size_t)(m->scan.end - p) >= length + 4) {
    p = memchr(p, '$', (size_t)(m->scan.end - p) - length - 3);
    if (!p) break;
    if (memcmp(p, "$End", 4) == 0 && memcmp(p + 4, section.text + 1, length) == 0) {
      m->scan.at = p + 4 + length;
      return EP_OK;
    }
    p++;
  }
  return ep_scan_fail(&m->scan, err, "the section %.*s does not end",
                      section.length < 40 ? section.length : 40, section.text);
}

static ep_status expect(msh *m, const char *word, ep_error *err) {
  ep_token token;
  ep_scan_token(&m->scan, &token);
  if (ep_token_is(token, word)) return EP_OK;
  if (m->binary) {
    m->scan.at = m->scan.mark;
    return ep_scan_fail_byte(&m->scan, err, "%s is expected here", word);
  }
  return ep_scan_fail(&m->scan, err, "%s is expected here, not '%.*s'", word,
                      token.length < 40 ? token.length : 40, token.text);
}

static ep_status read_section(msh *m, ep_token word, ep_error *err) {
  if (ep_token_is(word, "$Nodes")) {
    EP_TRY(read_nodes(m, err));
    return expect(m, "$EndNodes", err);
  }
  if (ep_token_is(word, "$Elements")) {
    EP_TRY(read_elements(m, err));
    return expect(m, "$EndElements", err);
  }
  if (word.length > 1 && *word.text == '$') return skip_section(m, word, err);
  return ep_scan_fail(&m->scan, err, "a section ($Nodes, $Elements, ...) is expected, not '%.*s'",
                      word.length < 40 ? word.length : 40, word.text);
}

static ep_status read_all(msh *m, ep_error *err) {
  ep_token word = ep_scan_peek(&m->scan);
  if (ep_token_is(word, "$NOD"))
    return ep_scan_fail_as(&m->scan, EP_ERR_UNSUPPORTED, err,
                           "Gmsh file version 1; save it as version 4.1 or 2.2");
  EP_TRY(expect(m, "$MeshFormat", err));
  EP_TRY(read_format(m, err));
  EP_TRY(expect(m, "$EndMeshFormat", err));
  while (ep_scan_token(&m->scan, &word)) EP_TRY(read_section(m, word, err));
  if (m->have_nodes && m->have_elements) return EP_OK;
  return ep_fail(err, EP_ERR_FORMAT, "%s: there is no section %s", m->raw->name,
                 m->have_nodes ? "$Elements" : "$Nodes");
}

ep_status ep_read_msh(ep_raw_mesh *raw, ep_scan scan, ep_error *err) {
  msh m = {.raw = raw, .scan = scan};
  const ep_status status = read_all(&m, err);
  free(m.number);
  return status;
}
