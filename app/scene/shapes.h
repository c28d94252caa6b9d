// The meshes of a scene, read and checked, and how they relate.
#ifndef EP_APP_SCENE_SHAPES_H
#define EP_APP_SCENE_SHAPES_H

#include "app/scene/scene.h"
#include "base/files.h"

// How an example's displacement gets onto the object's mesh.
typedef enum ep_route {
  EP_ROUTE_SAME, // the pose has the object's connectivity: read directly
  EP_ROUTE_MAP,  // descriptors through point maps, LB-ARAP
} ep_route;

typedef struct ep_shape_file {
  ep_mesh mesh;
  ep_digest geometry; // hash of positions, tets and file vertex numbers
  char name[80];      // "object", "cylinder/rest", "cylinder/cylinder-twist"
  bool needs_lb;      // an LB space is needed
} ep_shape_file;

typedef struct ep_pose_source {
  int family, index; // of the pose in the family
  int shape, rest;   // shape numbers; rest 0: the object's own rest shape
  ep_route route;
  bool rest_same; // rest and object share the connectivity: the map is the identity
  bool pose_same; // pose and rest share the connectivity
  int set;        // of the examples that act together on the LB path
} ep_pose_source;

typedef struct ep_shapes {
  int count;
  ep_shape_file *shape; // (count), 0 is the object
  int *rest;            // (families) shape number of each family's rest, 0: the object
  int examples;
  ep_pose_source *example; // (examples) in order of the scene
  int nfixed, *fixed;      // ascending vertices of the object
  int regions;
  double **region; // (scene regions) weight of each vertex in [0, 1]; NULL: no family acts there
  // Sets of examples of the LB path: those that act everywhere first, then each region with a
  // family, in order of the scene. 0 where no family has a region: one set, acting everywhere.
  int sets, *set; // (sets) number of the scene's region, -1: everywhere
  int nmaterials; // constants to use (scene before mesh file, with the scene's change)
  ep_elastic *material;
  ep_digest physics; // hash of material model, constants and their place
} ep_shapes;

// Read all meshes. Errors: those of the readers; EP_ERR_MESH for degenerate tets or an object in
// several pieces; EP_ERR_SCENE without material constants or with nothing to fit a selection.
// scene is borrowed as long as shapes live.
ep_status ep_shapes_read(const ep_scene *scene, ep_log *log, ep_shapes *out, ep_error *err);
void ep_shapes_free(ep_shapes *shapes);

// Weights of the vertices in the region of a set (nv of the object); NULL: everywhere.
const double *ep_shapes_set_weight(const ep_shapes *shapes, int set);
// LB functions of its descriptor.
int ep_shapes_set_functions(const ep_scene *scene, const ep_shapes *shapes, int set);
// The region an example's pose is limited to on the LB path; NULL: none.
const double *ep_shapes_local(const ep_shapes *shapes, const ep_pose_source *example);

// Density of every tet [kg/m^3] lumped: mass of each vertex [kg], into mass (nv of the object).
void ep_shapes_vertex_mass(const ep_shapes *shapes, double *mass);

#endif
