// The scene, complete: defaults filled in, values checked, paths resolved (docs/scene.md).
#ifndef EP_APP_SCENE_SCENE_H
#define EP_APP_SCENE_SCENE_H

#include <stdbool.h>
#include <stdint.h>

#include "app/scene/motion.h"
#include "base/error.h"
#include "mesh/mesh.h"
#include "reduced/eigenpose.h"

// How examples act: shape interpolation in descriptor space, Green-strain potential. Bits.
enum { EP_METHOD_LB = 1, EP_METHOD_GREEN = 2, EP_PATHS = 3 };
// "lb", "green", "both"; "none" for 0.
const char *ep_path_name(int methods);
typedef enum ep_solver { EP_SOLVER_NLOPT, EP_SOLVER_NEWTON } ep_solver;
enum { EP_MOMENTS_MAX = 24 };
enum { EP_FORMAT_VTU = 1, EP_FORMAT_GLB = 2, EP_FORMAT_PNG = 4 }; // bits of ep_scene.formats

typedef enum ep_select {
  EP_SELECT_BOX,
  EP_SELECT_PLANE,
  EP_SELECT_FILE,
  EP_SELECT_FIELD
} ep_select;
// Which vertices: inside a closed box, behind or on a plane, listed in a file, or by an array of
// the mesh file on its vertices.
typedef struct ep_selection {
  ep_select kind;
  double a[3], b[3]; // box: low, high; plane: point, normal
  char *path;        // file; name of the array
  double value;      // of the array: chosen above it, or where it is that
  bool equals;
  char key[232]; // where it stands: "bar.yaml:7:5: fixed.0", for messages
} ep_selection;

// A part of the object where examples act: weight 1 on `where`, falling smoothly to 0 over the
// distance `soft` around it (app/scene/regions.h).
typedef struct ep_scene_region {
  char *name;
  ep_selection where;
  double soft;        // [length], 0: a hard edge
  int eigenfunctions; // m of its descriptor
  double strength;    // factor of examples.strength
} ep_scene_region;

typedef enum ep_map_frame { EP_FRAME_AUTOMATIC, EP_FRAME_AUTHORED } ep_map_frame;
// Where a landmark is on one shape: a vertex of the file (from 1), or a point where vertex is 0;
// or not given.
typedef struct ep_mark {
  bool given;
  int vertex;
  double at[3];
} ep_mark;
typedef struct ep_scene_landmark {
  ep_mark object, rest;
  int poses;
  ep_mark *pose; // (poses)
} ep_scene_landmark;

// An array on the vertices that marks corresponding parts of the shapes of a family: its name in
// the file of each. poses NULL: used between the rest shape and the poses that carry rest's name.
typedef struct ep_map_field {
  char *object, *rest, *poses;
} ep_map_field;

typedef struct ep_family {
  char *name;
  char *rest; // NULL: poses are of the object's own rest shape
  int poses;
  char **pose;   // (poses)
  char *regions; // NULL: automatic map, or by
  int fields;    // arrays of the meshes
  ep_map_field *field;
  int landmarks;
  ep_scene_landmark *landmark;
  ep_map_frame frame;
  bool reflections;   // mirrored frames are tried too
  int eigenfunctions; // of its maps
  bool accept;        // go on with a bad map
  int region;         // where the poses act, number in ep_scene.region; -1: everywhere
} ep_family;

typedef struct ep_load {
  bool gravity; // acceleration [m/s^2] on everything; else a total force [N] on `where`
  double vector[3];
  ep_selection where;
  double from, until, ramp; // [s]
} ep_load;

// Pressure on the surface, from outside where positive.
typedef struct ep_scene_pressure {
  bool selected; // else the whole surface
  ep_selection where;
  double pascal, from, until, ramp; // [Pa], [s]
} ep_scene_pressure;

// A damped spring that drags the centre of some vertices along a path.
typedef struct ep_scene_drag {
  ep_selection where;
  ep_motion_path path;       // `move` of its keyframes: where to, in the world
  double stiffness, damping; // [N/m], [N s/m]
  double from, until;        // [s]
} ep_scene_drag;

// A plane, sphere or box in the way, moving or not.
typedef struct ep_scene_obstacle {
  ep_obstacle_kind kind;
  double size[3]; // as in reduced/obstacle.h
  double friction;
  ep_frame at; // where it stands at first
  ep_motion_path motion;
  char place[136]; // in the file (":12:5: obstacles.0") or of --set: for messages
} ep_scene_obstacle;

