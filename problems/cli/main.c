/// The cavort command: reads the command line and calls one command. Commands are a table; each says which options it
/// takes.
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "command.h"
#include "exchange.h"
#include "manual.h"
#include "xml.h"

enum option {
  OPTION_MODEL = 1,
  OPTION_OUTPUT = 2,
  OPTION_SOLVER = 4,
  OPTION_THREADS = 8,
  OPTION_RESUME = 16,
  OPTION_QUIET = 32,
  OPTION_JSON = 64,
  OPTION_IPOPT = 128,
  OPTION_METHODS = 256,
  OPTION_STRATEGIES = 512,
  OPTION_FORCE = 1024,
  OPTION_ALL = 2048,
  OPTION_FLOATING = 4096,
  OPTION_QUICK = 8192,
  OPTION_MARKERS = 16384,
  OPTION_TO = 32768,
  OPTION_RATE = 65536,
  OPTION_JOBS = 131072,
  OPTION_SET = 262144,
  OPTION_CSV = 524288,
  OPTION_LIKE = 1048576,
  OPTION_FROM = 2097152,
  OPTION_UNTIL = 4194304,
  OPTION_WINDOW = 8388608,
  OPTION_SECONDS = 16777216,
  OPTION_CONTROL = 33554432,
  OPTION_ERRORS = 67108864,
  OPTION_SCALE = 134217728,
  OPTION_MASS = 268435456,
  OPTION_STARTS = 536870912
};

#define SOLVER_NAME(solver, name, ...) "|" #name
#define FORMAT_NAME(id, word, ...) "|" #word

