// SPDX-License-Identifier: Apache-2.0
/* What a driver of a robot exports: plain C, so that it may be built by any compiler, without palpate's library.
 *
 *   int palpate_make_robot(uint32_t abi, const char* settings, struct PalpateRobot* robot, char* error, size_t error_size);
 *
 * `palpate record --driver ./libdriver.so` loads it and runs the push protocol on what it fills in, `palpate explore` the loop
 * that chooses its own pushes. A small one is in examples/driver. Lengths in metres, angles in radians, forces in newtons, times
 * in seconds; frames as in docs/conventions.md. Every call is made from one thread. */
#ifndef PALPATE_ACQUISITION_DRIVER_H
#define PALPATE_ACQUISITION_DRIVER_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/** Changes whenever a struct or the meaning of a call does. A program uses drivers of its own version and of every one before it:
 *  1: the first. 2: `limits` and `look` at the end of PalpateRobot. */
#define PALPATE_ROBOT_ABI 2u
#define PALPATE_ROBOT_ENTRY "palpate_make_robot"
enum { PALPATE_MAX_JOINTS = 64 };

/** What calls answer. After anything but `done` and `refused`, last_error() says why in plain words. */
enum PalpateAnswer {
  PALPATE_DONE = 0,
  PALPATE_REFUSED = 1, /**< move() only: a limit, a collision or no solution; the tip did not move */
  PALPATE_FAILED = 2   /**< the robot or its connection is at fault; the run ends */
};

/** T_base_frame: maps coordinates of the frame into the robot's base. */
struct PalpatePose {
  double position_m[3];
  double rotation_wxyz[4]; /**< unit quaternion */
};

/** Read at one time. */
struct PalpateRobotState {
  double time_s; /**< of the robot's clock, never going back */
  int joints;    /**< how many of joints_rad are used; 0 = none are told */
  double joints_rad[PALPATE_MAX_JOINTS]; /**< in the order of `joint_names` of the scene */
  struct PalpatePose T_base_tip;         /**< z along the tool, into the object */
  double force_n[3];                     /**< of the tool on the object, base frame; a constant bias is allowed */
  int has_torque;                        /**< not 0: torque_nm is measured */
  double torque_nm[3];                   /**< of the tool on the object about the tip, base frame; a constant bias is allowed */
};

/** The pixels stay the driver's and are valid until its next call. */
struct PalpateDepthImage {
  double time_s;
  int width_px, height_px;
  double fx_px, fy_px, cx_px, cy_px; /**< pinhole without distortion: undistort before */
  struct PalpatePose T_base_camera;  /**< z forward, x right, y down */
  double pose_std_m, pose_std_rad;   /**< how well that pose is known */
  const char* noise_model;           /**< a row of the noise models of recordings; NULL: sigma_m is given */
  double sigma_m;                    /**< of the depth, where noise_model is NULL */
  const float* depth_m;              /**< row by row, along the optical axis; 0 = no data */
  const uint8_t* mask;               /**< row by row, not 0 where the robot hides the object; NULL: palpate masks the robot
                                          by the scene's description of it */
};

/** What the robot itself bears, whatever a push asks for. Comes infinite: what is left so has no limit of its own. */
struct PalpateLimits {
  double force_n;   /**< of the tip along a push: what hand and sensor bear, or what the sensor can tell once it is tared */
  double travel_m;  /**< into the object, from first contact */
  double speed_m_s; /**< of the tip */
};

/** Filled in by palpate_make_robot. `self` is handed to every call. All calls but `reaches`, `limits` and `look` are required. */
struct PalpateRobot {
  uint32_t abi; /**< PALPATE_ROBOT_ABI of the header that the driver was built with */
  void* self;
  int (*read)(void* self, struct PalpateRobotState* state);
  int (*move)(void* self, const struct PalpatePose* T_base_tip, double speed_m_s); /**< on a straight line; returns when the
                                                                                        tip stands */
  int (*stop)(void* self); /**< brings the arm to rest where it is; comes between two motions, never during one: long ones come in
                                pieces (of 10 mm, where the user says nothing else), so that no stop has to wait */
  int (*take_depth_image)(void* self, struct PalpateDepthImage* image);
  int (*wait)(void* self, double duration_s);
  double (*travel_sigma_m)(void* self); /**< standard deviation of the encoders' tip position along a push */
  int (*reaches)(void* self, const struct PalpatePose* T_base_tip); /**< not 0: gets there; NULL: not known beforehand */
  const char* (*last_error)(void* self);
  void (*destroy)(void* self);
  /* Since version 2 */
  int (*limits)(void* self, struct PalpateLimits* limits); /**< asked before every push; NULL: none but what move() refuses */
  /** Carries the camera to the `view`-th, from 0, of `views` places of the robot's own choosing around the untouched object, some
      of them from above, and takes an image there. The arm does not hide the object, or the mask says where: palpate does not
      know the joints then. NULL: the camera is not carried around. */
  int (*look)(void* self, int view, int views, struct PalpateDepthImage* image);
};

/** @param abi  PALPATE_ROBOT_ABI of the program; before anything else answer PALPATE_FAILED when it is less than yours: `*robot` is
 *              too short then. A program that a driver refuses asks once more as version 1, for drivers that want no other
 *  @param settings  what the user said with --driver-settings ("" otherwise): an address, a file, ...
 *  @param robot  comes zeroed
 *  @param error  room for `error_size` characters that say, after PALPATE_FAILED, what to do */
int palpate_make_robot(uint32_t abi, const char* settings, struct PalpateRobot* robot, char* error, size_t error_size);

#ifdef __cplusplus
}
#endif
#endif
