/* What cell software in C links: commanded joint targets out, corrected ones in. Library: libtrued_client.so.1.
 *
 * Rules, for all functions:
 * - Every function answers a trued_code: TRUED_OK, TRUED_NOTHING, or an error below zero, whose words are in
 *   trued_last_error(). No function panics, prints, or waits longer than the limit that it is given.
 * - A handle is used by one thread at a time. A second one is not made to wait: it gets TRUED_ERROR_BUSY. A handle
 *   that has been closed gets TRUED_ERROR_CLOSED.
 * - `struct_size` of every struct, given or filled in, is set to its sizeof before the call: `trued_target t =
 *   TRUED_INIT(trued_target);`. By it an older program and a newer library understand each other.
 * - Pointers point to what they are said to point to for as long as the call lasts. NULL is an error unless it is said
 *   what it means.
 * - SI: rad (m where a joint is prismatic), s, N, N m; other units stand in the names. Times `..._ns` are
 *   CLOCK_MONOTONIC; limits are ns, at most TRUED_LIMIT_NS_MAX.
 * - While no daemon is there, trued_client_target() goes on answering, and the library joins the next daemon by itself.
 */


#ifndef TRUED_H
#define TRUED_H

/* Made by cbindgen from client/c/src; do not edit. A test tells when it is stale. */

#include <stdint.h>

/* A struct with its size set, all else zero. (In C++: trued.hpp.) */
#ifndef __cplusplus
#define TRUED_INIT(type) ((type){ .struct_size = sizeof(type) })
#endif


// The version of what is declared here: major in the upper 16 bits, minor in the lower ones.
#define TRUED_ABI_VERSION 65537

// Longest wait that may be asked for, ns: an hour.
#define TRUED_LIMIT_NS_MAX 3600000000000

// Most joints of one robot.
#define TRUED_JOINTS_MAX 16

// Ambient and one per joint.
#define TRUED_TEMPERATURES_MAX 17

// Room for the words of a struct, the zero at their end included.
#define TRUED_WORDS_MAX 520

// Room for a name of the robot, the zero at its end included.
#define TRUED_NAME_MAX 72

// trued_setpoint: `wrench` holds; in the tool's axes unless TRUED_WRENCH_IN_BASE is set too.
#define TRUED_HAS_WRENCH 1

// trued_setpoint: `wrench` stands in the base's axes, still at the TCP.
#define TRUED_WRENCH_IN_BASE 2

// trued_setpoint: a pose at rest, without rate or jerk bound. Honoured only in a lockstep replay.
#define TRUED_SETTLED 4

// trued_setpoint: `direction` holds.
#define TRUED_HAS_DIRECTION 8

// trued_setpoint: `temperature_c` holds.
#define TRUED_HAS_TEMPERATURE 16

// trued_robot_state: `q_measured` holds.
#define TRUED_STATE_HAS_Q 1

// trued_robot_state: `tau` holds.
#define TRUED_STATE_HAS_TAU 2

// trued_robot_state: `temperature_c` holds.
#define TRUED_STATE_HAS_TEMPERATURE 4

// What a function answers. Below zero: an error, whose words are in trued_last_error().
//
enum trued_code
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // Done.
  TRUED_OK = 0,
  // No error: there is nothing new, or nothing yet.
  TRUED_NOTHING = 1,
  // A pointer is NULL that may not be.
  TRUED_ERROR_NULL = -1,
  // A struct_size is not that of any version of the struct.
  TRUED_ERROR_STRUCT_SIZE = -2,
  // A value makes no sense; the words say which.
  TRUED_ERROR_ARGUMENT = -3,
  // The handle has been closed, or never was one.
  TRUED_ERROR_CLOSED = -4,
  // Another thread is in a call with this handle.
  TRUED_ERROR_BUSY = -5,
  // Too many handles are open.
  TRUED_ERROR_TOO_MANY = -6,
  // The library failed; its fault. Close the handle and connect anew.
  TRUED_ERROR_INTERNAL = -7,
  // Connecting: no daemon announced itself in time.
  TRUED_ERROR_NO_DAEMON = -10,
  // The daemon was there and is gone; it is joined again by itself when it comes back.
  TRUED_ERROR_DAEMON_LOST = -11,
  // Another daemon than before was joined. Said once, and nothing was sent: call again.
  TRUED_ERROR_DAEMON_RESTARTED = -12,
  // Daemon and library are of different versions.
  TRUED_ERROR_VERSION_MISMATCH = -13,
  // The cell belongs to another user.
  TRUED_ERROR_WRONG_USER = -14,
  // Another process has this role.
  TRUED_ERROR_ROLE_TAKEN = -15,
  // The daemon is joined and says nothing.
  TRUED_ERROR_DAEMON_SILENT = -16,
  // No answer in time.
  TRUED_ERROR_TIMED_OUT = -17,
  // The daemon does not take messages fast enough: this one is lost, and counted.
  TRUED_ERROR_MESSAGE_LOST = -18,
  // The shared memory refused.
  TRUED_ERROR_TRANSPORT = -19,
  // The operating system refused.
  TRUED_ERROR_SYSTEM = -20,
  // The daemon refused what was asked; the words are its own.
  TRUED_ERROR_REFUSED = -21,
  // The daemon failed in doing what was asked; the words are its own.
  TRUED_ERROR_FAILED = -22,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum trued_code trued_code;