// options: bit, spelling, short spelling or NULL, value's name or NULL, what it does
static const cav_manual_option options[] = {
    {OPTION_MODEL, "--model", NULL, "FILE", "use this model instead of the one that the problem names"},
    {OPTION_FLOATING, "--floating", NULL, NULL, "the root link of a URDF floats (a problem says floating=\"true\")"},
    {OPTION_OUTPUT, "--output", "-o", "DIR",
     "folder of the result (default: NAME.result, of a report NAME.report, of stress NAME.stress, of ik NAME.ik, of "
     "mpc NAME.mpc, of mhe NAME.mhe; NAME "
     "of the problem "
     "or "
     "else of its file)"},
    {OPTION_SOLVER, "--solver", NULL, &(CAV_SOLVERS(SOLVER_NAME))[1], "how to solve"},
    {OPTION_IPOPT, "--ipopt", NULL, "NAME=VALUE",
     "an option of Ipopt, laid over the problem's; may be given several times"},
    {OPTION_STRATEGIES, "--strategies", NULL, "N",
     "auto: where the stated guess leads to no certificate, others (default); 1: never; N: so many at once, the "
     "cheapest kept"},
    {OPTION_METHODS, "--methods", NULL, "LIST",
     "what to compare, with commas: own (default), strategies (what solve does: own, then repairs and "
     "other strategies where needed), ipopt, limited (Ipopt with limited memory), both"},
    {OPTION_SECONDS, "--seconds", NULL, "S",
     "solve: ends after S s; a motion whose constraints hold by then is certified as it is, some seconds later, else "
     "the "
     "best iterate is kept (default: never); study: processor time that a run has (default 120)"},
    {OPTION_MARKERS, "--markers", NULL, "FILE", "marker set: which marker of the clip sits where on which body"},
    {OPTION_SCALE, "--scale", NULL, NULL,
     "fit the sizes of segments too, each within a few percent of the whole body's (scale of the marker set: 0.03), "
     "and write the scaled model, model.xml"},
    {OPTION_MASS, "--mass", NULL, "KG", "mass of the subject, of all that moves, for the scaled model"},
    {OPTION_FROM, "--from", NULL, "S", "time of the clip at which the motion begins, s (default: its first frame)"},
    {OPTION_UNTIL, "--until", NULL, "S", "time of the clip at which it ends, s (default: its last frame)"},
    {OPTION_THREADS, "--threads", NULL, "N",
     "threads to use (default: all processors); the result does not depend on it"},
    {OPTION_RESUME, "--resume", NULL, NULL,
     "go on where the solve of the result folder was stopped; if the problem has changed since, start from its motion"},
    {OPTION_QUIET, "--quiet", "-q", NULL, "no progress and no table; errors and the exit status remain"},
    {OPTION_QUICK, "--quick", NULL, NULL, "in seconds instead of minutes: fewer values, states, steps and repeats"},
    {OPTION_FORCE, "--force", NULL, NULL, "solve what is proven impossible all the same"},
    {OPTION_ALL, "--all", NULL, NULL,
     "explain: all that is missed, and all that pulls, with what usually helps; inspect: joints, places and "
     "surfaces of a problem's model, equations, what an evaluation runs, takes and leaves out"},
    {OPTION_JSON, "--json", NULL, NULL, "print as JSON what would be a table"},
    {OPTION_JOBS, "--jobs", "-j", "N",
     "several problems: so many at once, each with one thread (default: as many as processors)"},
    {OPTION_SET, "--set", NULL, "PATH=VALUE",
     "an attribute of the problem, as cost/apex/@target=0.4: elements by their name or tag; of solve also several "
     "values (=0.2,0.3,0.4), each is solved, of several --set all combinations"},
    {OPTION_ERRORS, "--errors", NULL, NULL,
     "write stderr.csv: standard errors of what was estimated, with costs as likelihoods"},
    {OPTION_STARTS, "--starts", NULL, "N",
     "from how many of so many starts a little off, none of which the gains were chosen by, the motion is followed"},
    {OPTION_CSV, "--csv", NULL, NULL, "print as CSV"},
    {OPTION_LIKE, "--like", NULL, "MOTION",
     "as this motion of the project asks, or this problem file, where the model has what it names"},
    {OPTION_TO, "--to", NULL, &(CAV_EXCHANGES(FORMAT_NAME))[1], "what to write"},
    {OPTION_RATE, "--rate", NULL, "N",
     "samples a second (default: the knots of the motion); of mpc plans (default 100)"},
    {OPTION_CONTROL, "--duration", NULL, "S", "simulated time (default: 2.5 s after the last push has begun)"},
    {OPTION_CONTROL, "--push", NULL, "TEXT",
     "\"N_S BODY DIRECTION TIME [LENGTH]\": an impulse (N s) at a body's centre of mass; x, -x, y, -y, z, -z, degrees "
     "from x towards y, or around, ten runs in ten directions and instants; over LENGTH (default 0.1 s). May be given "
     "several times: a run each"},
    {OPTION_WINDOW, "--knots", NULL, "N",
     "knots that a plan looks ahead (default: those of the problem), or of mhe's window (from 3, default 10)"},
    {OPTION_WINDOW, "--iterations", NULL, "N", "Gauss-Newton steps for a plan (default 2), or an update (default 1)"},
    {OPTION_WINDOW, "--deadline", NULL, "S",
     "from a state to the plan that is made from it (default: 1/rate), or for an update (default: a timestep); later "
     "ones are counted"},
    {OPTION_CONTROL, "--stiffness", NULL, "W",
     "rad/s: springs back to the plan, on the inertia of each dof (default 40; 0: the plan's forces alone)"},
};
enum { NOPTION = sizeof options / sizeof *options };

static int help(const cav_command_line *line);

