// `eigenpose check`: what is wrong with meshes and scenes, where, and what to do.
#ifndef EP_APP_CHECK_CHECK_H
#define EP_APP_CHECK_CHECK_H

#include "app/cli.h"
#include "app/scene/scene.h"
#include "mesh/quality.h"
#include "mesh/repair.h"
#include "mesh/topology.h"

// Exit code where errors are found; warnings do not fail (README "Exit codes").
enum { EP_EXIT_FOUND = 10 };

typedef enum ep_severity {
  EP_FOUND_ERROR,   // a bake refuses it, or its result means nothing
  EP_FOUND_WARNING, // it works, but not well, or not as meant
  EP_FOUND_NOTE     // worth knowing
} ep_severity;

typedef struct ep_found {
  ep_severity severity;
  const char *code; // "sliver", "unused-vertices", ..: static
  char file[256];
  bool repairable; // by --repair
  char text[600];  // what, where, what to do
} ep_found;

// One mesh, looked at. `read` false: it could not be made a mesh, a finding says why.
typedef struct ep_checked_mesh {
  char file[256];
  bool read;
  ep_mesh mesh;
  ep_mesh_findings findings;
  ep_mesh_quality quality;
  ep_mesh_topology topology;
} ep_checked_mesh;

typedef struct ep_check {
  int nfound, room_found;
  ep_found *found;
  int nmeshes, room_meshes;
  ep_checked_mesh *mesh;
} ep_check;
void ep_check_free(ep_check *check);
int ep_check_count(const ep_check *check, ep_severity severity);

// Add a finding. Errors: EP_ERR_MEMORY.
ep_status ep_check_add(ep_check *check, ep_severity severity, const char *code, const char *file,
                       bool repairable, ep_error *err, const char *format, ...)
    __attribute__((format(printf, 7, 8)));

// Read a mesh and look at it by itself; *number (may be NULL) is its place in check->mesh.
// Errors: EP_ERR_IO, EP_ERR_MEMORY; what is wrong with the file is a finding.
ep_status ep_check_mesh_file(ep_check *check, const char *path, int *number, ep_error *err);
// The same for a mesh in memory, which is moved into the check.
ep_status ep_check_mesh_take(ep_check *check, const char *file, ep_mesh *mesh,
                             const ep_mesh_findings *findings, int *number, ep_error *err);

// All meshes of a scene and how they fit it and each other: material, fixed vertices, examples.
// Errors: those of reading the scene; EP_ERR_IO, EP_ERR_MEMORY.
ep_status ep_check_scene(ep_check *check, const ep_scene *scene, ep_error *err);

// The command. *found_errors: whether it is to end with EP_EXIT_FOUND.
ep_status ep_command_check(const ep_cli *cli, bool *found_errors, ep_error *err);

#endif
