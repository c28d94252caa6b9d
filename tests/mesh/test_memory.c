// Each allocation of reading, copying and extracting the surface is made to fail once: the status
// is EP_ERR_MEMORY (or the file's own error wins), nothing is left half made, nothing leaks where
// the sanitizer looks. The linker sends malloc, calloc and realloc of the library through here.
#include "mesh/repair.h"
#include "mesh/topology.h"
#include "tests/mesh/bytes.h"

void *__real_malloc(size_t size);
void *__real_calloc(size_t count, size_t size);
void *__real_realloc(void *old, size_t size);
void *__wrap_malloc(size_t size);
void *__wrap_calloc(size_t count, size_t size);
void *__wrap_realloc(void *old, size_t size);

static long until_failure = -1; // allocations still to succeed; negative: all do

static bool fails(void) {
  if (until_failure < 0) return false;
  return until_failure-- == 0;
}

void *__wrap_malloc(size_t size) {
  return fails() ? NULL : __real_malloc(size);
}

void *__wrap_calloc(size_t count, size_t size) {
  return fails() ? NULL : __real_calloc(count, size);
}

void *__wrap_realloc(void *old, size_t size) {
  return fails() ? NULL : __real_realloc(old, size);
}

static const struct {
  ep_mesh_format format;
  const char *text;
} meshes[] = {
    {EP_MESH_VEG, "*VERTICES\n4 3\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n*ELEMENTS\nTET\n1 4 0\n"
                  "1 1 2 3 4\n*MATERIAL m\nENU, 1, 1, 0\n*SET s\n1\n*REGION\ns, m\n"},
    {EP_MESH_MSH, "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n9 0 0 1\n1 0 0 0\n2 1 0 0\n"
                  "3 0 1 0\n$EndNodes\n$Elements\n1\n1 4 0 1 2 3 9\n$EndElements\n"},
    {EP_MESH_VTK, "# vtk DataFile Version 4.2\nt\nASCII\nDATASET UNSTRUCTURED_GRID\n"
                  "POINTS 4 double\n0 0 0 1 0 0 0 1 0 0 0 1\nCELLS 1 5\n4 0 1 2 3\n"
                  "CELL_TYPES 1\n10\nPOINT_DATA 4\nSCALARS part int\nLOOKUP_TABLE default\n"
                  "0 1 1 2\nVECTORS v int\n1 1 1 1 1 1 1 1 1 1 1 1\n"},
    {EP_MESH_MEDIT, "MeshVersionFormatted 2\nDimension 3\nVertices 4\n0 0 0 0\n1 0 0 0\n0 1 0 0\n"
                    "0 0 1 0\nTetrahedra 1\n1 2 3 4 0\nEnd\n"},
    {EP_MESH_TETGEN, "4 3\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n1 4\n1 1 2 3 4\n"},
    {EP_MESH_VTU,
     "<VTKFile type='UnstructuredGrid' compressor='vtkZLibDataCompressor'><Piece "
     "NumberOfPoints='4' NumberOfCells='1'><PointData><DataArray type='UInt8' Name='part' "
     "format='binary'>AQAAAAQAAAAAAAAADAAAAA==eJxjZGJmAQAAGAAL</DataArray></PointData><Points>"
     "<DataArray type='Int32' NumberOfComponents='3'>0 0 0 1 0 0 0 1 0 0 0 1</DataArray></Points>"
     "<Cells><DataArray type='Int32' Name='connectivity'>0 1 2 3</DataArray><DataArray "
     "type='Int32' Name='offsets'>4</DataArray><DataArray type='UInt8' Name='types'>10"
     "</DataArray></Cells></Piece></VTKFile>"},
};

static ep_status examine(const ep_mesh *m, ep_error *err) {
  ep_mesh_topology topology;
  ep_mesh_repairs repairs = {.largest_only = true};
  ep_mesh repaired;
  EP_TRY(ep_mesh_examine(m, &topology, err));
  EP_TRY(ep_mesh_repair(m, &repairs, &repaired, NULL, err));
  ep_mesh_free(&repaired);
  return EP_OK;
}

// Parse, copy, surface, examine, repair; on failure everything made so far is freed.
static ep_status chain(size_t which, ep_error *err) {
  ep_mesh m, copy;
  int count, *triangle;
  EP_TRY(ep_mesh_parse(meshes[which].format, "memory", meshes[which].text,
                       strlen(meshes[which].text), NULL, &m, NULL, err));
  ep_status status = ep_mesh_copy(&m, &copy, err);
  if (status == EP_OK) {
    status = ep_mesh_surface(&copy, &count, &triangle, err);
    free(triangle);
    if (status == EP_OK) status = examine(&copy, err);
    ep_mesh_free(&copy);
  }
  ep_mesh_free(&m);
  return status;
}

static void every_allocation_may_fail(void **state) {
  (void)state;
  for (size_t which = 0; which < sizeof meshes / sizeof *meshes; which++) {
    long failed_at = 0;
    for (;; failed_at++) {
      ep_error err = {0};
      until_failure = failed_at;
      const ep_status status = chain(which, &err);
      const bool all_done = until_failure >= 0;
      until_failure = -1;
      if (all_done) {
        assert_ok(status, &err);
        break;
      }
      if (status != EP_ERR_MEMORY)
        fail_msg("format %zu, allocation %ld: %s '%s'", which, failed_at, ep_status_name(status),
                 err.text);
    }
    assert_true(failed_at >= 15); // the chain really allocates
  }
}

static void make_may_fail_too(void **state) {
  (void)state;
  long failed_at = 0;
  for (;; failed_at++) {
    ep_mesh m;
    ep_error err = {0};
    until_failure = failed_at;
    const ep_status status = ep_mesh_make(8, cube_x, 6, cube_tet, "cube", &m, NULL, &err);
    const bool all_done = until_failure >= 0;
    until_failure = -1;
    if (all_done) {
      assert_ok(status, &err);
      ep_mesh_free(&m);
      break;
    }
    assert_int_equal(status, EP_ERR_MEMORY);
    assert_null(m.x);
  }
  assert_true(failed_at >= 8);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(every_allocation_may_fail),
      cmocka_unit_test(make_may_fail_too),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