static const cav_manual_command commands[] = {
    {"inspect", "MODEL|PROBLEM",
     "say what a model or a problem holds (--all: what it runs and leaves out, too); of a problem first whether "
     "something "
     "proves it\n"
     "  impossible, and all that looks wrong with it: the way to check a file before it is solved",
     cav_command_inspect, OPTION_MODEL | OPTION_FLOATING | OPTION_ALL | OPTION_SET},
    {"new", "MODEL",
     "write a problem file to begin with, for a model (-o, default MODEL-first.xml): a wish that suits it, and its "
     "joints,\n"
     "  bodies and postures in a comment",
     cav_command_new, OPTION_LIKE | OPTION_FLOATING | OPTION_OUTPUT | OPTION_QUIET},
    {"solve", "PROBLEM...",
     "find the motion that a problem file asks for, certify it and write a result folder; of several problems or "
     "values\n"
     "  one each into DIR (default batch), what is there already not again",
     cav_command_solve,
     OPTION_JOBS | OPTION_SET | OPTION_MODEL | OPTION_OUTPUT | OPTION_SOLVER | OPTION_IPOPT | OPTION_THREADS |
         OPTION_STRATEGIES | OPTION_SECONDS | OPTION_RESUME | OPTION_FORCE | OPTION_ERRORS | OPTION_QUIET |
         OPTION_JSON},
    {"table", "DIR...",
     "a line for each result folder, or each problem of a batch: what became of it, and the first cause",
     cav_command_table, OPTION_CSV},
    {"verify", "DIR", "certify the motion of a result folder again, from its files alone", cav_command_verify,
     OPTION_MODEL | OPTION_ERRORS | OPTION_STARTS | OPTION_QUIET | OPTION_JSON},
    {"explain", "DIR", "say why the motion of a result folder is as it is: what it misses, and which constraints pull",
     cav_command_explain, OPTION_MODEL | OPTION_ALL | OPTION_JSON},
    {"view", "DIR|PROBLEM [DIR...]",
     "write the page of a result folder anew and say where it is; of two folders one page, A-beside-B.view.html, with "
     "both\n"
     "  motions, their charts over each other, their qualities beside each other; A may be a fit of cavort ik; of a "
     "problem file, before anything is solved: a page of the guess from "
     "start\n"
     "  to goal, and how deep start, guess and goal are in what",
     cav_command_view, OPTION_MODEL | OPTION_QUIET},
    {"ik", "CLIP",
     "fit a model to a recorded clip (.trc, .c3d, .bvh, .csv, .xml): the motion nearest to its markers, without "
     "forces;\n"
     "  writes trajectory.csv, residuals of markers, the marker set with the places that were found, and a page",
     cav_command_ik, OPTION_MODEL | OPTION_MARKERS | OPTION_SCALE | OPTION_MASS | OPTION_OUTPUT | OPTION_QUIET},
    {"mpc", "PROBLEM",
     "simulate a body that is controlled by plans made anew while it moves, and pushed; tell pushes survived and how "
     "long "
     "plans\n"
     "  took; writes runs.csv, and of the worst run plans.csv, trajectory.csv and a page",
     cav_command_mpc,
     OPTION_MODEL | OPTION_RATE | OPTION_CONTROL | OPTION_WINDOW | OPTION_SET | OPTION_OUTPUT | OPTION_QUIET},
    {"mhe", "PROBLEM",
     "estimate a motion from its records as they came in, sample by sample, from a window of knots and what is known "
     "before "
     "it:\n"
     "  state with standard errors, forces and disturbances, nothing later used; writes trajectory.csv, stderr.csv, "
     "touch.csv (contact\n"
     "  forces on bodies), updates.csv and a page. Solved as a whole by cavort solve",
     cav_command_mhe, OPTION_MODEL | OPTION_WINDOW | OPTION_THREADS | OPTION_SET | OPTION_OUTPUT | OPTION_QUIET},
    {"track", "CLIP",
     "find the motion nearest to a recorded clip that obeys physics, with the forces and torques that make it: "
     "contacts "
     "are\n"
     "  found, no force plates are needed. Fits the model (as ik), writes a problem to be edited and solved again "
     "(problem.xml),\n"
     "  solves and certifies it into DIR/result, and writes centres of pressure (cop.csv) and distances of markers",
     cav_command_track,
     OPTION_MODEL | OPTION_MARKERS | OPTION_SCALE | OPTION_MASS | OPTION_FROM | OPTION_UNTIL | OPTION_OUTPUT |
         OPTION_SOLVER | OPTION_THREADS | OPTION_STRATEGIES | OPTION_FORCE | OPTION_SET | OPTION_QUIET},
    {"quality", "DIR|CSV...",
     "measure how good motions are, whatever made them, a column each: penetration, skating, floating, jerk, efforts "
     "beyond\n"
     "  limits, and force that neither contacts nor actuators can give",
     cav_command_quality, OPTION_MODEL | OPTION_CSV},
    {"export", "DIR",
     "write the motion of a result folder in a format of other tools, into the folder or where -o says",
     cav_command_export, OPTION_MODEL | OPTION_OUTPUT | OPTION_TO | OPTION_RATE | OPTION_QUIET},
    {"report", "MODEL|PROBLEM",
     "measure error against run time of a scene on this machine: forward solvers, time steps and orders, derivatives, "
     "the\n"
     "  contact law and, of a problem, its solvers; write a page (report.html) and tables (CSV), and say what to use",
     cav_command_report, OPTION_MODEL | OPTION_FLOATING | OPTION_OUTPUT | OPTION_QUICK | OPTION_QUIET},
    {"study", "[MOTION...]",
     "solve motions from ten perturbed starts each, in N processes, and count: problem files, or all of "
     "problems/motions;\n"
     "  what a folder holds already is not solved again",
     cav_command_study, OPTION_MODEL | OPTION_OUTPUT | OPTION_METHODS | OPTION_SECONDS | OPTION_THREADS | OPTION_QUIET},
    {"stress", "MODEL|PROBLEM",
     "push a scene to its edges: each parameter swept over its decades, the range in which all holds, the first value\n"
     "  that breaks, and why. Writes a page and two tables",
     cav_command_stress, OPTION_MODEL | OPTION_FLOATING | OPTION_OUTPUT | OPTION_THREADS | OPTION_QUICK | OPTION_QUIET},
    {"help", "[COMMAND|TOPIC|NAME]",
     "say how to use the tool, one of its commands, or what problem files may say: a topic, an element, an attribute, "
     "a term",
     help, 0},
};
enum { NCOMMAND = sizeof commands / sizeof *commands };

