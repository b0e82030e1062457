/// A motion as a video: the result's page, its scene alone, is stepped through by a headless Chromium, which
/// leaves its pictures as text in the page; ffmpeg makes the file of them. Neither is a part of the build: where one is
/// missing the error names its package.
#define _XOPEN_SOURCE 700 // nftw
#define _DEFAULT_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <ftw.h>
#include <math.h>
#include <spawn.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "exchange.h"
#include "file.h"

extern char **environ;

enum { PATH_ROOM = 4200 };

static const char before[] =
    "<script>"
    // a page whose text is asked for is shown no frames; and a picture is read after it was drawn
    "window.requestAnimationFrame=draw=>setTimeout(()=>draw(performance.now()),16);{const "
    "own=HTMLCanvasElement.prototype.getContext;HTMLCanvasElement.prototype.getContext=function(kind,asked){"
    "return own.call(this,kind,/webgl/.test(kind)?{...asked,preserveDrawingBuffer:true}:asked);};}</script>";
static const char after[] =
    "<script>(async()=>{const next=()=>new Promise(requestAnimationFrame);"
    "const see=time=>{history.replaceState(null,'','#bare&t='+time);dispatchEvent(new Event('hashchange'));};"
    "see(0);await next();await next();"
    "const stage=document.querySelector('#stage canvas'),paper=document.createElement('canvas'),lines=[];"
    "if(stage){paper.width=stage.clientWidth&~1;paper.height=stage.clientHeight&~1;const pen=paper.getContext('2d');"
    "for(let i=0;i<COUNT;i++){see(i*STEP);await next();await "
    "next();pen.fillStyle=getComputedStyle(document.body).backgroundColor;"
    "pen.fillRect(0,0,paper.width,paper.height);pen.drawImage(stage,0,0,paper.width,paper.height);"
    "lines.push(paper.toDataURL('image/jpeg',0.92));}}"
    "const all=document.createElement('pre');all.textContent=lines.join('\\n');document.body.replaceChildren(all);"
    "})();</script>";

// runs a program with its output in files; its exit status, 127 if there is no such program
static int run(char *const *argument, const char *output, const char *complaints) {
  posix_spawn_file_actions_t to;
  pid_t child;
  int how = 0, flags = O_WRONLY | O_CREAT | O_TRUNC;
  posix_spawn_file_actions_init(&to);
  posix_spawn_file_actions_addopen(&to, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&to, STDOUT_FILENO, output, flags, 0666);
  posix_spawn_file_actions_addopen(&to, STDERR_FILENO, complaints, flags, 0666);
  int failed = posix_spawnp(&child, argument[0], &to, NULL, argument, environ);
  posix_spawn_file_actions_destroy(&to);
  if (failed) return 127;
  while (waitpid(child, &how, 0) < 0)
    if (errno != EINTR) return 126;
  return WIFEXITED(how) ? WEXITSTATUS(how) : 128;
}

static char *read_all(const char *path, size_t *length) {
  FILE *file = fopen(path, "rb");
  char *text = NULL;
  *length = 0;
  if (!file) return NULL;
  if (fseek(file, 0, SEEK_END) == 0) {
    long n = ftell(file);
    rewind(file);
    text = n >= 0 ? malloc((size_t)n + 1) : NULL;
    if (text) *length = fread(text, 1, (size_t)n, file), text[*length] = 0;
  }
  fclose(file);
  return text;
}

// the page with what steps it through
static cav_status write_page(const char *folder, const cav_recording *r, cav_error *error) {
  const cav_result *result = r->result;
  char path[PATH_ROOM], stepped[PATH_ROOM];
  size_t n = 0;
  cav_status status =
      cav_result_write_page(folder, result->problem, result->trajectory, &result->problem->contact, NULL, error);
  if (status) return status;
  snprintf(path, sizeof path, "%s/view.html", folder);
  snprintf(stepped, sizeof stepped, "%s/stepped.html", folder);
  char *page = read_all(path, &n), *head = page ? strstr(page, "<head>") : NULL;
  FILE *out = head ? fopen(stepped, "w") : NULL;
  int good = out != NULL;
  if (good) {
    head += strlen("<head>");
    fwrite(page, 1, (size_t)(head - page), out);
    fputs(before, out);
    fwrite(head, 1, n - (size_t)(head - page), out);
    for (const char *c = after; *c; c++) {
      if (!strncmp(c, "COUNT", 5))
        fprintf(out, "%d", r->n), c += 4;
      else if (!strncmp(c, "STEP", 4))
        fprintf(out, "%.9g", r->timestep), c += 3;
      else
        fputc(*c, out);
    }
    good = fclose(out) == 0;
  }
  free(page);
  return good ? CAV_OK : cav_file_fail(error, CAV_BAD_INPUT, 0, "%s: cannot be written: %s", stepped, strerror(errno));
}