#else
typedef int32_t trued_code;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// How a correction was made.
enum trued_correction_status
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // By the model, for this command.
  TRUED_CORRECTION_STATUS_CORRECTED = 0,
  // The last correction stands.
  TRUED_CORRECTION_STATUS_HELD = 1,
  // The correction is on its way to another state, or to zero.
  TRUED_CORRECTION_STATUS_RAMPING = 2,
  // By order, nothing is corrected.
  TRUED_CORRECTION_STATUS_BYPASSED = 3,
  // The command was refused; the correction is held for a while, then ramps out.
  TRUED_CORRECTION_STATUS_REJECTED = 4,
  // The command itself; `wanted` tells what would have been.
  TRUED_CORRECTION_STATUS_SHADOW = 5,
  // The best correction within bounds: something is left, see the residual and the reason.
  TRUED_CORRECTION_STATUS_LIMITED = 6,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum trued_correction_status trued_correction_status;
#else
typedef uint32_t trued_correction_status;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Why a correction was made as it was.
enum trued_reason
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // Nothing to say.
  TRUED_REASON_NONE = 0,
  // The command holds a number that is none.
  TRUED_REASON_NOT_FINITE = 1,
  // The command is outside the joint limits.
  TRUED_REASON_OUT_OF_LIMITS = 2,
  // The command is older than its forerunner.
  TRUED_REASON_OUT_OF_ORDER = 3,
  // No fresh command.
  TRUED_REASON_STALE = 4,
  // The same command again.
  TRUED_REASON_DUPLICATE = 5,
  // The command has another number of joints than the model.
  TRUED_REASON_WRONG_JOINT_COUNT = 6,
  // The solve failed: an effect is beyond what its law holds for, or a value is not finite.
  TRUED_REASON_NOT_CONVERGED = 7,
  // The envelope bounds the correction.
  TRUED_REASON_ENVELOPE = 8,
  // Bypass was asked for.
  TRUED_REASON_BYPASS = 9,
  // The model was swapped; its change is ramped.
  TRUED_REASON_MODEL_CHANGED = 10,
  // The daemon starts.
  TRUED_REASON_STARTING = 11,
  // No command has come yet.
  TRUED_REASON_NO_COMMAND = 12,
  // Time of the commands jumped.
  TRUED_REASON_TIME_JUMP = 13,
  // The message cannot be read: layout, counts, flags.
  TRUED_REASON_MALFORMED = 14,
  // The command jumped further than a robot can move.
  TRUED_REASON_COMMAND_JUMP = 15,
  // The daemon stands in shadow mode.
  TRUED_REASON_SHADOW_MODE = 16,
  // The joint limits cut the correction.
  TRUED_REASON_JOINT_LIMIT = 17,
  // The wrench is not used (stale, or its loop gain is too high).
  TRUED_REASON_WRENCH_GATED = 18,
  // A singular pose: the joints cannot move the tool the way that is needed.
  TRUED_REASON_SINGULAR = 19,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum trued_reason trued_reason;
#else
typedef uint32_t trued_reason;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Whether the measured wrench takes part in the correction.
enum trued_wrench_gate
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // No wrench has come.
  TRUED_WRENCH_GATE_ABSENT = 0,
  // It takes part.
  TRUED_WRENCH_GATE_OPEN = 1,
  // It is being faded in or out.
  TRUED_WRENCH_GATE_RAMPING = 2,
  // Its loop gain is too high, so it is taken as zero.
  TRUED_WRENCH_GATE_GAIN_TOO_HIGH = 3,
  // It is stale, so it is taken as zero.
  TRUED_WRENCH_GATE_STALE = 4,
  // It is switched off in the configuration.
  TRUED_WRENCH_GATE_OFF = 5,
  // The force stream or one of its channels has a fault, so it is taken as zero.
  TRUED_WRENCH_GATE_SENSOR_FAULT = 6,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum trued_wrench_gate trued_wrench_gate;
#else
typedef uint32_t trued_wrench_gate;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// How the daemon is.
enum trued_health
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // It starts.
  TRUED_HEALTH_STARTING = 0,
  // It stands ready; no command comes.
  TRUED_HEALTH_IDLE = 1,
  // It corrects.
  TRUED_HEALTH_RUNNING = 2,
  // It goes on, with something missing; `message` says what.
  TRUED_HEALTH_DEGRADED = 3,
  // It corrects nothing; `message` says why.
  TRUED_HEALTH_FAULT = 4,
  // It ends.
  TRUED_HEALTH_STOPPING = 5,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum trued_health trued_health;
#else
typedef uint32_t trued_health;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// How much the daemon may correct.
enum trued_mode
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // It computes and reports, and corrects nothing.
  TRUED_MODE_SHADOW = 0,
  // It corrects within a narrow envelope.
  TRUED_MODE_LIMITED = 1,
  // It corrects within the whole envelope.
  TRUED_MODE_FULL = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum trued_mode trued_mode;
#else
typedef uint32_t trued_mode;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// What the vibration watch does.
enum trued_watch_state
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // The cell has none.
  TRUED_WATCH_STATE_OFF = 0,
  // It learns the noise floor: no line is reported yet.
  TRUED_WATCH_STATE_LEARNING = 1,
  // It watches.
  TRUED_WATCH_STATE_WATCHING = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum trued_watch_state trued_watch_state;
#else
typedef uint32_t trued_watch_state;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// How the black box is.
enum trued_recorder_state
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // It is switched off.
  TRUED_RECORDER_STATE_OFF = 0,
  // It writes.
  TRUED_RECORDER_STATE_RECORDING = 1,
  // It drops: the disk is too slow or full.
  TRUED_RECORDER_STATE_DROPPING = 2,
  // It cannot write.
  TRUED_RECORDER_STATE_FAILED = 3,
  // It writes nothing because it was asked to stop, or is configured to wait for a start.
  TRUED_RECORDER_STATE_STOPPED = 4,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum trued_recorder_state trued_recorder_state;
