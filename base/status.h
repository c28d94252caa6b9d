// Status codes shared by the run time and the offline part. Header only, no dependencies.
#ifndef EP_BASE_STATUS_H
#define EP_BASE_STATUS_H

typedef enum ep_status {
  EP_OK = 0,
  EP_ERR_ARGUMENT,    // the caller passed something the function does not accept
  EP_ERR_IO,          // a file could not be opened, read, written or renamed
  EP_ERR_FORMAT,      // a file is not what its format demands (message: file and line or offset)
  EP_ERR_MESH,        // a mesh cannot be used (message: element or vertex)
  EP_ERR_SCENE,       // a scene is contradictory or incomplete (message: key, line)
  EP_ERR_MATCH,       // shapes cannot be mapped to each other well enough
  EP_ERR_NUMERIC,     // a solver failed or did not converge; outputs are unchanged
  EP_ERR_MEMORY,      // out of memory
  EP_ERR_UNSUPPORTED, // valid, but not something this version can do
  EP_STATUS_COUNT
} ep_status;

#endif