// after the text of --solver
static void print_solvers(void) {
  for (cav_solver i = 0; i < CAV_SOLVER_TYPES; i++) {
    const cav_solver_rule *rule = cav_solver_rule_of(i);
    printf("%s %s, %s%s", i ? ";" : ":", rule->name, rule->text, rule->missing ? " (not in this build)" : "");
    if (i == CAV_SOLVER_GAUSS_NEWTON) printf(" (default)");
  }
}

static void print_command(const cav_manual_command *c) {
  printf("cavort %s %s\n  %s\n", c->name, c->operand, c->text);
  for (int i = 0; i < NOPTION; i++) {
    char text[64];
    if (!(c->options & options[i].bit)) continue;
    snprintf(text, sizeof text, "%s%s%s%s%s", options[i].brief ? options[i].brief : "", options[i].brief ? ", " : "",
             options[i].name, options[i].value ? " " : "", options[i].value ? options[i].value : "");
    printf("  %-18s %s", text, options[i].text);
    if (options[i].bit == OPTION_SOLVER) print_solvers();
    if (options[i].bit == OPTION_TO) cav_command_print_formats(stdout);
    printf("\n");
  }
}

static const cav_manual_command *find_command(const char *name) {
  for (int i = 0; i < NCOMMAND; i++) {
    if (!strcmp(commands[i].name, name)) return &commands[i];
  }
  return NULL;
}

// "; did you mean 'solve'?" on the way to the end of a complaint
static void suggest(const char *near) {
  if (near) fprintf(stderr, "; did you mean '%s'?", near);
}

static void print_topics(const cav_manual *manual) {
  printf("topics of cavort help\n");
  for (int i = 0; i < manual->ntopic; i++) printf("  %-18s %s\n", manual->topic[i].name, manual->topic[i].text);
  printf("  %-18s %s\n\n", "NAME", "an element, an attribute, a term or a sensor of problem files by its name");
}

static int no_help(const cav_manual *manual, const char *name) {
  fprintf(stderr, "cavort: there is no command or topic '%s'", name);
  suggest(cav_manual_nearest(manual, name));
  fprintf(stderr, "; see cavort help\n");
  return CAV_EXIT_BAD_INPUT;
}

static int no_command(const char *name) {
  const cav_manual_use *use = cav_manual_use_of(name);
  fprintf(stderr, "cavort: there is no command '%s'", name);
  if (use)
    fprintf(stderr, "; cavort %s %s", use->line, use->text);
  else
    suggest(cav_xml_nearest(name, &commands->name, NCOMMAND, sizeof *commands));
  fprintf(stderr, "; see cavort help\n");
  return CAV_EXIT_BAD_INPUT;
}

static int help(const cav_command_line *line) {
  cav_manual manual = {.command = commands, .option = options, .ncommand = NCOMMAND, .noption = NOPTION};
  manual.topic = cav_manual_topics(&manual.ntopic);
  const cav_manual_command *c = line->operand ? find_command(line->operand) : NULL;
  if (line->operand && !c)
    return cav_manual_answer(stdout, &manual, line->operand) ? 0 : no_help(&manual, line->operand);
  if (c) {
    print_command(c);
    return 0;
  }
  printf("cavort %s: motions of robots and characters, with contacts, by inverse dynamics\n\n", cav_version());
  for (int i = 0; i < NCOMMAND; i++) {
    print_command(&commands[i]);
    printf("\n");
  }
  print_topics(&manual);
  printf(
      "certified: obeys physics and limits; achieved: does what was asked; optimal: a local optimum, another guess may "
      "lead\n"
      "to a better one\n");
  printf("exit status: " CAV_MANUAL_EXIT "\n");
  return 0;
}