#else
typedef uint32_t trued_recorder_state;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// What a recorder is asked to do.
enum trued_recorder_action
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // Close the recording; write nothing until the next start.
  TRUED_RECORDER_ACTION_STOP = 0,
  // Begin a recording.
  TRUED_RECORDER_ACTION_START = 1,
  // Keep the present recording: the removal of old ones leaves it alone.
  TRUED_RECORDER_ACTION_KEEP = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum trued_recorder_action trued_recorder_action;
#else
typedef uint32_t trued_recorder_action;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// What the trim by measurements does.
enum trued_trim_state
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // The cell has no instrument, or it is switched off.
  TRUED_TRIM_STATE_OFF = 0,
  // No measurement is believed yet, or none comes any more: nothing is trimmed.
  TRUED_TRIM_STATE_WAITING = 1,
  // The model's error is found and told; nothing is trimmed.
  TRUED_TRIM_STATE_OBSERVING = 2,
  // The tool is trimmed.
  TRUED_TRIM_STATE_TRIMMING = 3,
  // Measurements are missing; the trim stands.
  TRUED_TRIM_STATE_HOLDING = 4,
  // The trim is on its way to zero.
  TRUED_TRIM_STATE_RAMPING = 5,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum trued_trim_state trued_trim_state;
#else
typedef uint32_t trued_trim_state;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Why the trim is so.
enum trued_trim_reason
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // Nothing to say.
  TRUED_TRIM_REASON_NONE = 0,
  // No measurement comes.
  TRUED_TRIM_REASON_NO_MEASUREMENT = 1,
  // A measurement holds a number that is none, or is further away than any robot.
  TRUED_TRIM_REASON_NOT_FINITE = 2,
  // It is not later than its forerunner.
  TRUED_TRIM_REASON_OUT_OF_ORDER = 3,
  // It is older than twice what the cell states.
  TRUED_TRIM_REASON_LATE = 4,
  // Its stamp lies ahead of the clock.
  TRUED_TRIM_REASON_AHEAD = 5,
  // The model does not say where the tool was then: no command, a refused one, or an effect beyond its law.
  TRUED_TRIM_REASON_NOT_PREDICTED = 6,
  // The instrument has jumped: its registration is to be looked after.
  TRUED_TRIM_REASON_JUMPED = 7,
  // The trim is at its bound.
  TRUED_TRIM_REASON_BOUNDED = 8,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum trued_trim_reason trued_trim_reason;
#else
typedef uint32_t trued_trim_reason;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// How far a ringing has come.
enum trued_vibration_state
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // It has ended, or there is none.
  TRUED_VIBRATION_STATE_OVER = 0,
  // A line stands above the floor.
  TRUED_VIBRATION_STATE_WARN = 1,
  // It lasts or grows.
  TRUED_VIBRATION_STATE_ALARM = 2,
  // Its class is known too.
  TRUED_VIBRATION_STATE_CONFIRMED = 3,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum trued_vibration_state trued_vibration_state;
#else
typedef uint32_t trued_vibration_state;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// What kind of ringing it is.
enum trued_vibration_class
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // Not decided.
  TRUED_VIBRATION_CLASS_UNKNOWN = 0,
  // Driven by the spindle or its teeth.
  TRUED_VIBRATION_CLASS_FORCED = 1,
  // Regenerative chatter.
  TRUED_VIBRATION_CLASS_CHATTER = 2,
  // Mode-coupling chatter.
  TRUED_VIBRATION_CLASS_MODE_COUPLING = 3,
  // A gear's meshing.
  TRUED_VIBRATION_CLASS_GEAR = 4,
  // A structural mode, excited from outside.
  TRUED_VIBRATION_CLASS_STRUCTURAL = 5,
  // Mains or inverter.
  TRUED_VIBRATION_CLASS_ELECTRICAL = 6,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum trued_vibration_class trued_vibration_class;
#else
typedef uint32_t trued_vibration_class;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// What would help.
enum trued_advice
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // Nothing to advise.
  TRUED_ADVICE_NONE = 0,
  // Forced: go to `advice_rpm`, which moves the tooth harmonics off the mode.
  TRUED_ADVICE_MOVE_OFF_MODE = 1,
  // Regenerative chatter: go to `advice_rpm`, a pocket between stability lobes.
  TRUED_ADVICE_STABILITY_POCKET = 2,
  // Speed does not help: change direction of cut, feed or depth.
  TRUED_ADVICE_CHANGE_CUT = 3,
  // Take less depth.
  TRUED_ADVICE_REDUCE_DEPTH = 4,
  // Sample faster, or filter before sampling: the line may be an alias.
  TRUED_ADVICE_SAMPLE_FASTER = 5,
  // Look at the gear trains: the line follows the feed.
  TRUED_ADVICE_CHECK_GEAR = 6,
  // Look at cables, shields and grounding: a mains line.
  TRUED_ADVICE_CHECK_WIRING = 7,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum trued_advice trued_advice;
