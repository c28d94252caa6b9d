// Writes the seeds of the model target into a folder: small whole models of this version, so that
// the corpus follows the format. fuzz_model_seeds FOLDER
#include <stdio.h>

#include "base/files.h"
#include "reduced/bake/tensor_write.h"
#include "tests/reduced/bar.h"

static const struct {
  const char *name;
  int r, s, m, k;
  ep_material material;
} seeds[] = {
    {"good-plain", 2, 2, 0, 0, EP_STVK_VOLUME},
    {"good-neohookean-examples", 2, 2, 1, 1, EP_STABLE_NEOHOOKEAN},
    {"good-corotational", 3, 1, 1, 1, EP_COROTATIONAL},
    {"good-stvk-two-examples", 2, 1, 1, 2, EP_STVK},
};

static ep_status write_all(const char *folder, ep_error *err) {
  char path[EP_PATH_MAX];
  const ep_metadata meta = {"scene", "bar"};
  EP_TRY(ep_make_folders(folder, err));
  for (size_t i = 0; i < sizeof seeds / sizeof *seeds; i++) {
    bar *b = bar_create(1, 1, 1, seeds[i].r, seeds[i].s, seeds[i].m, seeds[i].k, seeds[i].material);
    ep_status status = ep_path_join(folder, seeds[i].name, path, err);
    if (status == EP_OK) status = ep_model_write(path, &b->model, 1, &meta, err);
    bar_free(b);
    if (status != EP_OK) return status;
  }
  return EP_OK;
}

int main(int argc, char **argv) {
  ep_error err = {0};
  if (argc == 2 && write_all(argv[1], &err) == EP_OK) return 0;
  fprintf(stderr, "%s\n", argc == 2 ? err.text : "fuzz_model_seeds FOLDER");
  return 1;
}