// What `eigenpose compare` sweeps (docs/scene.md).
typedef enum ep_method {
  EP_METHOD_CUBATURE, // reduced, s trained elements
  EP_METHOD_CUBIC,    // reduced, exact polynomials (StVK)
  EP_METHOD_ALL,      // reduced, all elements
  EP_METHOD_FULL,     // full space
  EP_METHODS
} ep_method;
const char *ep_method_name(ep_method method); // "cubature", "cubic", "all", "full"

enum { EP_LIST_MAX = 16 };
typedef struct ep_sweep {
  int nmodes, modes[EP_LIST_MAX], nelements, elements[EP_LIST_MAX];
  int nmethods, nmaterials, nsolvers, ndt, nprecisions, npaths;
  int path[EP_PATHS]; // EP_METHOD bits
  ep_green green;     // where a path is green
  int precision[2];   // ep_precision, of the cubic polynomials
  ep_method method[EP_METHODS];
  ep_material material[EP_MATERIALS];
  char solver[EP_LIST_MAX][48];        // "newton" or NLopt's name of an algorithm
  double dt[EP_LIST_MAX];              // [s] descending
  ep_method reference;                 // EP_METHOD_FULL or EP_METHOD_ALL
  double budget_seconds, budget_error; // 0: none
} ep_sweep;

// How a free object starts; centre of mass and axes as in reduced/frame.h.
typedef struct ep_start {
  bool placed;                 // position is given; else where the mesh is
  double position[3];          // of the centre of mass
  ep_turn rotation;            // about it
  double velocity[3], spin[3]; // [m/s], [rad/s], world axes
} ep_start;

// A change of all material constants, wherever they come from and of every part (`eigenpose
// stress`); 0: as they are.
typedef struct ep_elastic_change {
  double density, young; // factors
  bool sets_poisson;
  double poisson; // instead
} ep_elastic_change;

typedef struct ep_scene {
  char *path, *name;
  uint64_t seed;
  char *mesh;
  ep_material model;
  bool has_material; // else the mesh file's own constants
  ep_elastic material;
  ep_elastic_change change;
  int nfixed;
  ep_selection *fixed;
  int nregions; // named ones, then those given in families; equal ones are one
  ep_scene_region *region;
  int nfamilies;
  ep_family *family;
  ep_evaluator evaluator; // of the elastic energy: cubature, or cubic polynomials (StVK)
  int eigenfunctions, modes, linear_modes, path_samples, elements, guards;
  int training_poses;
  double amplitude;
  ep_integrator integrator;
  double dt;
  int steps;
  double damping_mass, damping_stiffness;
  double strength, relief;
  ep_example_force force;
  ep_solver solver;
  int methods;        // EP_METHOD bits
  ep_green green;     // alpha 0 without EP_METHOD_GREEN
  char algorithm[48]; // NLopt's name of it
  ep_start start;     // all zero for a held object
  int nloads;
  ep_load *load;
  int npressures;
  ep_scene_pressure *pressure;
  int ndrags;
  ep_scene_drag *drag;
  int nobstacles;
  ep_scene_obstacle *obstacle;
  ep_contact_def contact;
  int every;
  unsigned formats;
  int nmoments;                  // of the strip; 0: equally spaced ones
  double moment[EP_MOMENTS_MAX]; // [s]
  ep_sweep sweep;
} ep_scene;

// Read and check a scene; sets (nsets) are "key=value" overrides, checked like the file itself.
// Errors: EP_ERR_IO; EP_ERR_SCENE with file:line:column and the key. Missing mesh, region and
// vertex files are named here, before any work begins.
ep_status ep_scene_read(const char *path, int nsets, const char *const *sets, ep_scene *out,
                        ep_error *err);
// The same for text in memory; relative paths are looked up in `folder`.
ep_status ep_scene_parse(const char *path, const char *folder, const char *text, size_t size,
                         int nsets, const char *const *sets, ep_scene *out, ep_error *err);
void ep_scene_free(ep_scene *scene);

// Calls for every file the scene reads, itself first, until a call fails.
typedef ep_status ep_file_visit(void *user, const char *path, ep_error *err);
ep_status ep_scene_each_file(const ep_scene *scene, ep_file_visit *call, void *user, ep_error *err);

int ep_scene_examples(const ep_scene *scene); // poses of all families
bool ep_scene_local(const ep_scene *scene);   // some family acts in a region only

#endif