#else
typedef uint32_t trued_advice;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// What is wrong with the force signal itself.
enum trued_sensor_fault
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // Nothing.
  TRUED_SENSOR_FAULT_NONE = 0,
  // A channel stands at its end of range.
  TRUED_SENSOR_FAULT_SATURATED = 1,
  // A channel does not move at all.
  TRUED_SENSOR_FAULT_STUCK = 2,
  // A channel holds numbers that are none.
  TRUED_SENSOR_FAULT_NOT_FINITE = 3,
  // Blocks or samples are missing, or time jumped.
  TRUED_SENSOR_FAULT_GAPS = 4,
  // The rate is not the configured one, by the blocks' own word or by their times.
  TRUED_SENSOR_FAULT_WRONG_RATE = 5,
  // A channel holds nothing but zero, or has no noise beside channels that have some.
  TRUED_SENSOR_FAULT_DEAD = 6,
  // The blocks have another number of channels than the configuration, or cannot be read.
  TRUED_SENSOR_FAULT_WRONG_SHAPE = 7,
  // Blocks come twice, or after later ones.
  TRUED_SENSOR_FAULT_OUT_OF_ORDER = 8,
  // No block comes at all.
  TRUED_SENSOR_FAULT_SILENT = 9,
  // Blocks are stamped in the future: by another clock, or one that was set.
  TRUED_SENSOR_FAULT_IN_FUTURE = 10,
  // Blocks are stamped long before they come: by another clock, or held up on the way.
  TRUED_SENSOR_FAULT_LATE = 11,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum trued_sensor_fault trued_sensor_fault;
#else
typedef uint32_t trued_sensor_fault;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Where the tool is.
enum trued_in_cut
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // Not told: the watch judges by the forces.
  TRUED_IN_CUT_UNKNOWN = 0,
  // It cuts nothing.
  TRUED_IN_CUT_AIR = 1,
  // It cuts.
  TRUED_IN_CUT_CUT = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum trued_in_cut trued_in_cut;
#else
typedef uint32_t trued_in_cut;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// What became of a request.
enum trued_answer_code
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // Done.
  TRUED_ANSWER_CODE_DONE = 0,
  // Refused; the message says why.
  TRUED_ANSWER_CODE_REFUSED = 1,
  // The request cannot be read.
  TRUED_ANSWER_CODE_MALFORMED = 2,
  // The daemon failed in doing it; the message says where.
  TRUED_ANSWER_CODE_FAILED = 3,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum trued_answer_code trued_answer_code;
#else
typedef uint32_t trued_answer_code;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// What the correction in a target is.
enum trued_source
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // The daemon's, for this very command.
  TRUED_SOURCE_CORRECTED = 0,
  // The daemon's newest, which it made for an earlier command.
  TRUED_SOURCE_LAST_CORRECTION = 1,
  // On its way to what the daemon asks for, or to zero as the daemon is silent.
  TRUED_SOURCE_RAMPING = 2,
  // None, and no daemon that asks for any: the target is the command.
  TRUED_SOURCE_PLAIN = 3,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum trued_source trued_source;
#else
typedef uint32_t trued_source;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// The robot's loop: commands out, corrected targets in. One per cell.
typedef struct trued_client trued_client;

// Sends force blocks: one source per cell.
typedef struct trued_force trued_force;

// Sends measured points of the tool: one instrument per cell.
typedef struct trued_instrument trued_instrument;

// Looks at a cell, and asks its daemon: any number of processes may.
typedef struct trued_monitor trued_monitor;

// One commanded joint target, with what is known beside it.
typedef struct trued_setpoint {
  // sizeof(trued_setpoint).
  uint32_t struct_size;
  // How many joints, 1 to 16.
  uint32_t joints;
  // What else holds: TRUED_HAS_... and its neighbours.
  uint32_t flags;
  // Zero.
  uint32_t reserved;
  // When the target holds, CLOCK_MONOTONIC or a recording's time; 0: now.
  uint64_t t_ns;
  // Joint angles or lengths.
  double q[TRUED_JOINTS_MAX];
  // What acts on the robot at the TCP: force, then moment.
  double wrench[6];
  // Ambient, then one per joint, degrees Celsius; NaN where unknown.
  double temperature_c[TRUED_TEMPERATURES_MAX];
  // From which side each joint comes: -1, 0 or 1.
  int8_t direction[TRUED_JOINTS_MAX];
} trued_setpoint;

// What the robot measures of itself.
typedef struct trued_robot_state {
  // sizeof(trued_robot_state).
  uint32_t struct_size;
  // How many joints, 1 to 16.
  uint32_t joints;
  // What holds: TRUED_STATE_HAS_...
  uint32_t flags;
  // Zero.
  uint32_t reserved;
  // Time of measurement.
  uint64_t t_ns;
  // Measured joint positions.
  double q_measured[TRUED_JOINTS_MAX];
  // Measured joint torques or forces.
  double tau[TRUED_JOINTS_MAX];
  // Ambient, then one per joint, degrees Celsius; NaN where unknown.
  double temperature_c[TRUED_TEMPERATURES_MAX];
} trued_robot_state;

// A joint target, to be sent to the robot.
typedef struct trued_target {
  // sizeof(trued_target).
  uint32_t struct_size;
  // As many as the command had.
  uint32_t joints;
  // What the correction in it is: a trued_source.
  uint32_t source;
  // Zero.
  uint32_t reserved;
  // The target.
  double q[TRUED_JOINTS_MAX];
} trued_target;

