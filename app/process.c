#include "app/process.h"

#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/files.h"

static ep_status find_baker(char *path, ep_error *err) {
  char self[EP_PATH_MAX], folder[EP_PATH_MAX];
  const ssize_t length = readlink("/proc/self/exe", self, sizeof self - 1);
  if (length < 0)
    return ep_fail(err, EP_ERR_IO, "cannot find this program: /proc/self/exe: %s", strerror(errno));
  self[length] = '\0';
  EP_TRY(ep_path_folder(self, folder, err));
  // In the build tree, and installed as bin/eigenpose.
  static const char *const places[] = {"libexec/eigenpose-bake",
                                       "../libexec/eigenpose/eigenpose-bake"};
  for (size_t i = 0; i < sizeof places / sizeof *places; i++) {
    EP_TRY(ep_path_join(folder, places[i], path, err));
    if (access(path, X_OK) == 0) return EP_OK;
  }
  return ep_fail(err, EP_ERR_IO,
                 "the baker is missing: neither %s/libexec/eigenpose-bake nor "
                 "%s/../libexec/eigenpose/eigenpose-bake can be run; build the target "
                 "eigenpose-bake or keep the two programs together",
                 folder, folder);
}

ep_status ep_baker_become(char **argv, ep_error *err) {
  char path[EP_PATH_MAX];
  EP_TRY(find_baker(path, err));
  fflush(NULL);
  execv(path, argv);
  return ep_fail(err, EP_ERR_IO, "cannot run %s: %s", path, strerror(errno));
}

static _Noreturn void child(const char *path, const ep_cli *cli, int output, pid_t parent) {
  const char *argv[2 * EP_SETS_MAX + 16];
  // Nobody waits for a bake whose run was killed.
  if (prctl(PR_SET_PDEATHSIG, SIGTERM) != 0 || getppid() != parent) _exit(EP_ERR_IO);
  int n = 0;
  argv[n++] = path;
  argv[n++] = "bake";
  argv[n++] = "--json";
  argv[n++] = "--served";
  if (cli->quiet) argv[n++] = "--quiet";
  if (cli->cache) {
    argv[n++] = "--cache";
    argv[n++] = cli->cache;
  }
  for (int i = 0; i < cli->nsets; i++) {
    argv[n++] = "--set";
    argv[n++] = cli->set[i];
  }
  argv[n++] = "--";
  argv[n++] = cli->input;
  argv[n] = NULL;
  if (dup2(output, STDOUT_FILENO) >= 0) execv(path, (char **)argv);
  fprintf(stderr, "eigenpose: cannot run %s: %s\n", path, strerror(errno));
  _exit(EP_ERR_IO);
}

// The text of a failed baker, from the object it printed.
static ep_status pass_on(const json_t *report, int wait_status, ep_error *err) {
  const json_t *failure = json_object_get(report, "error");
  const char *message = json_string_value(json_object_get(failure, "message"));
  const int code = WIFEXITED(wait_status) ? WEXITSTATUS(wait_status) : 0;
  if (message && code > EP_OK && code < EP_STATUS_COUNT)
    return ep_fail(err, (ep_status)code, "%s", message);
  if (WIFSIGNALED(wait_status))
    return ep_fail(err, EP_ERR_NUMERIC, "the baker was ended by signal %d (%s)",
                   WTERMSIG(wait_status), strsignal(WTERMSIG(wait_status)));
  return ep_fail(err, EP_ERR_NUMERIC, "the baker failed with exit code %d", code);
}

ep_status ep_baker_run(const ep_cli *cli, json_t **report, ep_error *err) {
  char path[EP_PATH_MAX];
  int ends[2];
  *report = NULL;
  EP_TRY(find_baker(path, err));
  fflush(NULL);
  if (pipe(ends) != 0) return ep_fail(err, EP_ERR_IO, "no pipe: %s", strerror(errno));
  const pid_t self = getpid(), pid = fork();
  if (pid < 0) {
    close(ends[0]);
    close(ends[1]);
    return ep_fail(err, EP_ERR_IO, "cannot start %s: %s", path, strerror(errno));
  }
  if (pid == 0) {
    close(ends[0]);
    child(path, cli, ends[1], self);
  }
  close(ends[1]);
  json_error_t trouble;
  *report = json_loadfd(ends[0], 0, &trouble);
  close(ends[0]);
  int wait_status;
  while (waitpid(pid, &wait_status, 0) < 0)
    if (errno != EINTR) return ep_fail(err, EP_ERR_IO, "lost the baker: %s", strerror(errno));
  if (WIFEXITED(wait_status) && WEXITSTATUS(wait_status) == 0 && *report) return EP_OK;
  const ep_status status = pass_on(*report, wait_status, err);
  json_decref(*report);
  *report = NULL;
  return status;
}
