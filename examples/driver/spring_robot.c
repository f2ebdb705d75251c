/* SPDX-License-Identifier: Apache-2.0
 * The smallest driver that does something: a gantry whose stick presses from above, under a camera that looks straight down,
 * a plate on a spring or a soft block. Replace the bodies of the calls by those of your arm's and sensors' libraries.
 *
 *   cc -shared -fPIC -I PALPATE_SOURCE spring_robot.c -o libspring_robot.so -lm
 *   palpate record --driver ./libspring_robot.so --driver-settings 800 --scene scene --contact 0.5 0 0.1 -o on_a_spring
 *   palpate check on_a_spring --stiffness 800
 *   palpate explore --driver ./libspring_robot.so --driver-settings "soft 20000 0.3" --scene soft_scene -o on_a_block
 *   palpate record --driver ./libspring_robot.so --driver-settings "soft 20000 0.3" --scene soft_scene --views 6 \
 *       --contact 0.5 0 0.2 --force-limit 1.5 --force-step 0.5 -o looked_at
 *
 * A plate goes down as a whole and has no Young's modulus; the block of 20 kPa and 0.3 has one that explore can find.
 */
#include "palpate/acquisition/driver.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { width_px = 160, height_px = 120 };

struct World {
  double stiffness_n_per_m, half_m, top_m;
  int soft; /* gives way around the stick only */
  double clock_s;
  struct PalpatePose tip;
  uint64_t noise;
  float depth_m[width_px * height_px];
};

static const double pi = 3.14159265358979323846;
static const double middle_x_m = 0.5, camera_m = 0.6, focal_px = 200, pad_radius_m = 0.01;

/* About standard normal, repeatable: the sum of twelve uniform numbers. */
static double noise(struct World* world) {
  double sum = -6;
  for (int i = 0; i < 12; ++i) {
    world->noise = world->noise * 6364136223846793005u + 1442695040888963407u;
    sum += (double)(world->noise >> 11) / 9007199254740992.0;
  }
  return sum;
}

static double pressed_m(const struct World* world) {
  const double deep = world->top_m - world->tip.position_m[2];
  const int above = fabs(world->tip.position_m[0] - middle_x_m) < world->half_m && fabs(world->tip.position_m[1]) < world->half_m;
  return above && deep > 0 ? deep : 0;
}

/* Complete elliptic integrals of modulus k, by the arithmetic-geometric mean. */
static void elliptic(double k, double* first, double* second) {
  double a = 1, b = sqrt(1 - k * k), c = k, weight = 0.5, sum = 0.5 * k * k;
  for (int i = 0; i < 40 && fabs(c) > 1e-15; ++i) {
    const double mean = 0.5 * (a + b);
    c = 0.5 * (a - b);
    b = sqrt(a * b);
    a = mean;
    weight *= 2;
    sum += weight * c * c;
  }
  *first = pi / (2 * a);
  *second = *first * (1 - sum);
}

/* How far the surface has gone down there: a plate as a whole, a half space under even pressure of a soft round pad as its
 * theory says (K. L. Johnson, Contact Mechanics, section 3.4), over the mean under the pad, which is the stick's travel. */
static double sunk_m(const struct World* world, double x_m, double y_m) {
  const double away = hypot(x_m - world->tip.position_m[0], y_m - world->tip.position_m[1]) / pad_radius_m;
  double first, second;
  if (!world->soft) return pressed_m(world);
  elliptic(fmin(away < 1 ? away : 1 / away, 1 - 1e-9), &first, &second);
  return 0.75 * pressed_m(world) * (away < 1 ? second : away * (second - (1 - 1 / (away * away)) * first));
}

static int read_state(void* self, struct PalpateRobotState* state) {
  struct World* world = self;
  state->time_s = world->clock_s;
  state->T_base_tip = world->tip;
  for (int i = 0; i < 3; ++i) state->force_n[i] = 0.02 * noise(world) + 0.3; /* the sensor is not tared */
  state->force_n[2] -= world->stiffness_n_per_m * pressed_m(world);
  return PALPATE_DONE;
}