// What the daemon answers to a command.
typedef struct trued_corrected {
  // sizeof(trued_corrected).
  uint32_t struct_size;
  // How many joints; 0 where no good command has come yet.
  uint32_t joints;
  // A trued_correction_status.
  uint32_t status;
  // A trued_reason.
  uint32_t reason;
  // A trued_wrench_gate.
  uint32_t wrench_gate;
  // Newton steps spent.
  uint32_t iterations;
  // From 1, plus 1 with each answer of this daemon.
  uint64_t seq;
  // The number of the command that it answers, as trued_client_send() told it.
  uint64_t command_seq;
  // The `t_ns` of that command.
  uint64_t t_ns;
  // When the daemon took that command.
  uint64_t received_ns;
  // When this answer was made.
  uint64_t made_ns;
  // Which model made it: plus 1 with each swap.
  uint64_t model_epoch;
  // What of `q` is correction.
  double correction[TRUED_JOINTS_MAX];
  // How fast that changes, per s.
  double correction_rate[TRUED_JOINTS_MAX];
  // How fast the rate changes, per s^2.
  double correction_acceleration[TRUED_JOINTS_MAX];
  // What the model asks for before the envelope; in shadow mode `correction` is zero, this is not.
  double wanted[TRUED_JOINTS_MAX];
  // Undamped residual of the solution, position, m.
  double residual_m;
  // Undamped residual of the solution, orientation, rad.
  double residual_rad;
} trued_corrected;

// How the daemon is. Numbers that are not known are NaN.
typedef struct trued_status {
  // sizeof(trued_status).
  uint32_t struct_size;
  // The daemon's process.
  uint32_t pid;
  // From 1, plus 1 with each status of this daemon.
  uint64_t seq;
  // When it was made.
  uint64_t t_ns;
  // When the daemon started.
  uint64_t started_ns;
  // Plus 1 with each swap of the model.
  uint64_t model_epoch;
  // Identity of the model.
  uint64_t model_hash;
  // Cycles run.
  uint64_t cycles;
  // Cycles that came too late.
  uint64_t missed_cycles;
  // Commands taken.
  uint64_t commands;
  // Commands refused.
  uint64_t rejected;
  // Targets with the last correction held.
  uint64_t held;
  // Times that the commands fell silent.
  uint64_t stale;
  // Commands that never came.
  uint64_t commands_lost;
  // Targets that could not be handed over.
  uint64_t corrected_lost;
  // Force blocks taken.
  uint64_t force_blocks;
  // Force blocks that never came.
  uint64_t force_gaps;
  // Force blocks refused.
  uint64_t force_refused;
  // Messages that could not be read.
  uint64_t malformed;
  // Entries that the black box dropped.
  uint64_t recorder_dropped;
  // From a command's sending to its answer, the middle.
  uint64_t latency_p50_ns;
  // The same at 99 %.
  uint64_t latency_p99_ns;
  // The same at 99.9 %.
  uint64_t latency_p999_ns;
  // The worst.
  uint64_t latency_max_ns;
  // Since when the model does not hold, by measurements of the tool; 0 while it holds.
  uint64_t model_broken_since_ns;
  // Measurements of the tool since the model was loaded.
  uint64_t model_measurements;
  // How far the last of them were from the model, root mean square, m.
  double model_residual_m;
  // Loop gain of the wrench correction.
  double wrench_loop_gain;
  // Spindle speed that the vibration watch goes by, 1/min.
  double spindle_rpm;
  // Feed that it goes by, mm/s.
  double feed_mm_s;
  // A trued_health.
  uint32_t health;
  // A trued_mode.
  uint32_t mode;
  // 1 where bypassed.
  uint32_t bypassed;
  // How many joints the model has.
  uint32_t joints;
  // A trued_wrench_gate.
  uint32_t wrench_gate;
  // A trued_recorder_state.
  uint32_t recorder;
  // A trued_watch_state.
  uint32_t watch;
  // A trued_in_cut, as told.
  uint32_t in_cut;
  // Effects in the model that the cycle does not correct.
  uint32_t uncompensated_effects;
  // What is wrong with the force stream: bit n is the trued_sensor_fault n.
  uint32_t stream_faults;
  // The same of each force channel.
  uint32_t channel_faults[6];
  // Lower joint limits.
  double q_min[TRUED_JOINTS_MAX];
  // Upper joint limits.
  double q_max[TRUED_JOINTS_MAX];
  // Largest correction.
  double correction_max[TRUED_JOINTS_MAX];
  // Largest rate of the correction, per s.
  double correction_rate_max[TRUED_JOINTS_MAX];
  // Largest jerk of the correction, per s^3.
  double correction_jerk_max[TRUED_JOINTS_MAX];
  // What a person should know.
  char message[TRUED_WORDS_MAX];
  // Hash of the robot's nominal geometry: kinds and axes of the joints, nothing else.
  uint64_t geometry_hash;
  // Temperatures that were known and are too old: bit 0 the ambient one, bit n that of joint n.
  uint32_t stale_temperatures;
  // Zero.
  uint32_t reserved;
  // The robot's maker as the model states it; empty where it does not.
  char robot_maker[TRUED_NAME_MAX];
  // The robot's type, likewise.
  char robot_type[TRUED_NAME_MAX];
  // The robot's serial number, likewise.
  char robot_serial[TRUED_NAME_MAX];
  // The last command, rad or m.
  double q_command[TRUED_JOINTS_MAX];
  // The correction that the daemon allowed for it, rad or m.
  double correction[TRUED_JOINTS_MAX];
  // A trued_trim_state.
  uint32_t trim_state;
  // A trued_trim_reason.
  uint32_t trim_reason;
  // What the tool's target is displaced by, base frame, m.
  double trim_m[3];
  // What the instrument finds of the model's error, base frame, m: real minus predicted.
  double trim_found_m[3];
  // Measured points that came.
  uint64_t trim_measurements;
  // Those of them that were refused.
  uint64_t trim_refused;
} trued_status;

