// Tetrahedral meshes: container, geometry, checks.
#ifndef EP_MESH_MESH_H
#define EP_MESH_MESH_H

#include <stdbool.h>

#include "base/error.h"
#include "base/log.h"

// Material constants of a part of a mesh (from .veg *MATERIAL ENU or from the scene).
typedef struct ep_elastic {
  double density; // kg/m^3
  double young;   // Pa
  double poisson; // in [0, 0.5)
} ep_elastic;

// An array on the vertices as it stands in the file: labels, painted weights, results. Only scalars
// are kept, of the others name and number of components.
typedef struct ep_point_data {
  char *name;
  int components;
  double *value; // (nv), NaN where the file says so; NULL where components != 1
} ep_point_data;

// Vertices no tet uses are left out on reading; file_vertex gives each vertex's place in the file
// (counted from 0), so that vertex lists made for the file can be translated. In Gmsh files, whose
// numbers may have gaps, the place is the number less 1 (less 0 if there is a vertex 0).
typedef struct ep_mesh {
  int nv, nt;
  double *x;            // (nv x 3) positions
  int *tet;             // (nt x 4) vertex indices from 0, positive volume
  int *file_vertex;     // (nv) ascending
  int file_vertices;    // number of places in the file: all file_vertex are below it
  int nmaterials;       // 0 where the file names none
  ep_elastic *material; // (nmaterials)
  int *tet_material;    // (nt) index into material; NULL where nmaterials == 0
  int ndata;            // arrays of the vertices (.vtk, .vtu)
  ep_point_data *data;  // (ndata)
  char name[256];       // file path, for messages
} ep_mesh;

enum { EP_UNREAD_MAX = 64 };
// What reading and checking found; all counts, first offender by index in the file, from 0.
typedef struct ep_mesh_findings {
  int repaired_orientation; // tets turned round
  int first_inverted;       // of these, -1 where none; counts all tets of the file
  int dropped_cells;        // cells that are not linear tets
  int unused_vertices, duplicate_vertices, degenerate_tets, components;
  int first_duplicate, first_degenerate, first_unused; // -1 where none
  int repeated_tets;  // tets with the same four vertices as an earlier one: left out
  int first_repeated; // -1 where none; first_degenerate and this count all tets of the file
  int unread_arrays; // of the vertices that are no numbers; in .vtk what follows is not read either
  char first_unread_array[EP_UNREAD_MAX];
} ep_mesh_findings;

// Takes ownership of nothing: copies x (nv x 3) and tet (nt x 4); turns inverted tets round, drops
// unused vertices, fills findings (may be NULL).
// Errors: EP_ERR_MESH for an index out of range, a NaN or infinite coordinate, no tets at all.
ep_status ep_mesh_make(int nv, const double *x, int nt, const int *tet, const char *name,
                       ep_mesh *out, ep_mesh_findings *findings, ep_error *err);
ep_status ep_mesh_copy(const ep_mesh *mesh, ep_mesh *out, ep_error *err);
void ep_mesh_free(ep_mesh *mesh);
void ep_point_data_free(ep_point_data *data, int count);
// The first array of that name, NULL where there is none.
const ep_point_data *ep_mesh_data(const ep_mesh *mesh, const char *name);

// Say the findings on the log, a line each; nothing for a clean mesh.
void ep_mesh_report(const ep_mesh *mesh, const ep_mesh_findings *findings, ep_log *log);

// Refuse a mesh no simulation can use: degenerate tets, more than one component where `whole`.
ep_status ep_mesh_require_sound(const ep_mesh *mesh, const ep_mesh_findings *findings, bool whole,
                                ep_error *err);

double ep_mesh_volume(const ep_mesh *mesh);
// Signed volume of tet e at positions x (nv x 3); of each tet, into volume (nt).
double ep_tet_volume(const ep_mesh *mesh, int e, const double *x);
void ep_tet_volumes(const ep_mesh *mesh, const double *x, double *volume);
// Number of tets with non-positive volume at positions x; *worst (may be NULL) the lowest ratio of
// deformed to rest volume.
int ep_mesh_inverted(const ep_mesh *mesh, const double *x, double *worst);
void ep_mesh_bounds(const ep_mesh *mesh, double low[3], double high[3]);
// Of the bounding box along the axes: for people and for tolerances. It changes as the mesh turns,
// a bar's by up to 40 %.
double ep_mesh_diagonal(const ep_mesh *mesh);
// The size that results go by (amplitudes, the contact's lengths): twice the largest distance of a
// vertex from the centroid. A box's is its diagonal. The same however the mesh stands, is turned
// and numbered, and from mesh to mesh of one solid as far as they have its corners. The volume must
// be positive.
double ep_mesh_extent(const ep_mesh *mesh);
// Volume-weighted centroid.
void ep_mesh_centroid(const ep_mesh *mesh, const double *x, double centroid[3]);
// Volume lumped to vertices (a quarter of each tet), into v (nv).
void ep_mesh_vertex_volumes(const ep_mesh *mesh, double *v);
// Gradients of the four linear shape functions of tet e at rest, into g (4 x 3). Returns volume.
double ep_tet_gradients(const ep_mesh *mesh, int e, double g[12]);
// Equal but for tets turned round on reading (a pose may hold inverted ones).
bool ep_mesh_same_connectivity(const ep_mesh *a, const ep_mesh *b);

// Boundary triangles, outward: *count and *triangle (count x 3, malloc) in mesh order.
ep_status ep_mesh_surface(const ep_mesh *mesh, int *count, int **triangle, ep_error *err);

// Translate a vertex number of the file (from 0) to a vertex of the mesh, -1 where it is unused.
int ep_mesh_from_file_vertex(const ep_mesh *mesh, int file_vertex);

#endif