// has the page drawn; the text of it afterwards is in drawn.html
static cav_status draw(const char *folder, const cav_recording *r, cav_error *error) {
  static const char *const names[] = {"chromium", "chromium-browser", "google-chrome"};
  char page[PATH_ROOM], drawn[PATH_ROOM], told[PATH_ROOM], budget[64], data[PATH_ROOM];
  snprintf(page, sizeof page, "file://%s/stepped.html", folder);
  snprintf(drawn, sizeof drawn, "%s/drawn.html", folder);
  snprintf(told, sizeof told, "%s/chromium.txt", folder);
  snprintf(data, sizeof data, "--user-data-dir=%s/profile", folder);
  // of its own time, which stands still while it draws
  snprintf(budget, sizeof budget, "--virtual-time-budget=%d", 4000 + 100 * r->n);
  for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
    char *argument[] = {(char *)names[i],
                        "--headless",
                        "--no-sandbox",
                        "--use-gl=angle",
                        "--use-angle=swiftshader",
                        "--enable-unsafe-swiftshader",
                        "--ignore-gpu-blocklist",
                        "--hide-scrollbars",
                        "--window-size=1280,720",
                        data,
                        budget,
                        "--dump-dom",
                        page,
                        NULL};
    int how = run(argument, drawn, told);
    if (how == 0) return CAV_OK;
    if (how != 127)
      return cav_file_fail(error, CAV_INTERNAL, 0, "%s ended with status %d while it drew the motion", names[i], how);
  }
  return cav_file_fail(
      error, CAV_BAD_INPUT, 0,
      "a video needs Chromium, which is not here: apt-get install chromium; view.html shows the motion "
      "without it");
}

// the bytes of a base64 text up to what is none of it; where it ends
static const char *write_decoded(FILE *out, const char *text) {
  static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  unsigned bits = 0;
  int n = 0;
  for (const char *at; *text && (at = strchr(digits, *text)); text++) {
    bits = bits << 6 | (unsigned)(at - digits);
    n += 6;
    if (n >= 8) fputc((int)(bits >> (n -= 8) & 255), out);
  }
  return text;
}

// pictures of the drawn page into files; *n of them
static cav_status take_pictures(const char *folder, int *n, cav_error *error) {
  static const char start[] = "data:image/jpeg;base64,";
  char path[PATH_ROOM];
  size_t length;
  snprintf(path, sizeof path, "%s/drawn.html", folder);
  char *page = read_all(path, &length);
  // the last part of the page is what was left there
  const char *at = page ? strstr(page, start) : NULL;
  cav_status status = CAV_OK;
  for (*n = 0; at && !status; at = strstr(at, start)) {
    snprintf(path, sizeof path, "%s/picture%06d.jpg", folder, (*n)++);
    FILE *out = fopen(path, "wb");
    if (out) at = write_decoded(out, at + strlen(start));
    if (!out || fclose(out) != 0)
      status = cav_file_fail(error, CAV_BAD_INPUT, 0, "%s: cannot be written: %s", path, strerror(errno));
  }
  free(page);
  return status;
}

static cav_status encode(const char *folder, double rate, const char *path, cav_error *error) {
  char pictures[PATH_ROOM], told[PATH_ROOM], film[PATH_ROOM], frames[32];
  snprintf(pictures, sizeof pictures, "%s/picture%%06d.jpg", folder);
  snprintf(told, sizeof told, "%s/ffmpeg.txt", folder);
  // beside where it goes, so that it is there whole or not at all
  snprintf(film, sizeof film, "%s.%ld.tmp.mp4", path, (long)getpid());
  snprintf(frames, sizeof frames, "%.9g", rate);
  char *argument[] = {"ffmpeg", "-y",       "-loglevel", "error",     "-framerate", frames, "-i",
                      pictures, "-pix_fmt", "yuv420p",   "-movflags", "+faststart", film,   NULL};
  int how = run(argument, told, told);
  if (how == 127)
    return cav_file_fail(error, CAV_BAD_INPUT, 0, "a video needs ffmpeg, which is not here: apt-get install ffmpeg");
  if (how == 0 && rename(film, path) == 0) return CAV_OK;
  unlink(film);
  size_t n;
  char *text = read_all(told, &n);
  cav_status status =
      cav_file_fail(error, CAV_BAD_INPUT, 0, "%s: cannot be written by ffmpeg: %.200s", path, text ? text : "");
  free(text);
  return status;
}

static int forget(const char *path, const struct stat *about, int kind, struct FTW *place) {
  (void)about, (void)kind, (void)place;
  return remove(path);
}

cav_status cav_exchange_write_mp4(const cav_recording *r, const char *path, char note[CAV_EXCHANGE_NOTE],
                                  cav_error *error) {
  const char *above = getenv("TMPDIR");
  char folder[1024];
  int n = 0;
  snprintf(folder, sizeof folder, "%.900s/cavort-video-XXXXXX", above && *above ? above : "/tmp");
  *note = 0;
  if (!mkdtemp(folder)) return cav_file_fail(error, CAV_BAD_INPUT, 0, "%s: %s", folder, strerror(errno));
  cav_status status = write_page(folder, r, error);
  if (!status) status = draw(folder, r, error);
  if (!status) status = take_pictures(folder, &n, error);
  if (!status && n != r->n)
    status =
        cav_file_fail(error, CAV_INTERNAL, 0, "Chromium drew %d of %d pictures; without WebGL it draws none", n, r->n);
  if (!status) status = encode(folder, 1 / r->timestep, path, error);
  nftw(folder, forget, 16, FTW_DEPTH | FTW_PHYS);
  return status;
}