// One verdict on one line of the force spectrum. Numbers that are not known are NaN.
typedef struct trued_vibration {
  // sizeof(trued_vibration).
  uint32_t struct_size;
  // A trued_vibration_state.
  uint32_t state;
  // A trued_vibration_class.
  uint32_t kind;
  // Classes not ruled out: bit n is the trued_vibration_class n.
  uint32_t rivals;
  // Channel: 0 to 5 for Fx Fy Fz Mx My Mz.
  uint32_t axis;
  // 1 where the line may stand above half the sampling rate in truth.
  uint32_t suspect_alias;
  // A trued_advice.
  uint32_t advice;
  // What is wrong with its channel and the stream: bit n is the trued_sensor_fault n.
  uint32_t sensor_faults;
  // The number of the stability pocket that the advice names; 0: none.
  uint32_t advice_lobe;
  // The joint whose gear train turns at this frequency, from 1; 0: none.
  uint32_t gear_joint;
  // Its shaft, from 1, motor side first.
  uint32_t gear_shaft;
  // Zero.
  uint32_t reserved;
  // From 1, plus 1 with each verdict of this daemon.
  uint64_t seq;
  // Time of the last force sample that took part.
  uint64_t t_ns;
  // When the verdict was made.
  uint64_t made_ns;
  // Names one ringing from its first warning to its end.
  uint64_t event;
  // Frequency, Hz.
  double frequency_hz;
  // Amplitude (peak) on `axis`, N or N m.
  double amplitude;
  // Rate of growth of the amplitude, 1/s.
  double growth_per_s;
  // Spindle speed that the advice names, 1/min.
  double advice_rpm;
  // Nearest mode of the structure, Hz.
  double nearest_mode_hz;
  // Distance to it, Hz.
  double mode_distance_hz;
  // Nearest spindle or tooth-passing harmonic, Hz.
  double nearest_harmonic_hz;
  // Distance to it, Hz.
  double harmonic_distance_hz;
  // Nearest alias of a known line, Hz.
  double nearest_alias_hz;
  // Distance to it, Hz.
  double alias_distance_hz;
  // All of it as a sentence: what rings, why, and what to do.
  char sentence[TRUED_WORDS_MAX];
} trued_vibration;

// How the connection is, or what happened to it.
typedef struct trued_connection {
  // sizeof(trued_connection).
  uint32_t struct_size;
  // 1: joined, and the daemon lives; 0: the library is trying.
  uint32_t is_connected;
  // The daemon's process; 0 while there is none.
  uint32_t pid;
  // Why not connected: a trued_code; TRUED_OK where connected.
  int32_t why;
  // Changes with each start of the daemon.
  uint64_t epoch;
  // Why not connected, in words; only in an event.
  char words[TRUED_WORDS_MAX];
} trued_connection;

// What the daemon answered to a request.
typedef struct trued_answer {
  // sizeof(trued_answer).
  uint32_t struct_size;
  // A trued_answer_code.
  uint32_t answer;
  // When it was made.
  uint64_t t_ns;
  // What was done, or why not.
  char message[TRUED_WORDS_MAX];
} trued_answer;

// What the process does, for the vibration watch.
typedef struct trued_process {
  // sizeof(trued_process).
  uint32_t struct_size;
  // Teeth of the cutter; 0 where unknown.
  uint32_t teeth;
  // A trued_in_cut.
  uint32_t in_cut;
  // Zero.
  uint32_t reserved;
  // How long this holds; 0: until the next word.
  uint64_t holds_ns;
  // Spindle speed, 1/min; 0 where it stands, NaN where unknown.
  double spindle_rpm;
  // Feed along the path, mm/s; NaN: the daemon takes it from the commanded path.
  double feed_mm_s;
} trued_process;

// Where an instrument saw the tool centre point, at rest and with nothing pulling at the tool.
typedef struct trued_measured {
  // sizeof(trued_measured).
  uint32_t struct_size;
  // How many joints, 1 to 16.
  uint32_t joints;
  // The joint positions that were published there.
  double q[TRUED_JOINTS_MAX];
  // The tool centre point in the robot's base frame, m.
  double point_m[3];
  // Standard uncertainty of each of its numbers, instrument and model together, m.
  double sigma_m;
  // Temperature around the robot, degrees Celsius; NaN where unknown.
  double ambient_c;
  // From which side each joint came: -1 or 1; 0 where unknown.
  int8_t direction[TRUED_JOINTS_MAX];
} trued_measured;

// Evenly spaced force samples of one stretch of time.
typedef struct trued_force_samples {
  // sizeof(trued_force_samples).
  uint32_t struct_size;
  // 3 to 6: the first of Fx Fy Fz Mx My Mz.
  uint32_t channels;
  // Samples per channel, 1 to 512.
  uint32_t count;
  // 1: the samples stand in the base's axes; 0: in the tool's.
  uint32_t in_base;
  // Time of the first sample.
  uint64_t t_ns;
  // Sampling rate, Hz.
  double rate_hz;
  // Sample by sample, `channels` doubles each; or NULL where the samples are floats.
  const double *doubles;
  // The same as floats; or NULL.
  const float *floats;
} trued_force_samples;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// The version of the library that is loaded. Another major than TRUED_ABI_VERSION's does not fit; a smaller minor lacks
// something that this header has.
uint32_t trued_abi_version(void);

// The version of the library for people, with the contract that it shares with the daemon. Never NULL, never to be freed.
const char *trued_version(void);

// CLOCK_MONOTONIC, the one clock of all times here.
uint64_t trued_monotonic_ns(void);

// Joins the daemon of `cell` within the limit. `runtime_dir` is the directory that the daemon was given by
// TRUED_RUNTIME_DIR; NULL: that of this process, or /dev/shm. `*client` is NULL where it fails.
trued_code trued_client_connect(const char *cell,
                                const char *runtime_dir,
                                uint64_t limit_ns,
                                struct trued_client **client);

