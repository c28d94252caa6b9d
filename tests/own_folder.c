// Linked to every test: it works in a folder of its own in the build tree, wherever it is started.
// Tests write and remove files by plain names.
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

__attribute__((constructor)) static void enter_own_folder(void) {
  if (chdir(EP_TEST_FOLDER) == 0) return;
  perror(EP_TEST_FOLDER);
  exit(1);
}