/* A small gantry that points straight down: it stays away from the block's edges, where the half space's theory ends. */
static int reaches(void* self, const struct PalpatePose* T_base_tip) {
  const double *q = T_base_tip->rotation_wxyz, *p = T_base_tip->position_m;
  (void)self;
  return 1 - 2 * (q[1] * q[1] + q[2] * q[2]) < -0.9999 && fabs(p[0] - middle_x_m) < 0.04 && fabs(p[1]) < 0.04 && p[2] > 0.02 &&
         p[2] < 0.5;
}

static int move_tip(void* self, const struct PalpatePose* T_base_tip, double speed_m_s) {
  struct World* world = self;
  double squares = 0;
  if (!reaches(self, T_base_tip)) return PALPATE_REFUSED;
  for (int i = 0; i < 3; ++i) squares += pow(T_base_tip->position_m[i] - world->tip.position_m[i], 2);
  world->clock_s += sqrt(squares) / speed_m_s;
  world->tip = *T_base_tip;
  return PALPATE_DONE;
}

static int stop_robot(void* self) {
  (void)self;
  return PALPATE_DONE;
}

/* What all images have in common. */
static void fill_in(struct World* world, struct PalpateDepthImage* image) {
  image->time_s = world->clock_s;
  image->width_px = width_px;
  image->height_px = height_px;
  image->fx_px = image->fy_px = focal_px;
  image->cx_px = 79.5;
  image->cy_px = 59.5;
  image->sigma_m = 0.0005;
  image->depth_m = world->depth_m;
}

static int take_depth_image(void* self, struct PalpateDepthImage* image) {
  struct World* world = self;
  for (int row = 0; row < height_px; ++row)
    for (int column = 0; column < width_px; ++column) {
      const double x = (column - 79.5) / focal_px, y = (row - 59.5) / focal_px; /* the image's y points to the back */
      const double rest = camera_m - world->top_m;
      double depth = rest;
      for (int again = 0; again < 3; ++again) depth = rest + sunk_m(world, middle_x_m + x * depth, -y * depth);
      if (fabs(x * depth) > world->half_m || fabs(y * depth) > world->half_m) depth = camera_m;
      world->depth_m[row * width_px + column] = (float)(depth + 0.0005 * noise(world));
    }
  fill_in(world, image);
  image->T_base_camera.position_m[0] = middle_x_m;
  image->T_base_camera.position_m[2] = camera_m;
  image->T_base_camera.rotation_wxyz[1] = 1; /* half a turn about x: looks down */
  return PALPATE_DONE;
}

/* How far along a ray the box that stands there begins, or the table. */
static double range_to(const struct World* world, const double* from_m, const double* along) {
  const double low[3] = {middle_x_m - world->half_m, -world->half_m, 0};
  const double high[3] = {middle_x_m + world->half_m, world->half_m, world->top_m};
  double enters = 0, leaves = 1e9;
  for (int i = 0; i < 3; ++i) {
    const double a = (low[i] - from_m[i]) / along[i], b = (high[i] - from_m[i]) / along[i];
    enters = fmax(enters, fmin(a, b));
    leaves = fmin(leaves, fmax(a, b));
  }
  if (enters < leaves) return enters;
  return along[2] < 0 ? -from_m[2] / along[2] : 0; /* 0: nothing is there */
}

/* A second camera goes around what stands there: a ring that looks down by a third of a right angle, then from above. Its place is
 * known exactly; a real one states what it errs by. The stick stays above, out of its sight. */