// Leaves the daemon and frees the handle, within about a second. NULL is no error.
trued_code trued_client_close(struct trued_client *client);

// How old an answer of the daemon may be for trued_client_target(): 10 ms unless told otherwise.
trued_code trued_client_set_fresh(struct trued_client *client, uint64_t fresh_ns);

// Begins another run: nothing of the path so far is remembered. The correction goes on from where it stands.
trued_code trued_client_start_anew(struct trued_client *client);

// Sends a commanded target. `seq` (may be NULL) gets its number. Waits for nothing.
trued_code trued_client_send(struct trued_client *client, const struct trued_setpoint *setpoint, uint64_t *seq);

// The same for joints alone, valid now.
trued_code trued_client_send_joints(struct trued_client *client, const double *q, uint32_t joints, uint64_t *seq);

// Sends what the robot measures of itself.
trued_code trued_client_send_state(struct trued_client *client, const struct trued_robot_state *state);

// What to send to the robot for `q_cmd` at `now_ns` (trued_monotonic_ns()), whatever has become of the daemon: `q_cmd` plus a
// correction that goes on from what was sent last within the daemon's limits: towards the daemon's while an answer is fresh, else to
// zero. Waits for nothing. TRUED_ERROR_ARGUMENT where `q_cmd` holds no finite number: nothing has changed then, and
// trued_client_last_target() is what was sent last.
trued_code trued_client_target(struct trued_client *client,
                               const double *q_cmd,
                               uint32_t joints,
                               uint64_t now_ns,
                               struct trued_target *target);

// What was sent to the robot last, for a loop that has to send something and has no command; TRUED_NOTHING before the first target.
trued_code trued_client_last_target(struct trued_client *client,
                                    struct trued_target *target);

// Begins another run. The robot is at its command plus this correction: rad or m, one number per joint. NULL and 0 joints mean zero:
// the robot's program was restarted, and the controller's sum of corrections with it.
trued_code trued_client_start_from(struct trued_client *client,
                                   const double *correction,
                                   uint32_t joints);

// Sends joints and waits for their answer within the limit; fills in `target` like trued_client_target() in any case.
trued_code trued_client_exchange(struct trued_client *client,
                                 const double *q_cmd,
                                 uint32_t joints,
                                 uint64_t limit_ns,
                                 struct trued_target *target);

// The newest answer of this daemon, however old; TRUED_NOTHING before the first.
trued_code trued_client_newest(struct trued_client *client, struct trued_corrected *corrected);

// The answer to the command of that number, within the limit.
trued_code trued_client_wait_corrected(struct trued_client *client,
                                       uint64_t seq,
                                       uint64_t limit_ns,
                                       struct trued_corrected *corrected);

// The newest status; TRUED_NOTHING before the first.
trued_code trued_client_status(struct trued_client *client, struct trued_status *status);

// The next verdict on vibration not yet taken; TRUED_NOTHING where there is none.
trued_code trued_client_vibration(struct trued_client *client, struct trued_vibration *vibration);

// How the connection is.
trued_code trued_client_connection(struct trued_client *client, struct trued_connection *connection);

// The next event of the connection not yet taken, oldest first; TRUED_NOTHING where there is none.
trued_code trued_client_next_event(struct trued_client *client, struct trued_connection *event);

// Asks for a sign of life. `answer` may be NULL, here and in all requests.
trued_code trued_client_ping(struct trued_client *client, uint64_t limit_ns, struct trued_answer *answer);

// Asks to load a model file and to swap it in; `path` NULL: the one loaded now, read again.
trued_code trued_client_reload(struct trued_client *client,
                               const char *path,
                               uint64_t limit_ns,
                               struct trued_answer *answer);

// Asks to ramp the correction out (`on` not 0), or in again.
trued_code trued_client_bypass(struct trued_client *client,
                               uint32_t on,
                               uint64_t limit_ns,
                               struct trued_answer *answer);

// Asks to go to shadow mode (`on` 0), or back to the configured one; where that is shadow, the answer is a refusal.
trued_code trued_client_arm(struct trued_client *client, uint32_t on, uint64_t limit_ns, struct trued_answer *answer);

// Asks to go to a mode, a trued_mode: at most to the one that the configuration of the cell allows; else the answer is a refusal.
trued_code trued_client_mode(struct trued_client *client,
                             uint32_t mode,
                             uint64_t limit_ns,
                             struct trued_answer *answer);

// Writes a marker with this text into the recording; where nothing is recorded, the answer is a refusal.
trued_code trued_client_mark(struct trued_client *client,
                             const char *text,
                             uint64_t limit_ns,
                             struct trued_answer *answer);

// Asks the recorder to start, to stop, or to keep the present recording: `action` is a trued_recorder_action.
trued_code trued_client_record(struct trued_client *client,
                               uint32_t action,
                               uint64_t limit_ns,
                               struct trued_answer *answer);

// Tells what the process does, in place of what was told before.
trued_code trued_client_process_state(struct trued_client *client,
                                      const struct trued_process *process,
                                      uint64_t limit_ns,
                                      struct trued_answer *answer);

// Tells where the tool was measured; the answer says whether the model still holds.
trued_code trued_client_measured(struct trued_client *client,
                                 const struct trued_measured *measured,
                                 uint64_t limit_ns,
                                 struct trued_answer *answer);

// The words of this thread's last error, empty where there was none: never NULL, UTF-8. They stay until the next error of
// this thread.
const char *trued_last_error(void);

// The name of a code, "TRUED_OK"; "TRUED_UNKNOWN" for a number that is none. Never NULL, never to be freed.
const char *trued_code_name(int32_t code);

