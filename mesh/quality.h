// Shape of tets: dihedral angles and radius ratios, and the worst ones by name.
#ifndef EP_MESH_QUALITY_H
#define EP_MESH_QUALITY_H

#include <stddef.h>

#include "mesh/mesh.h"

// A tet is called a sliver where a dihedral angle is below this, or the largest above 180 less this
// (degrees). Stiffness grows as the cotangent of the angle: 1 degree is a factor of 40 against a
// regular tet (70.5 degrees).
#define EP_SLIVER_DEGREES 1.0

typedef struct ep_tet_shape {
  double low, high;    // smallest and largest dihedral angle [degrees]
  double radius_ratio; // 3 r / R of the inscribed and circumscribed spheres: 1 regular, 0 flat
} ep_tet_shape;
// At corners x (4 x 3). A flat or collapsed tet: low 0, high 180, ratio 0.
ep_tet_shape ep_shape_of_tet(const double *x);

enum { EP_WORST_TETS = 5 };
typedef struct ep_mesh_quality {
  double low, high;    // over all tets [degrees]
  double radius_ratio; // lowest, and
  double mean_ratio;   // mean
  int slivers;
  int worst_count;          // at most EP_WORST_TETS, all slivers:
  int worst[EP_WORST_TETS]; // tets, worst first
  ep_tet_shape worst_shape[EP_WORST_TETS];
} ep_mesh_quality;
void ep_mesh_measure(const ep_mesh *mesh, ep_mesh_quality *out);
// The worst tets in words: "tet 12 (0.05 to 179.9 degrees), ..", numbers from 1.
void ep_mesh_worst_text(const ep_mesh_quality *quality, char *text, size_t size);

#endif