static int look_from(void* self, int view, int views, struct PalpateDepthImage* image) {
  struct World* world = self;
  const int above = view == views - 1;
  const double away_m = 0.8, turn = above ? 0 : 2 * pi * view / (views - 1) + pi / 4, down = above ? 0.5 * pi : pi / 6;
  /* Axes of the camera in the base frame, and the same as a quaternion: turned about z, tilted about the camera's x, looking down. */
  const double right[3] = {-sin(turn), cos(turn), 0}, lower[3] = {sin(down) * cos(turn), sin(down) * sin(turn), -cos(down)};
  const double forward[3] = {-cos(down) * cos(turn), -cos(down) * sin(turn), -sin(down)};
  const double c = cos(pi / 4 - down / 2), s = sin(pi / 4 - down / 2);
  const double less = cos(turn / 2) - sin(turn / 2), more = cos(turn / 2) + sin(turn / 2);
  const double rotation[4] = {-s * less, c * less, c * more, -s * more};
  double* eye_m = image->T_base_camera.position_m;
  for (int i = 0; i < 4; ++i) image->T_base_camera.rotation_wxyz[i] = sqrt(0.5) * rotation[i];
  for (int i = 0; i < 3; ++i) eye_m[i] = (i == 0 ? middle_x_m : i == 2 ? 0.5 * world->top_m : 0) - away_m * forward[i];
  for (int row = 0; row < height_px; ++row)
    for (int column = 0; column < width_px; ++column) {
      const double x = (column - 79.5) / focal_px, y = (row - 59.5) / focal_px;
      double along[3];
      for (int i = 0; i < 3; ++i) along[i] = forward[i] + x * right[i] + y * lower[i];
      const double depth = range_to(world, eye_m, along); /* along has length 1 along the optical axis */
      world->depth_m[row * width_px + column] = depth > 0 ? (float)(depth + 0.0005 * noise(world)) : 0;
    }
  fill_in(world, image);
  return PALPATE_DONE;
}

static int own_limits(void* self, struct PalpateLimits* limits) {
  (void)self;
  limits->force_n = 40; /* of the load cell */
  limits->speed_m_s = 0.1;
  return PALPATE_DONE;
}

static int wait_a_while(void* self, double duration_s) {
  struct World* world = self;
  world->clock_s += duration_s;
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
  double stiffness = 800, young_pa = 0, poisson = 0;
  int end = 0;
  const int soft = sscanf(settings, "soft %lf %lf %n", &young_pa, &poisson, &end) == 2;
  if (abi < PALPATE_ROBOT_ABI) {
    snprintf(error, error_size, "this driver is for version %u of palpate's robots, and the program has %u; take a newer program, or "
                                "build the driver with that one's header", PALPATE_ROBOT_ABI, abi);
    return PALPATE_FAILED;
  }
  if (!soft && *settings != '\0' && sscanf(settings, "%lf %n", &stiffness, &end) != 1) stiffness = 0;
  if (soft) stiffness = 3 * pi * pi / 16 * pad_radius_m * young_pa / (1 - poisson * poisson); /* a half space under even pressure */
  if (!(stiffness > 0) || !(poisson >= 0 && poisson <= 0.5) || settings[end] != '\0') {
    snprintf(error, error_size, "`%s` is no stiffness; give newtons a metre, such as 800, or `soft 20000 0.3`: Young's modulus (Pa) "
                                "and Poisson ratio", settings);
    return PALPATE_FAILED;
  }
  struct World* world = calloc(1, sizeof *world);
  if (world == NULL) {
    snprintf(error, error_size, "no memory is left");
    return PALPATE_FAILED;
  }
  world->stiffness_n_per_m = stiffness;
  world->soft = soft;
  world->half_m = soft ? 0.1 : 0.05;
  world->top_m = soft ? 0.2 : 0.1;
  world->noise = 7;
  world->tip.position_m[0] = middle_x_m;
  world->tip.position_m[2] = 0.3;
  world->tip.rotation_wxyz[1] = 1;
  robot->abi = PALPATE_ROBOT_ABI;
  robot->self = world;
  robot->read = read_state;
  robot->move = move_tip;
  robot->stop = stop_robot;
  robot->take_depth_image = take_depth_image;
  robot->wait = wait_a_while;
  robot->travel_sigma_m = travel_sigma_m;
  robot->reaches = reaches;
  robot->last_error = last_error;
  robot->destroy = free;
  robot->limits = own_limits;
  robot->look = look_from;
  return PALPATE_DONE;
}
