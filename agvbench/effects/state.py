"""The state of one vehicle at one time, which the hooks of effects read and change: an array with named indices.

Angles are counter-clockwise positive, speeds forward positive; units are SI and radians. `Effect` lists the hooks
and the indices that each may change; the how-to "Write an effect" describes the indices.
"""

from __future__ import annotations

# Time in the run [s], hours since the session began, distance driven in the run [m].
TIME, HOURS, DISTANCE = range(3)
# True pose of the point that the vehicle file calls the marker centroid, in the floor frame.
X, Y, HEADING = range(3, 6)
# The command in force, each as its distance from neutral, in command units.
DRIVE_COMMAND, FRONT_COMMAND, REAR_COMMAND = range(6, 9)
# Its steady state by the static maps: axle angles and speed.
FRONT_AIM, REAR_AIM, SPEED_AIM = range(9, 12)
# Dynamics: servos obey δ̇ = (aim − δ) / lag within ± rate, and the front axle follows with a backlash of this width.
STEERING_LAG, STEERING_RATE, FRONT_BACKLASH = range(12, 15)
# The drive obeys v̇ = (aim − v) / lag, one lag for |v| growing, one for |v| falling.
ACCELERATE_LAG, BRAKE_LAG = range(15, 17)
# Angles of the axles, speed of the drive.
FRONT, REAR, SPEED = range(17, 20)
# Tangents of the angles, and the speed of each axle along its wheels.
TAN_FRONT, TAN_REAR, FRONT_SPEED, REAR_SPEED = range(20, 24)
# Motion of the marker centroid in the vehicle frame: forward, to the left, turning.
FORWARD, LEFT, YAW_RATE = range(24, 27)
# Its velocity in the floor frame.
X_RATE, Y_RATE = range(27, 29)
# The pose that the camera reports.
SEEN_X, SEEN_Y, SEEN_HEADING = range(29, 32)
# Cache of the simulation: cosines, and their angles.
COS_FRONT, COS_REAR, KNOWN_FRONT, KNOWN_REAR = range(32, 36)
# Steady-state angle of each axle under its previous command.
FRONT_BEFORE, REAR_BEFORE = range(36, 38)
# Servos of second order: τ of τ² δ̈ + lag δ̇ = aim − δ, without a rate limit; or the limit of |δ̈|, with that of the rate
# and without a lag.
STEERING_INERTIA, STEERING_ACCELERATION = range(38, 40)
# Limits of the drive: |v̇| while |v| grows, and while it falls; see `BODY_ACCELERATION_LIMIT`.
ACCELERATION_LIMIT, BRAKING_LIMIT = range(40, 42)
# Delay of the drive's commands relative to those of the front servo; see `REAR_WAIT`.
DRIVE_WAIT = 42
# Time constant with which the camera smooths the pose.
SEEN_LAG = 43
# Delay of the rear servo's commands relative to those of the front servo.
REAR_WAIT = 44
# Steady-state angle of each axle at its last reversal: from there on its commands went one way.
FRONT_REVERSAL, REAR_REVERSAL = range(45, 47)
# An elastic drive train without power: v̇ = −v / brake lag − spring w, where w winds up with v and relaxes.
COAST_SPRING, COAST_RELAXATION = range(47, 49)
# Share of the axle speeds that the drag of turned wheels leaves.
DRAGGED = 49
# Lag and τ of the rear servo over those of the front servo.
REAR_LAG_RATIO = 50
# Width of the backlash of the rear axle.
REAR_BACKLASH = 51
# A drive of second order: τ of τ² v̈ + lag v̇ = aim − v, without limits of v̇.
DRIVE_INERTIA = 52
# Hysteresis of each axle: how far it lags behind, as a share of the most (−1…1), and the angle at which that holds.
FRONT_LAGS, REAR_LAGS, FRONT_LAGS_AT, REAR_LAGS_AT = range(53, 57)
# Backlash of the drive train: the distance that the wheels would go while the motor turns through it at a start.
DRIVE_BACKLASH = 57
# Distance driven forward less that driven backward in the run: the angle that a wheel has turned, times its radius.
ROLLED = 58
# When the drive was last commanded to start from rest [s], and 1 while it is commanded to drive.
DRIVE_START, DRIVES = range(59, 61)
# The same for the longitudinal speed of the body, which steered axles drive slower than themselves: limits of a force.
BODY_ACCELERATION_LIMIT, BODY_BRAKING_LIMIT = range(61, 63)
# What the servos have moved recently [rad] and when that was known [s], and where their last moves led.
STEERING_LOAD, STEERING_LOAD_AT, FRONT_MOVED_TO, REAR_MOVED_TO = range(63, 67)
# Rate limit of servos of first order that turn to the right over that of servos that turn to the left.
RIGHT_RATE_RATIO = 67
# Creep of each axle: the way that it had left at the last command, its target since then, and that time [s].
FRONT_CREEP, REAR_CREEP, FRONT_HELD, REAR_HELD, CREEP_AT = range(68, 73)
# Dead band of each servo: the target that it obeys, and the command that led there.
FRONT_KEPT, REAR_KEPT, FRONT_KEPT_AT, REAR_KEPT_AT = range(73, 77)
# The side to which each linkage slipped last: −1, 0 or 1.
FRONT_SLIPPED, REAR_SLIPPED = range(77, 79)
# Heading at the start of the run.
START_HEADING = 79
# When the drive was last commanded to the other direction [s], and the direction: −1 or 1; 0 before a run.
DRIVE_REVERSED, DRIVE_DIRECTION = range(80, 82)
# The mean commanded speed of the last seconds [m/s], when that was known [s], and the commanded speed since then.
DRIVE_LOAD, DRIVE_LOAD_AT, DRIVE_HELD = range(82, 85)
# Integral part of a controller of the yaw rate [rad/s], when that was known [s], and the target since then.
YAW_INTEGRAL, YAW_INTEGRAL_AT, YAW_TARGET = range(85, 88)
# The yaw rate measured where a simulation begins in motion [rad/s], and its weight (0…1) beside that of the commands.
MEASURED_YAW_RATE, MEASURED_WEIGHT = range(88, 90)
# What the lab logged about the run, each column standardised; 0 where nothing was logged.
LOGGED, LOGGED_COUNT = 90, 16
SIZE = LOGGED + LOGGED_COUNT
