// TetGen's .node and .ele: '#' comments, numbers from 0 or 1 as the first vertex says.
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/files.h"
#include "mesh/readers.h"

enum { QUADRATIC_TET = 10, COLUMNS_LIMIT = 10000 };

static ep_status need_line(ep_scan *scan, const char *what, ep_scan *line, ep_error *err) {
  if (ep_scan_line(scan, line)) return EP_OK;
  return ep_scan_fail(scan, err, "the file ends too early: %s is missing", what);
}

// Each line begins with its number: 0 or 1 first, then counting up.
static ep_status read_number(ep_scan *line, const char *what, int i, int *base, ep_error *err) {
  int number;
  EP_TRY(ep_scan_int(line, what, 0, INT_MAX, &number, err));
  if (i == 0) *base = number;
  if (*base > 1)
    return ep_scan_fail(line, err, "%s is %d, but numbers begin at 0 or 1", what, number);
  if (number != *base + i)
    return ep_scan_fail(line, err, "%s is %d, but %d comes next", what, number, *base + i);
  return EP_OK;
}

static ep_status optional_int(ep_scan *line, const char *what, int high, int *out, ep_error *err) {
  *out = 0;
  return ep_scan_peek(line).length ? ep_scan_int(line, what, 0, high, out, err) : EP_OK;
}

static ep_status read_nodes(ep_raw_mesh *raw, ep_scan *scan, int *base, ep_error *err) {
  ep_scan line;
  int count, dimension, attributes, markers;
  EP_TRY(need_line(scan, "the number of vertices", &line, err));
  EP_TRY(ep_scan_int(&line, "the number of vertices", 0, EP_MESH_LIMIT, &count, err));
  EP_TRY(ep_scan_int(&line, "the dimension", 3, 3, &dimension, err));
  EP_TRY(optional_int(&line, "the number of attributes", COLUMNS_LIMIT, &attributes, err));
  EP_TRY(optional_int(&line, "the number of boundary markers", 1, &markers, err));
  EP_TRY(ep_scan_expect_end(&line, err));
  for (int i = 0; i < count; i++) {
    double x[3];
    EP_TRY(need_line(scan, "a vertex", &line, err));
    EP_TRY(read_number(&line, "the vertex number", i, base, err));
    EP_TRY(ep_scan_doubles(&line, "a coordinate", 3, x, err));
    EP_TRY(ep_scan_skip_numbers(&line, attributes + markers, "an attribute", err));
    EP_TRY(ep_scan_expect_end(&line, err));
    EP_TRY(ep_raw_vertex(raw, x, err));
  }
  return EP_OK;
}

static ep_status read_tets(ep_raw_mesh *raw, ep_scan *scan, int base, ep_error *err) {
  ep_scan line;
  int count, corners, attributes, element_base = 0;
  EP_TRY(need_line(scan, "the number of tets", &line, err));
  EP_TRY(ep_scan_int(&line, "the number of tets", 0, EP_MESH_LIMIT, &count, err));
  EP_TRY(ep_scan_int(&line, "the number of vertices of a tet", 4, QUADRATIC_TET, &corners, err));
  EP_TRY(optional_int(&line, "the number of attributes", COLUMNS_LIMIT, &attributes, err));
  EP_TRY(ep_scan_expect_end(&line, err));
  if (corners != 4)
    return ep_scan_fail_as(&line, EP_ERR_MESH, err,
                           "tets of %d vertices; export linear (4-node) tets, in TetGen without "
                           "the switch -o2",
                           corners);
  for (int e = 0; e < count; e++) {
    int tet[4];
    EP_TRY(need_line(scan, "a tet", &line, err));
    EP_TRY(read_number(&line, "the tet number", e, &element_base, err));
    for (int i = 0; i < 4; i++) {
      EP_TRY(ep_scan_int(&line, "a vertex of the tet", base, raw->nv - 1 + base, tet + i, err));
      tet[i] -= base;
    }
    EP_TRY(ep_scan_skip_numbers(&line, attributes, "an attribute", err));
    EP_TRY(ep_scan_expect_end(&line, err));
    EP_TRY(ep_raw_tet(raw, tet, err));
  }
  return EP_OK;
}

// Anything but comments after the last line that was announced.
static ep_status expect_end(ep_scan *scan, ep_error *err) {
  ep_scan line;
  if (!ep_scan_line(scan, &line)) return EP_OK;
  return ep_scan_fail(&line, err, "more lines than the file's first line says");
}

static ep_status node_path(const char *ele, const char *folder, char path[EP_PATH_MAX],
                           ep_error *err) {
  char stem[EP_PATH_MAX], name[EP_PATH_MAX + 8];
  EP_TRY(ep_path_stem(ele, stem, err));
  snprintf(name, sizeof name, "%s.node", stem);
  return ep_path_join(folder, name, path, err);
}

static ep_status read_node_file(ep_raw_mesh *raw, const char *ele, const char *folder, int *base,
                                ep_error *err) {
  char path[EP_PATH_MAX], *bytes;
  size_t size;
  EP_TRY(node_path(ele, folder, path, err));
  ep_status status = ep_file_read(path, &bytes, &size, err);
  if (status != EP_OK) {
    if (err) ep_fail_context(err, "%s needs the .node file beside it", ele);
    return status;
  }
  ep_scan scan = ep_scan_open(path, bytes, size, '#');
  status = read_nodes(raw, &scan, base, err);
  if (status == EP_OK) status = expect_end(&scan, err);
  free(bytes);
  return status;
}

ep_status ep_read_tetgen(ep_raw_mesh *raw, ep_scan scan, const char *folder, ep_error *err) {
  int base = 0;
  scan.comment = '#';
  if (folder)
    EP_TRY(read_node_file(raw, scan.name, folder, &base, err));
  else
    EP_TRY(read_nodes(raw, &scan, &base, err));
  EP_TRY(read_tets(raw, &scan, base, err));
  return expect_end(&scan, err);
}