// an option of Ipopt, NAME=VALUE; the argument is cut in two
static int take_ipopt(cav_command_line *line, char *text) {
  cav_error error = {0};
  char *equals = strchr(text, '=');
  if (!equals) {
    fprintf(stderr, "cavort: --ipopt: expected NAME=VALUE, got '%s'\n", text);
    return 0;
  }
  if (line->nipopt == CAV_COMMAND_IPOPT) {
    fprintf(stderr, "cavort: --ipopt: expected at most %d of them; write them into the problem\n", CAV_COMMAND_IPOPT);
    return 0;
  }
  *equals = 0;
  cav_ipopt_option *option = &line->ipopt[line->nipopt++];
  *option = (cav_ipopt_option){text, equals + 1};
  if (!cav_ipopt_option_check(option, &error)) return 1;
  fprintf(stderr, "cavort: --ipopt: %s\n", error.text);
  return 0;
}

// a number above 0, or from 0 on, up to a million; returns 0 after telling what is wrong with it
static int take_number(const char *name, const char *value, int zero, double *number) {
  char *end;
  *number = strtod(value, &end);
  if (end != value && !*end && (zero ? *number >= 0 : *number > 0) && *number <= 1e6) return 1;
  fprintf(stderr, "cavort: %s: expected a number %s 0, up to 1e6, got '%s'\n", name, zero ? "from" : "above", value);
  return 0;
}

// a whole number from 1 on
static int take_count(const char *name, const char *value, int most, int *number) {
  char *end;
  const long n = strtol(value, &end, 10);
  *number = (int)n;
  if (end != value && !*end && n >= 1 && n <= most) return 1;
  fprintf(stderr, "cavort: %s: expected a number from 1 to %d, got '%s'\n", name, most, value);
  return 0;
}

// options of mpc and mhe
static int take_control(cav_command_line *line, const char *name, char *value) {
  if (!strcmp(name, "--duration")) return take_number(name, value, 0, &line->duration);
  if (!strcmp(name, "--deadline")) return take_number(name, value, 1, &line->deadline);
  if (!strcmp(name, "--stiffness")) return take_number(name, value, 1, &line->stiffness);
  if (!strcmp(name, "--knots")) return take_count(name, value, 100000, &line->knots);
  if (!strcmp(name, "--iterations")) return take_count(name, value, 100000, &line->iterations);
  if (line->npush < CAV_COMMAND_PUSHES) {
    line->push[line->npush++] = value;
    return 1;
  }
  fprintf(stderr, "cavort: --push: expected at most %d of them\n", CAV_COMMAND_PUSHES);
  return 0;
}

