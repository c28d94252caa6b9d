// A baked model (.epm) mapped into memory.
#ifndef EP_APP_PLAN_MODEL_FILE_H
#define EP_APP_PLAN_MODEL_FILE_H

#include <stdbool.h>

#include "base/log.h"
#include "reduced/bake/tensor_write.h"
#include "reduced/eigenpose.h"

typedef struct ep_model_file {
  ep_mapping mapping;
  ep_model model;
  double train_error, held_out_error; // of the cubature; NAN where the file does not say
} ep_model_file;

// Errors: EP_ERR_IO; EP_ERR_FORMAT with the path and what is wrong (truncated, foreign, future).
ep_status ep_model_file_open(const char *path, ep_model_file *out, ep_error *err);
void ep_model_file_close(ep_model_file *file);

// Is there a whole model? A broken one is said on the log.
bool ep_model_usable(const char *path, ep_log *log);

#endif
