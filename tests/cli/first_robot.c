/* SPDX-License-Identifier: Apache-2.0
 * A driver as it was built for version 1 of driver.h: it wants no other program, and writes no more of the struct than there was.
 */
#include "palpate/acquisition/driver.h"

#define palpate_make_robot make_spring_robot
int palpate_make_robot(uint32_t abi, const char* settings, struct PalpateRobot* robot, char* error, size_t error_size);
#include "examples/driver/spring_robot.c"
#undef palpate_make_robot

#include <string.h>

int palpate_make_robot(uint32_t abi, const char* settings, struct PalpateRobot* robot, char* error, size_t error_size) {
  struct PalpateRobot today;
  int answer;
  memset(&today, 0, sizeof today);
  if (abi != 1) {
    snprintf(error, error_size, "this driver is for version 1 of palpate's robots, not %u", abi);
    return PALPATE_FAILED;
  }
  answer = make_spring_robot(PALPATE_ROBOT_ABI, settings, &today, error, error_size);
  today.abi = 1;
  memcpy(robot, &today, offsetof(struct PalpateRobot, limits));
  return answer;
}