// takes the value of an option; returns 0 after telling what is wrong with it
static int take_value(cav_command_line *line, enum option option, const char *name, char *value) {
  char *end;
  long n;
  switch (option) {
    case OPTION_MODEL:
      line->model = value;
      return 1;
    case OPTION_FLOATING:
      line->floating = 1;
      return 1;
    case OPTION_OUTPUT:
      line->output = value;
      return 1;
    case OPTION_SOLVER:
      for (line->solver = 0; line->solver < CAV_SOLVER_TYPES; line->solver++)
        if (!strcmp(value, cav_solver_rule_of(line->solver)->name)) return 1;
      fprintf(stderr, "cavort: %s: expected", name);
      for (cav_solver i = 0; i < CAV_SOLVER_TYPES; i++)
        fprintf(stderr, "%s%s", i == 0 ? " " : i + 1 < CAV_SOLVER_TYPES ? ", " : " or ", cav_solver_rule_of(i)->name);
      fprintf(stderr, ", got '%s'\n", value);
      return 0;
    case OPTION_STRATEGIES:
      n = strtol(value, &end, 10);
      line->strategies = (int)n;
      if (!strcmp(value, "auto") || (end != value && !*end && n >= 1 && n <= CAV_STRATEGIES)) return 1;
      fprintf(stderr, "cavort: %s: expected auto or a number from 1 to %d, got '%s'\n", name, CAV_STRATEGIES, value);
      return 0;
    case OPTION_METHODS:
      line->methods = value;
      return 1;
    case OPTION_SECONDS:
      return take_number(name, value, 0, &line->seconds);
    case OPTION_IPOPT:
      return take_ipopt(line, value);
    case OPTION_MARKERS:
      line->markers = value;
      return 1;
    case OPTION_FROM:
      line->from_given = 1;
      return take_number(name, value, 1, &line->from);
    case OPTION_UNTIL:
      return take_number(name, value, 1, &line->until);
    case OPTION_SCALE:
      return line->scale = 1;
    case OPTION_MASS:
      return take_number(name, value, 0, &line->mass);
    case OPTION_THREADS:
      line->threads_given = 1;
      return take_count(name, value, 1024, &line->threads);
    case OPTION_JOBS:
      return take_count(name, value, 1024, &line->jobs);
    case OPTION_SET:
      if (line->nset < CAV_COMMAND_SETTINGS) {
        line->set[line->nset++] = value;
        return 1;
      }
      fprintf(stderr, "cavort: --set: expected at most %d of them; write them into the problem\n",
              CAV_COMMAND_SETTINGS);
      return 0;
    case OPTION_ERRORS:
      return line->errors = 1;
    case OPTION_STARTS:
      return take_count(name, value, 10000, &line->starts);
    case OPTION_CSV:
      return line->csv = 1;
    case OPTION_LIKE:
      line->like = value;
      return 1;
    case OPTION_TO:
      line->format = value;
      return 1;
    case OPTION_RATE:
      return take_number(name, value, 0, &line->rate);
    case OPTION_CONTROL:
    case OPTION_WINDOW:
      return take_control(line, name, value);
    case OPTION_RESUME:
      return line->resume = 1;
    case OPTION_QUIET:
      return line->quiet = 1;
    case OPTION_JSON:
      return line->json = 1;
    case OPTION_QUICK:
      return line->quick = 1;
    case OPTION_FORCE:
      return line->force = 1;
    case OPTION_ALL:
      return line->all = 1;
  }
  return 0;
}

// index of the option that an argument spells, as NAME, NAME=VALUE or its brief form; -1 if none
static int option_of(char *argument, char **value) {
  *value = NULL;
  for (int i = 0; i < NOPTION; i++) {
    size_t n = strlen(options[i].name);
    if (options[i].brief && !strcmp(argument, options[i].brief)) return i;
    if (strncmp(argument, options[i].name, n)) continue;
    if (argument[n] == '=') *value = argument + n + 1;
    if (!argument[n] || (argument[n] == '=' && options[i].value)) return i;
  }
  return -1;
}

// options of earlier versions and what they are called now
static const char *const former_options[][2] = {{"--routes", "--strategies"}};

// what an option of an earlier version is called now; NULL if it is none
static const char *option_renamed(const char *argument) {
  for (size_t i = 0; i < sizeof former_options / sizeof *former_options; i++) {
    size_t n = strlen(former_options[i][0]);
    if (!strncmp(argument, former_options[i][0], n) && (!argument[n] || argument[n] == '='))
      return former_options[i][1];
  }
  return NULL;
}

// "; solve and track have it", of an option that others take; why these do not
static void tell_owners(enum option option) {
  int n = 0, told = 0;
  for (int i = 0; i < NCOMMAND; i++) n += (commands[i].options & option) != 0;
  fprintf(stderr, "%s; ", option == OPTION_THREADS ? ": it runs in one thread" : "");
  for (int i = 0; i < NCOMMAND; i++) {
    if (!(commands[i].options & option)) continue;
    fprintf(stderr, "%s%s", !told ? "" : told + 1 < n ? ", " : " and ", commands[i].name);
    told++;
  }
  fprintf(stderr, " ha%s it", n > 1 ? "ve" : "s");
}

