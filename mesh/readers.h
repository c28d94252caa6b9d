// The readers behind ep_mesh_parse (private to mesh/). Each fills raw from bytes; on failure the
// caller frees raw. `folder` may be NULL: then nothing but the bytes is looked at.
#ifndef EP_MESH_READERS_H
#define EP_MESH_READERS_H

#include "mesh/raw.h"
#include "mesh/scan.h"

ep_status ep_read_veg(ep_raw_mesh *raw, ep_scan scan, const char *folder, ep_error *err);
ep_status ep_read_msh(ep_raw_mesh *raw, ep_scan scan, ep_error *err);
ep_status ep_read_vtk(ep_raw_mesh *raw, ep_scan scan, ep_error *err);
ep_status ep_read_vtu(ep_raw_mesh *raw, ep_scan scan, ep_error *err);
ep_status ep_read_medit(ep_raw_mesh *raw, ep_scan scan, ep_error *err);
// scan: the .ele, its .node beside it in folder; or, without folder, .node and .ele in one.
ep_status ep_read_tetgen(ep_raw_mesh *raw, ep_scan scan, const char *folder, ep_error *err);

#endif
