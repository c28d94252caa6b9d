// Random scenes over random solids: what is held, material, examples, reduction, integration,
// loads, obstacles. Everything in a scene has its place in the solid's own coordinates; written for
// a placement, all of it - meshes, examples, forces, obstacles - moves, turns, is renumbered and
// changes its unit together. Units of time stay: lengths u, Young's modulus u, density 1/u, hence
// forces u^3, pressures u, accelerations u, spring constants u^2.
#ifndef EP_TESTS_PROPERTIES_RANDOM_SCENE_H
#define EP_TESTS_PROPERTIES_RANDOM_SCENE_H

#include "reduced/eigenpose.h"
#include "tests/properties/random_mesh.h"

// What loads act on lies beyond this share of the length; no plane of vertices lies just there.
#define TIP_SHARE 0.81

enum { POSES_MOST = 2, FAMILIES_MOST = 2, LOADS_MOST = 3, OBSTACLES_MOST = 2 };

typedef enum selection_kind { BY_PLANE, BY_FILE, BY_FIELD } selection_kind;
typedef enum load_kind { LOAD_GRAVITY, LOAD_PUSH, LOAD_PRESSURE, LOAD_DRAG, LOAD_KINDS } load_kind;
typedef enum solid_obstacle { IS_PLANE, IS_SPHERE, IS_BOX } solid_obstacle;

typedef struct random_family {
  bool other; // of another lattice, with a rest shape of its own; else the object's mesh
  random_solid solid;
  placement beside; // where its rest shape stands (of another lattice), before the scene's
  int poses;
  random_pose pose[POSES_MOST];
  bool local, landmarks;
} random_family;

typedef struct random_load {
  load_kind kind;
  double vector[3]; // acceleration, force, way of a drag
  double size;      // pascal; stiffness of a drag
  double damping, until;
  bool part; // pressure: on the tip only
} random_load;

typedef struct random_obstacle {
  solid_obstacle kind;
  double point[3], normal[3], radius, friction, move[3];
  bool moves;
} random_obstacle;

typedef struct random_scene {
  uint64_t seed;
  bool tame; // nothing in it is extreme: it must run
  random_solid object;
  bool held, two_parts; // two_parts: the mesh is no single piece, which is to be refused
  selection_kind held_by;
  ep_material model;
  double young, density, poisson;
  int families;
  random_family family[FAMILIES_MOST];
  bool cubic, narrow;
  int eigenfunctions, modes, linear_modes, path_samples, elements, training, guards;
  ep_integrator integrator;
  double dt, damping_mass, damping_stiffness;
  int steps;
  const char *path, *solver, *force;
  double alpha, sum_to_one, non_negative, strength, relief, region_strength;
  int loads;
  random_load load[LOADS_MOST];
  int obstacles;
  random_obstacle obstacle[OBSTACLES_MOST];
  double spin[3], velocity[3], angle, axis[3];
  int formats;
  uint64_t off; // bits of the pieces left out (shrinking)
} random_scene;

// wild: share of the scenes that are not tame.
random_scene draw_scene(uint64_t seed, double wild);
// Placement for a scene: units a drag's stiffness can be written in.
placement draw_scene_placement(const random_scene *s, ep_random *rng);

// scene.yaml and its meshes into the folder, which is made. Returns the number of pieces a scene
// has that may be left out. to (nv of the object, or NULL): as in placed_mesh.
int write_scene(const random_scene *scene, const placement *at, const char *folder, int *to);

// Leaves out one piece after the other as long as the scene still fails; why: of what is left,
// which is in the folder at the end. fails: writes the scene into the folder, and says what fails.
void make_scene_smaller(random_scene *s, const char *folder,
                        bool (*fails)(const random_scene *s, const char *folder, char *why),
                        char *why);

#endif
