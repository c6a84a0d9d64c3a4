"""What an effect's hooks see and change: the state of one vehicle at one moment, an array with a place for each number.

Angles are counter-clockwise positive, speeds forward positive; units are SI and radians. `Hook` says which hook
may change what.
"""

from __future__ import annotations

# When: seconds in the run, hours since the session began, metres driven in the run.
TIME, HOURS, DISTANCE = range(3)
# True pose of the point that the vehicle file calls the marker centroid, in the floor frame.
X, Y, HEADING = range(3, 6)
# The command in force, each as its distance from neutral, in command units.
DRIVE_COMMAND, FRONT_COMMAND, REAR_COMMAND = range(6, 9)
# What the static maps make of it: where axles and drive settle.
FRONT_AIM, REAR_AIM, SPEED_AIM = range(9, 12)
# How they get there: servos obey δ̇ = (aim − δ) / lag within ± rate, and the axle follows with a play of this width.
STEERING_LAG, STEERING_RATE, BACKLASH = range(12, 15)
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
# Kept by the simulation: cosines, and the angles that they belong to.
COS_FRONT, COS_REAR, KNOWN_FRONT, KNOWN_REAR = range(32, 36)
# Where steering settled under the command before the one in force, for each axle whose command has changed.
FRONT_BEFORE, REAR_BEFORE = range(36, 38)
# Servos of another order: with inertia, τ² δ̈ + lag δ̇ = aim − δ, where this is τ, and no rate is kept to; or with a
# limit of |δ̈|, as fast as this and the rate allow, and no lag.
STEERING_INERTIA, STEERING_ACCELERATION = range(38, 40)
# What the lags of the drive ask for is limited: |v̇| while |v| grows, and while it falls.
ACCELERATION_LIMIT, BRAKING_LIMIT = range(40, 42)
# The drive's commands arrive so much later than those of the front servo, or sooner if negative; see `REAR_WAIT`.
DRIVE_WAIT = 42
# What the camera reports follows what it sees with this lag.
SEEN_LAG = 43
# The rear servo's commands arrive so much later than those of the front servo, or sooner if negative.
REAR_WAIT = 44
SIZE = 45