// reads what follows the command's name; returns 0 after telling what is wrong
static int read_line(const cav_manual_command *c, int argc, char **argv, cav_command_line *line) {
  for (int i = 0; i < argc; i++) {
    char *value;
    if (argv[i][0] != '-' || !argv[i][1]) {
      if (strstr(c->operand, "...")) {
        // operands gather at the front, where they have been read already
        line->operands = argv;
        if (line->noperand == 0) line->operand = argv[i];
        argv[line->noperand++] = argv[i];
        line->operand = argv[0];
        continue;
      }
      if (line->operand) {
        fprintf(stderr, "cavort %s: expected one %s, got '%s' and '%s'\n", c->name, c->operand, line->operand, argv[i]);
        return 0;
      }
      line->operand = argv[i];
      continue;
    }
    int k = option_of(argv[i], &value);
    if (k < 0 || !(c->options & options[k].bit)) {
      const char *now = option_renamed(argv[i]);
      if (now)
        fprintf(stderr, "cavort %s: %.*s is called %s now\n", c->name, (int)strcspn(argv[i], "="), argv[i], now);
      else {
        char name[64];
        snprintf(name, sizeof name, "%.*s", (int)strcspn(argv[i], "="), argv[i]);
        fprintf(stderr, "cavort %s: %s is not an option of this command", c->name, argv[i]);
        // one of another command is spelt right
        if (k < 0) suggest(cav_xml_nearest(name, &options->name, NOPTION, sizeof *options));
        if (k >= 0) tell_owners((enum option)options[k].bit);
        fprintf(stderr, "; see cavort help %s\n", c->name);
      }
      return 0;
    }
    if (options[k].value && !value && (i + 1 == argc || !*(value = argv[++i]))) {
      fprintf(stderr, "cavort %s: %s needs a value: %s\n", c->name, options[k].name, options[k].value);
      return 0;
    }
    if (!take_value(line, (enum option)options[k].bit, options[k].name, value)) return 0;
  }
  if (line->operand || c->operand[0] == '[') return 1;
  fprintf(stderr, "cavort %s: expected %s; see cavort help %s\n", c->name, c->operand, c->name);
  return 0;
}

// the command line in one text, in memory that lasts as long as the program; NULL if there is none
static char *join(int argc, char **argv) {
  size_t room = 1;
  for (int i = 0; i < argc; i++) room += strlen(argv[i]) + 3;
  char *text = malloc(room), *end = text;
  for (int i = 0; i < argc && text; i++) {
    const char *quote = strpbrk(argv[i], " \t'\"") ? "'" : "";
    end += sprintf(end, "%s%s%s%s", i ? " " : "", quote, argv[i], quote);
  }
  return text;
}

static int run(int argc, char **argv, const char *arguments) {
  long processors = sysconf(_SC_NPROCESSORS_ONLN);
  cav_command_line line = {.arguments = arguments,
                           .solver = CAV_SOLVER_GAUSS_NEWTON,
                           .deadline = -1,
                           .stiffness = -1,
                           .threads = processors < 1      ? 1
                                      : processors > 1024 ? 1024
                                                          : (int)processors};
  if (argc < 2) {
    help(&line);
    return CAV_EXIT_BAD_INPUT;
  }
  // a file that may not grow further is told, like a full disk
  signal(SIGXFSZ, SIG_IGN);
  const char *name = argv[1];
  if (!strcmp(name, "--help") || !strcmp(name, "-h")) name = "help";
  if (!strcmp(name, "--version")) {
    cav_command_version();
    return 0;
  }
  const cav_manual_command *c = find_command(name);
  if (!c) return no_command(name);
  for (int i = 2; i < argc; i++) {
    if (strcmp(argv[i], "--help") && strcmp(argv[i], "-h")) continue;
    print_command(c);
    return 0;
  }
  if (!read_line(c, argc - 2, argv + 2, &line)) return CAV_EXIT_BAD_INPUT;
  cav_error error = {0};
  // these say themselves what is wrong with what they are given
  int one = c->run != help && c->run != cav_command_study && c->run != cav_command_ik && c->run != cav_command_track &&
            c->run != cav_command_table && c->run != cav_command_quality && line.noperand < 2;
  // solve and track keep what they set; for the others it is a file of the moment
  const int moment = line.nset && c->run != cav_command_solve && c->run != cav_command_track;
  int status = one && cav_command_expect(c->name, c->operand, line.operand, &error) ? cav_command_fail(&error)
               : moment                                                             ? cav_command_set(&line, c->run)
                                                                                    : c->run(&line);
  // a full disk or a closed pipe must not pass for success
  if (fflush(stdout) != 0 && status == 0) {
    fprintf(stderr, "cavort: standard output cannot be written\n");
    status = CAV_EXIT_INTERNAL;
  }
  return status;
}

int main(int argc, char **argv) {
  char *arguments = join(argc, argv);
  int status = run(argc, argv, arguments ? arguments : "");
  free(arguments);
  return status;
}
