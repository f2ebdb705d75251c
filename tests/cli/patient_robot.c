/* SPDX-License-Identifier: Apache-2.0
 * The example's spring in real time, ten times as fast as its clock says, so that a signal can catch it in the middle of a push.
 * What it was told to do goes into the file that PATIENT_ROBOT_LOG names, a line a call. Where PATIENT_ROBOT_TIP names a file the arm
 * stands there as it was left when the program is started again.
 */
#define _POSIX_C_SOURCE 199309L
#include "palpate/acquisition/driver.h"

#define palpate_make_robot make_spring_robot
int palpate_make_robot(uint32_t abi, const char* settings, struct PalpateRobot* robot, char* error, size_t error_size);
#include "examples/driver/spring_robot.c"
#undef palpate_make_robot

#include <time.h>

static struct PalpateRobot spring;

static void say(const char* call) {
  const char* name = getenv("PATIENT_ROBOT_LOG");
  FILE* log = name ? fopen(name, "a") : NULL;
  if (!log) return;
  fprintf(log, "%s\n", call);
  fclose(log);
}

static void pass(double duration_s) {
  const long long ns = (long long)(1e8 * duration_s);
  struct timespec rest = {(time_t)(ns / 1000000000), (long)(ns % 1000000000)};
  while (nanosleep(&rest, &rest) != 0) {
  }
}

/* In one piece, for the program may be killed in the middle of it. */
static void keep_tip(const struct PalpatePose* tip) {
  const char* name = getenv("PATIENT_ROBOT_TIP");
  char beside[4096];
  FILE* file;
  if (!name || snprintf(beside, sizeof beside, "%s.new", name) >= (int)sizeof beside) return;
  file = fopen(beside, "w");
  if (!file) return;
  fprintf(file, "%.17g %.17g %.17g\n", tip->position_m[0], tip->position_m[1], tip->position_m[2]);
  fclose(file);
  rename(beside, name);
}

static void stand_where_left(struct PalpatePose* tip) {
  const char* name = getenv("PATIENT_ROBOT_TIP");
  FILE* file = name ? fopen(name, "r") : NULL;
  double at[3];
  if (!file) return;
  if (fscanf(file, "%lf %lf %lf", &at[0], &at[1], &at[2]) == 3)
    for (int i = 0; i < 3; ++i) tip->position_m[i] = at[i];
  fclose(file);
}

static int wait_really(void* self, double duration_s) {
  pass(duration_s);
  return spring.wait(self, duration_s);
}

static int move_and_say(void* self, const struct PalpatePose* T_base_tip, double speed_m_s) {
  const double before_s = ((struct World*)self)->clock_s;
  int answer;
  say("move");
  answer = spring.move(self, T_base_tip, speed_m_s);
  keep_tip(&((struct World*)self)->tip);
  pass(((struct World*)self)->clock_s - before_s);
  return answer;
}

static int stop_and_say(void* self) {
  say("stop");
  return spring.stop(self);
}

int palpate_make_robot(uint32_t abi, const char* settings, struct PalpateRobot* robot, char* error, size_t error_size) {
  const int answer = make_spring_robot(abi, settings, robot, error, error_size);
  if (answer != PALPATE_DONE) return answer;
  spring = *robot;
  stand_where_left(&((struct World*)robot->self)->tip);
  robot->wait = wait_really;
  robot->move = move_and_say;
  robot->stop = stop_and_say;
  return PALPATE_DONE;
}