// Joins the daemon of `cell`, as trued_client_connect() does.
trued_code trued_force_connect(const char *cell,
                               const char *runtime_dir,
                               uint64_t limit_ns,
                               struct trued_force **force);

// Leaves the daemon and frees the handle, within about a second. NULL is no error.
trued_code trued_force_close(struct trued_force *force);

// Sends one block. What cannot be handed over is lost and counted, on both sides; nothing is waited for.
trued_code trued_force_send(struct trued_force *force, const struct trued_force_samples *samples);

// Blocks lost so far.
trued_code trued_force_lost(struct trued_force *force, uint64_t *lost);

// How the connection is.
trued_code trued_force_connection(struct trued_force *force, struct trued_connection *connection);

// The next event of the connection not yet taken, oldest first; TRUED_NOTHING where there is none.
trued_code trued_force_next_event(struct trued_force *force, struct trued_connection *event);

// Joins the daemon of `cell`, as trued_client_connect() does.
trued_code trued_instrument_connect(const char *cell,
                                    const char *runtime_dir,
                                    uint64_t limit_ns,
                                    struct trued_instrument **instrument);

// Leaves the daemon and frees the handle, within about a second. NULL is no error.
trued_code trued_instrument_close(struct trued_instrument *instrument);

// Sends a point in the instrument's own coordinates, three numbers, m, that was measured at `t_ns` of CLOCK_MONOTONIC; 0: the daemon takes the latency
// that its cell states. What is not measured (the beam is broken) is not sent. What cannot be handed over is lost and counted; nothing is waited for.
trued_code trued_instrument_send(struct trued_instrument *instrument,
                                 const double *point_m,
                                 uint64_t t_ns);

// Points lost so far.
trued_code trued_instrument_lost(struct trued_instrument *instrument, uint64_t *lost);

// How the connection is.
trued_code trued_instrument_connection(struct trued_instrument *instrument, struct trued_connection *connection);

// The next event of the connection not yet taken, oldest first; TRUED_NOTHING where there is none.
trued_code trued_instrument_next_event(struct trued_instrument *instrument, struct trued_connection *event);

// Joins the daemon of `cell`, as trued_client_connect() does.
trued_code trued_monitor_connect(const char *cell,
                                 const char *runtime_dir,
                                 uint64_t limit_ns,
                                 struct trued_monitor **monitor);

// Leaves the daemon and frees the handle, within about a second. NULL is no error.
trued_code trued_monitor_close(struct trued_monitor *monitor);

// The newest status; TRUED_NOTHING before the first.
trued_code trued_monitor_status(struct trued_monitor *monitor, struct trued_status *status);

// The next verdict on vibration not yet taken; TRUED_NOTHING where there is none.
trued_code trued_monitor_vibration(struct trued_monitor *monitor, struct trued_vibration *vibration);

// How the connection is.
trued_code trued_monitor_connection(struct trued_monitor *monitor, struct trued_connection *connection);

// The next event of the connection not yet taken, oldest first; TRUED_NOTHING where there is none.
trued_code trued_monitor_next_event(struct trued_monitor *monitor, struct trued_connection *event);

// Asks for a sign of life. `answer` may be NULL, here and in all requests.
trued_code trued_monitor_ping(struct trued_monitor *monitor, uint64_t limit_ns, struct trued_answer *answer);

// Asks to load a model file and to swap it in; `path` NULL: the one loaded now, read again.
trued_code trued_monitor_reload(struct trued_monitor *monitor,
                                const char *path,
                                uint64_t limit_ns,
                                struct trued_answer *answer);

// The same, for a model of another robot, or one whose limits the arm is already outside of: done in shadow mode only.
trued_code trued_monitor_reload_other_robot(struct trued_monitor *monitor,
                                            const char *path,
                                            uint64_t limit_ns,
                                            struct trued_answer *answer);

// Asks to ramp the correction out (`on` not 0), or in again.
trued_code trued_monitor_bypass(struct trued_monitor *monitor,
                                uint32_t on,
                                uint64_t limit_ns,
                                struct trued_answer *answer);

// Asks to go to shadow mode (`on` 0), or back to the configured one; where that is shadow, the answer is a refusal.
trued_code trued_monitor_arm(struct trued_monitor *monitor,
                             uint32_t on,
                             uint64_t limit_ns,
                             struct trued_answer *answer);

// Asks to go to a mode, a trued_mode: at most to the one that the configuration of the cell allows; else the answer is a refusal.
trued_code trued_monitor_mode(struct trued_monitor *monitor,
                              uint32_t mode,
                              uint64_t limit_ns,
                              struct trued_answer *answer);

// Writes a marker with this text into the recording; where nothing is recorded, the answer is a refusal.
trued_code trued_monitor_mark(struct trued_monitor *monitor,
                              const char *text,
                              uint64_t limit_ns,
                              struct trued_answer *answer);

// Asks the recorder to start, to stop, or to keep the present recording: `action` is a trued_recorder_action.
trued_code trued_monitor_record(struct trued_monitor *monitor,
                                uint32_t action,
                                uint64_t limit_ns,
                                struct trued_answer *answer);

// Tells what the process does, in place of what was told before.
trued_code trued_monitor_process_state(struct trued_monitor *monitor,
                                       const struct trued_process *process,
                                       uint64_t limit_ns,
                                       struct trued_answer *answer);

// Tells where the tool was measured; the answer says whether the model still holds.
trued_code trued_monitor_measured(struct trued_monitor *monitor,
                                  const struct trued_measured *measured,
                                  uint64_t limit_ns,
                                  struct trued_answer *answer);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* TRUED_H */
