/* SPDX-License-Identifier: Apache-2.0
 * The smallest driver that does something: a gantry whose stick presses a plate on a spring from above, under a camera that
 * looks straight down. Replace the bodies of the calls by those of your arm's and sensors' libraries.
 *
 *   cc -shared -fPIC -I PALPATE_SOURCE spring_robot.c -o libspring_robot.so -lm
 *   palpate record --driver ./libspring_robot.so --driver-settings 800 --scene scene --contact 0.5 0 0.1 -o on_a_spring
 *   palpate check on_a_spring --stiffness 800
 */
#include "palpate/acquisition/driver.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { width_px = 160, height_px = 120 };

struct Spring {
  double stiffness_n_per_m;
  double clock_s, tip_m[3];
  struct PalpatePose tip;
  uint64_t noise;
  float depth_m[width_px * height_px];
};

static const double plate_half_m = 0.05, plate_m = 0.1, plate_x_m = 0.5, camera_m = 0.6, focal_px = 200;

/* About standard normal, repeatable: the sum of twelve uniform numbers. */
static double noise(struct Spring* spring) {
  double sum = -6;
  for (int i = 0; i < 12; ++i) {
    spring->noise = spring->noise * 6364136223846793005u + 1442695040888963407u;
    sum += (double)(spring->noise >> 11) / 9007199254740992.0;
  }
  return sum;
}

static double pressed_m(const struct Spring* spring) {
  const double deep = plate_m - spring->tip.position_m[2];
  const int above = fabs(spring->tip.position_m[0] - plate_x_m) < plate_half_m && fabs(spring->tip.position_m[1]) < plate_half_m;
  return above && deep > 0 ? deep : 0;
}

static int read_state(void* self, struct PalpateRobotState* state) {
  struct Spring* spring = self;
  state->time_s = spring->clock_s;
  state->T_base_tip = spring->tip;
  for (int i = 0; i < 3; ++i) state->force_n[i] = 0.02 * noise(spring) + 0.3; /* the sensor is not tared */
  state->force_n[2] -= spring->stiffness_n_per_m * pressed_m(spring);
  return PALPATE_DONE;
}

static int move_tip(void* self, const struct PalpatePose* T_base_tip, double speed_m_s) {
  struct Spring* spring = self;
  double squares = 0;
  if (T_base_tip->position_m[2] < 0.02 || T_base_tip->position_m[2] > 0.5) return PALPATE_REFUSED;
  for (int i = 0; i < 3; ++i) squares += pow(T_base_tip->position_m[i] - spring->tip.position_m[i], 2);
  spring->clock_s += sqrt(squares) / speed_m_s;
  spring->tip = *T_base_tip;
  return PALPATE_DONE;
}

static int stop_robot(void* self) {
  (void)self;
  return PALPATE_DONE;
}

static int take_depth_image(void* self, struct PalpateDepthImage* image) {
  struct Spring* spring = self;
  const double top = camera_m - plate_m + pressed_m(spring);
  for (int row = 0; row < height_px; ++row)
    for (int column = 0; column < width_px; ++column) {
      const double x = (column - 79.5) / focal_px, y = (row - 59.5) / focal_px;
      const int on_plate = fabs(x * top) < plate_half_m && fabs(y * top) < plate_half_m;
      spring->depth_m[row * width_px + column] = (float)((on_plate ? top : camera_m) + 0.0005 * noise(spring));
    }
  image->time_s = spring->clock_s;
  image->width_px = width_px;
  image->height_px = height_px;
  image->fx_px = image->fy_px = focal_px;
  image->cx_px = 79.5;
  image->cy_px = 59.5;
  image->T_base_camera.position_m[0] = plate_x_m;
  image->T_base_camera.position_m[2] = camera_m;
  image->T_base_camera.rotation_wxyz[1] = 1; /* half a turn about x: looks down */
  image->sigma_m = 0.0005;
  image->depth_m = spring->depth_m;
  return PALPATE_DONE;
}

static int wait_a_while(void* self, double duration_s) {
  struct Spring* spring = self;
  spring->clock_s += duration_s;
  return PALPATE_DONE;
}

static double travel_sigma_m(void* self) {
  (void)self;
  return 5e-5;
}

static const char* last_error(void* self) {
  (void)self;
  return "";
}

int palpate_make_robot(uint32_t abi, const char* settings, struct PalpateRobot* robot, char* error, size_t error_size) {
  char* rest = NULL;
  const double stiffness = *settings == '\0' ? 800 : strtod(settings, &rest);
  if (abi != PALPATE_ROBOT_ABI) {
    snprintf(error, error_size, "this driver is for version %u of palpate's robots, not %u", PALPATE_ROBOT_ABI, abi);
    return PALPATE_FAILED;
  }
  if (!(stiffness > 0) || (rest != NULL && *rest != '\0')) {
    snprintf(error, error_size, "`%s` is no stiffness; give newtons a metre, such as --driver-settings 800", settings);
    return PALPATE_FAILED;
  }
  struct Spring* spring = calloc(1, sizeof *spring);
  if (spring == NULL) {
    snprintf(error, error_size, "no memory is left");
    return PALPATE_FAILED;
  }
  spring->stiffness_n_per_m = stiffness;
  spring->noise = 7;
  spring->tip.position_m[0] = plate_x_m;
  spring->tip.position_m[2] = 0.3;
  spring->tip.rotation_wxyz[1] = 1;
  robot->abi = PALPATE_ROBOT_ABI;
  robot->self = spring;
  robot->read = read_state;
  robot->move = move_tip;
  robot->stop = stop_robot;
  robot->take_depth_image = take_depth_image;
  robot->wait = wait_a_while;
  robot->travel_sigma_m = travel_sigma_m;
  robot->last_error = last_error;
  robot->destroy = free;
  return PALPATE_DONE;
}
